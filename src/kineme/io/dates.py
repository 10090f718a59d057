"""Time stamps that are written as dates, such as 2024-05-06T07:08:09.25Z."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np

from kineme.validation import Array

_DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d([.,]\d+)?)?\s?(Z|[-+]\d\d:?\d\d)?")


def is_date(cell: str) -> bool:
    """Whether a cell reads as a date with a time of day, after ISO 8601."""
    return _DATE.fullmatch(cell) is not None


def seconds_of_dates(cells: Sequence[str]) -> tuple[Array, dict[int, str]]:
    """Seconds since 1970 to the microsecond, NaN where a cell is no date; and row -> that cell. No zone is UTC."""
    seconds, others = np.full(len(cells), np.nan), {}
    for row, cell in enumerate(cells):
        try:
            date = datetime.fromisoformat(cell.strip())
            seconds[row] = (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()
        except (ValueError, OverflowError):
            others[row] = cell
    return seconds, others
