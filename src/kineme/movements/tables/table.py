"""A table of samples in memory, from any file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of numbers and of texts.

    Attributes
    ----------
    heads : tuple of str
    columns : sequence of ndarray of shape (rows,)
        Columns of numbers as float64, NaN for missing ones; other columns as objects.
    n_rows : int
    line_of : callable
        Row -> its line in the file, counted from 1, or None.
    faults : dict
        Row -> what is wrong there.
    dates_in : str, optional
        Unit of the time stamps where they are dates or durations, whatever the head says.
    """

    heads: tuple[str, ...]
    columns: Sequence[Any]
    n_rows: int
    line_of: Callable[[int], int | None]
    faults: dict[int, str] = field(default_factory=dict)
    dates_in: str | None = None
