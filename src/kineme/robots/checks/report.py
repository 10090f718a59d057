"""The checks of a trajectory as a table."""

from __future__ import annotations

import math

from kineme.reporting.table import Table
from kineme.robots.checks.check import Check, Preflight


def preflight_table(preflight: Preflight) -> Table:
    """One line for each check: the worst value beside its limit, when, and whether it passed."""
    rows = [
        (f"{one.what}, {one.where}", f"{one.worst:.3g}", _limit(one), one.unit, f"{one.time:.2f}", _verdict(one))
        for one in preflight.checks
    ]
    unchecked = f"Not checked: {'; '.join(preflight.unchecked)}." if preflight.unchecked else ""
    return Table("Preflight", ("check", "worst", "limit", "unit", "at [s]", ""), rows, unchecked)


def _limit(check: Check) -> str:
    return "" if math.isnan(check.limit) else f"{check.limit:.4g}"


def _verdict(check: Check) -> str:
    if math.isnan(check.limit):
        return ""
    return "ok" if check.passed else "FAILED"
