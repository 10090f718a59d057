"""The heads of text exports of motion capture systems: which columns there are, their units, and the rate."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

STAMP = "time [s]"  # head of the times


class ExportHead(NamedTuple):
    """What stands above the samples of an export.

    Attributes
    ----------
    maker : str
        Such as ``"OptiTrack"``.
    separator : str or None
        None: blanks.
    heads : tuple of str
        One per column; empty for columns that are not coordinates, such as residuals.
    measured_in : tuple of str
        Unit of each column, empty if unknown.
    first : int
        Line of the first sample, counted from 0.
    end : int or None
        Line after the last sample; None: the samples reach to the end of the file.
    rate : float or None
        Samples per second, where the head says it.
    zeros_are_gaps : bool
        Whether three zeros in place of a marker mean that it was not found.
    packed : bool
        Whether cells hold several numbers between commas; `heads` has one for each number.
    """

    maker: str
    separator: str | None
    heads: tuple[str, ...]
    measured_in: tuple[str, ...]
    first: int
    end: int | None = None
    rate: float | None = None
    zeros_are_gaps: bool = False
    packed: bool = False

    @property
    def is_timed(self) -> bool:
        """Whether a column has the times."""
        return STAMP in self.heads


def filled(cells: Iterable[str]) -> Iterator[str]:
    """Cells, the empty ones with what stands before them: names above the first of several columns."""
    last = ""
    for cell in cells:
        last = cell or last
        yield last


def positive(cell: str) -> float | None:
    """A cell as a rate, or None if it is none."""
    try:
        rate = float(cell.replace(",", "."))
    except ValueError:
        return None
    return rate if 0 < rate < float("inf") else None


def without_common_subject(names: Iterable[str]) -> list[str]:
    """Names such as ``subject:marker`` without the subject where there is but one."""
    parts = [name.partition(":") for name in names]
    subjects = {first for first, colon, _ in parts if colon}
    return [rest if colon and len(subjects) == 1 else first + colon + rest for first, colon, rest in parts]
