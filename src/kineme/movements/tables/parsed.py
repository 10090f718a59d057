"""What is parsed from a table or from arrays: movements as a block, not yet checked, and how they were understood."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.validation import Array

_SHOWN = 40  # names in a message


class Detected(NamedTuple):
    """How a file was understood.

    Attributes
    ----------
    format : str
        Such as ``"CSV"``.
    layout : str
        ``"wide"``, one movement; ``"long"``, told apart by columns; or the layout of arrays.
    columns : tuple of str
        The coordinates; of several columns of one name the later ones are numbered, x, x.1, x.2.
    time : str or None
        The column of the time stamps.
    units : str or float
        Their unit.
    units_from : str
        Source of the unit: ``"given"``, ``"head"``, ``"dates"``; or a guess: ``"since 1970"``, ``"since 1601"``,
        ``"since the year 1"``, ``"by its steps"`` or ``"assumed"``, see
        `kineme.movements.tables.time_stamps.unit_by_size`.
    movement, label, ignored : tuple of str
        Columns that tell movements apart, that name the action, and that are ignored.
    measured_in : tuple of str
        The unit of each coordinate where the file says it, else empty; nothing at all if it says none.
    person : tuple of str
        The column that names who showed a movement.
    named : bool
        Whether the file names the coordinates.
    sentinels : tuple of str
        Numbers that stand for no value, each with its column: ``-9999 in x``.
    converted : tuple of str
        Columns that are in another unit than in the file: ``y_m as y [mm]``.
    """

    format: str
    layout: str
    columns: tuple[str, ...]
    time: str | None
    units: str | float
    units_from: str
    movement: tuple[str, ...] = ()
    label: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()
    measured_in: tuple[str, ...] = ()
    person: tuple[str, ...] = ()
    named: bool = True
    sentinels: tuple[str, ...] = ()
    converted: tuple[str, ...] = ()


class Repair(NamedTuple):
    """What was done about values that one movement lacks.

    Attributes
    ----------
    filled : int
        Number of samples of which values are interpolated.
    longest : float
        Longest gap that was filled, from the sample before to the sample after [s].
    cropped : float
        Time at both ends that was left out, since columns have no values there [s].
    """

    filled: int = 0
    longest: float = 0.0
    cropped: float = 0.0


def no_lines(row: int) -> None:
    """The line of every row of a file that has no lines: None."""


@dataclass(frozen=True, eq=False)
class Block:
    """Movements of one file, one after the other, not yet checked.

    Attributes
    ----------
    positions : ndarray of shape (total, d)
    times : ndarray of shape (total,) or None
        In seconds. None: evenly sampled over one second, as `Demonstrations.from_arrays` takes it.
    offsets : ndarray of shape (n + 1,)
    labels : list of n str or None
    places : list of n str
        Which movement of the file; empty if there is but one.
    rows : ndarray of shape (total,) or None
        Row of the file that each sample comes from, if not in order.
    line_of : callable
        Row of the file -> its line, counted from 1, or None.
    faults : dict
        Row of the file -> what is wrong there.
    people : list of n str or None, optional
        Who showed each movement.
    repairs : list of n Repair, optional
        What was done about missing values.
    """

    positions: Array
    times: Array | None
    offsets: NDArray[np.intp]
    labels: list[str | None]
    places: list[str]
    rows: NDArray[np.intp] | None = None
    line_of: Callable[[int], int | None] = no_lines
    faults: dict[int, str] | None = None
    people: list[str | None] | None = None
    repairs: list[Repair] | None = None

    def row(self, k: int) -> int:
        """Row of the file that sample k comes from."""
        return k if self.rows is None else int(self.rows[k])


class Parsed(NamedTuple):
    """The content of one file or data frame.

    Attributes
    ----------
    detected : Detected
    block : Block
    left_out : tuple of str
        Why parts of it could not be read: topics, episodes. Each becomes a problem of the file.
    """

    detected: Detected
    block: Block
    left_out: tuple[str, ...] = ()


def distinct(names: Sequence[str]) -> tuple[str, ...]:
    """Names with a number after those that came before, as pandas numbers them: x, y, x becomes x, y, x.1."""
    taken, numbers, result = set(names), dict.fromkeys(names, 0), []
    for name in names:
        new = name
        while numbers[name] and new in taken:
            new = f"{name}.{numbers[name]}"
            numbers[name] += new in taken
        numbers[name] = max(numbers[name], 1)
        taken.add(new)
        result.append(new)
    return tuple(result)


def listed(names: Iterable[str]) -> str:
    """Names for a message; only the first ones of very many."""
    some = list(names)
    return str(some) if len(some) <= _SHOWN else f"{some[:_SHOWN]} and {len(some) - _SHOWN} more"
