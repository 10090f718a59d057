"""One thing that was checked, and all of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from kineme.reporting.table import Table
from kineme.robots.models.robot import Robot


class Check(NamedTuple):
    """The worst instant of one quantity beside its limit."""

    what: str  # "velocity", "self-collision", ...
    where: str  # the joint, the two links, or the tip
    time: float  # [s]
    worst: float
    limit: float  # nan where there is none to keep
    unit: str
    passed: bool
    slower: float = 1.0  # the movement would pass if it took so many times as long; inf: at no speed


@dataclass(frozen=True)
class Preflight:
    """All checks of one trajectory.

    Attributes
    ----------
    checks : tuple of Check
        For velocity, acceleration, position and torque the worst instant of each joint, then the arm as a whole.
    unchecked : tuple of str
        What could not be checked and why, one sentence each.
    """

    checks: tuple[Check, ...]
    unchecked: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether every check passed."""
        return all(check.passed for check in self.checks)

    @property
    def failed(self) -> tuple[Check, ...]:
        """The checks that did not pass, the worst ratio to its limit first."""
        return tuple(sorted((c for c in self.checks if not c.passed), key=lambda c: -c.slower))

    @property
    def slower(self) -> float:
        """The least factor of the duration with which all pass; inf if no speed helps."""
        return max((check.slower for check in self.checks if not check.passed), default=1.0)


def unit_of(robot: Robot, joint: int, order: int = 0) -> str:
    """Unit of the position of a joint, of its velocity (order 1) or its acceleration (order 2)."""
    return robot.units[joint] + ("", "/s", "/s^2")[order]


def preflight_table(preflight: Preflight) -> Table:
    """One line for each check: the worst value beside its limit, when, and whether it passed."""
    rows = [
        (
            f"{check.what}, {check.where}",
            f"{check.worst:.3g}",
            _limit(check),
            check.unit,
            f"{check.time:.2f}",
            _verdict(check),
        )
        for check in preflight.checks
    ]
    unchecked = f"Not checked: {'; '.join(preflight.unchecked)}." if preflight.unchecked else ""
    return Table("Preflight", ("check", "worst", "limit", "unit", "at [s]", ""), rows, unchecked)


def _limit(check: Check) -> str:
    return "" if math.isnan(check.limit) else f"{check.limit:.4g}"


def _verdict(check: Check) -> str:
    if math.isnan(check.limit):
        return ""
    return "ok" if check.passed else "FAILED"
