"""Time stamps written as dates, such as 2024-05-06T07:08:09.25Z."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
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


def nanoseconds(stamps: NDArray[Any]) -> Array:
    """Dates or durations (datetime64 or timedelta64 of any unit) as nanoseconds, NaN for missing ones.

    Raises
    ------
    DataError
        Dates out of the range of nanoseconds; NumPy before 2.5 would wrap them around silently.
    """
    missing = np.isnat(stamps)
    try:
        counts = stamps.astype(f"{stamps.dtype.kind}8[ns]")
        counted = bool(((counts.astype(stamps.dtype) == stamps) | missing).all())
    except OverflowError:
        counted = False
    if not counted:
        known = stamps[~missing]
        farthest = known[np.abs(known.astype(np.int64).astype(np.float64)).argmax()]
        raise DataError(f"expected dates from 1678 to 2262 or durations of that size, got {farthest}")
    return np.where(missing, np.nan, counts.astype(np.int64))
