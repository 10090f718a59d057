"""Outliers as text for people, and as plain data for programs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from kineme.recognition.outliers import Outliers
from kineme.reporting.table import Table, to_text
from kineme.reporting.text import counted, printable

_SHOWN = 50  # rows of the table; the rest is counted


def outliers_as_data(outliers: Outliers, names: Sequence[str]) -> dict[str, Any]:
    """Nested lists and dictionaries, with the names of the movements."""
    found = [
        {
            "movement": names[one.index], "label": one.label, "ratio": one.ratio, "p_value": one.p_value,
            "most_like": names[one.most_like], "label_of_most_like": one.label_of_most_like,
        }
        for one in outliers.found
    ]  # fmt: skip
    return {"checked": outliers.checked, "error_rate": outliers.error_rate, "found": found}


def outliers_as_words(outliers: Outliers, names: Sequence[str]) -> str:
    """A table, the most unlike first; empty if no movement was checked."""
    if not outliers.checked:
        return ""
    if not outliers.found:
        return f"no outliers: none of {counted(outliers.checked, 'movement')} is unlike the others of its label"
    title = (
        f"outliers: {len(outliers.found):,} of {counted(outliers.checked, 'movement')} unlike the others of their label"
        f" (about {100 * outliers.error_rate:.2g} % of those listed are false alarms)"
    )
    rows = [
        (
            printable(names[one.index]),
            printable(str(one.label)),
            f"{one.ratio:.1f} times",
            f"{one.p_value:.1g}",
            printable(f"{names[one.most_like]} ({one.label_of_most_like})"),
        )
        for one in outliers.found[:_SHOWN]
    ]
    more = len(outliers.found) - _SHOWN
    table = to_text(Table(title, ("movement", "label", "farther than usual", "p-value", "most like"), rows))
    return f"{table}\nand {more:,} more" if more > 0 else table
