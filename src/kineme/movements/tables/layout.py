"""The caller's choices about the columns of a recording, of which others are detected; and what is parsed with them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.movements.tables.time_stamps import PER_SECOND
from kineme.units import is_unit_of, unit_named
from kineme.validation import MIN_SAMPLES, Array, check_choice, check_count, check_number

_SHOWN = 40  # names in a message

Column = str | int  # head, or number counted from 0

SKIP = ("movement", "sample")

#: Longest gap [s] that is filled unless the caller says otherwise.
FILL_GAPS = 0.2

#: What the layout of a file ends with if nobody asked for its topic or frame, see `Layout.reference`.
AS_KNOWN = ", as the movements to compare with"


@dataclass(frozen=True)
class Known:
    """The origin of movements that were read before, for recordings that are compared with them."""

    # Topics and frames of bags, each choice as it was asked for.
    choices: tuple[tuple[tuple[str, ...], tuple[str, ...]], ...] = ()
    columns: tuple[str, ...] = ()  # their columns; empty if these are not known
    n_orientations: int = 0  # how many quaternions are among the columns
    moving: tuple[str, ...] = ()  # the columns without those that are discrete


@dataclass(frozen=True)
class Layout:
    """The roles of the columns. None: detect them from heads and numbers, and report them."""

    time: Column | None = None  # column of the time stamps
    columns: Column | Sequence[Column] | None = None  # columns of the coordinates, in that order
    movement: Column | Sequence[Column] | None = None  # columns that tell the movements of a long table apart
    label: Column | None = None  # column that names the action
    # Unit of the time stamps, of time in `kineme.units.UNITS`, or the number of seconds in one unit. As a number, it
    # is the step between samples of a file that has no time stamps at all.
    units: str | float | None = None
    skip: str = "movement"  # what a missing or repeated sample costs: its "movement", or the "sample" alone
    # Heads of columns, separated by commas, -> "position", "angle" or "discrete"; of four -> "wxyz" or "xyzw", the
    # order of a quaternion. What several heads begin with, before a dot, stands for all of them.
    kinds: Mapping[str, str] | None = None
    # Topics of a bag; of several, the others are interpolated to the stamps of the first.
    topic: str | Sequence[str] | None = None
    # Pairs of frames of a bag, as ``"parent:child"``: the pose of the child in the parent.
    frame: str | Sequence[str] | None = None
    person: Column | None = None  # column that names who showed a movement; another movement begins where it changes
    # What the movements to compare with were read from: the default of topic and frame where a bag has several.
    reference: Known | None = None
    # Columns that are left aside, whatever else chooses them; one that a file does not have is no matter to it.
    exclude: Column | Sequence[Column] | None = None
    # Longest gap [s] that is filled, from the value before it to the value after it; 0 fills none.
    fill_gaps: float = FILL_GAPS
    # Whether each line of a text is a movement, see `kineme.io.arrays.rows`; `columns` then name the coordinates of a
    # sample.
    rows: bool = False
    every: int | None = None  # number of samples of a movement, where a recording holds one after the other
    measured_in: str | None = None  # unit of the coordinates of which the file says none, one of `kineme.units.UNITS`

    def __post_init__(self) -> None:
        check_choice("skip", self.skip, SKIP)
        check_number("fill_gaps", self.fill_gaps, least=0)
        if self.every is not None:
            check_count("every", self.every, MIN_SAMPLES)
        if self.measured_in is not None and unit_named(self.measured_in) is None:
            raise SpecificationError(
                f"expected measured_in to be a unit, such as m, mm, rad or deg, got {self.measured_in!r}"
            )
        if self.rows and any(choice is not None for choice in (self.every, self.time, self.movement, self.person)):
            raise SpecificationError(
                "expected rows without every, time, movement and person, since each line is a whole movement, got both"
            )
        if isinstance(self.units, Real) and not isinstance(self.units, bool):
            check_number("units", self.units, above=0)
        elif self.units is not None and not (isinstance(self.units, str) and is_unit_of(self.units, "time")):
            raise SpecificationError(
                f"expected units to be one of {', '.join(PER_SECOND)} or a number of seconds, got {self.units!r}"
            )

    @property
    def coordinates(self) -> tuple[Column, ...] | None:
        """The columns of the coordinates."""
        return _several(self.columns)

    @property
    def excluded(self) -> tuple[Column, ...]:
        """The columns that are left aside."""
        return _several(self.exclude) or ()

    @property
    def by_number(self) -> bool:
        """True if the columns of the coordinates are chosen by their numbers."""
        return bool(self.coordinates) and all(str(column).isdecimal() for column in self.coordinates or ())

    @property
    def keys(self) -> tuple[Column, ...] | None:
        """The columns that tell movements apart."""
        return _several(self.movement)

    @property
    def topics(self) -> tuple[str, ...]:
        """The topics of a bag."""
        return _texts(self.topic)

    @property
    def frames(self) -> tuple[str, ...]:
        """The pairs of frames of a bag."""
        return _texts(self.frame)


def _several(columns: Column | Sequence[Column] | None) -> tuple[Column, ...] | None:
    """One column or many, as a tuple."""
    if columns is None:
        return None
    return (columns,) if isinstance(columns, (str, int)) else tuple(columns) or None  # an empty one names none


def _texts(names: str | Sequence[str] | None) -> tuple[str, ...]:
    return (names,) if isinstance(names, str) else tuple(names or ())


class Detected(NamedTuple):
    """The interpretation of a file: which columns have a role, and what is known of their values."""

    format: str  # such as "CSV"
    layout: str  # "wide", one movement; "long", told apart by columns; or the layout of arrays
    columns: tuple[str, ...]  # the coordinates; of several columns of one name the later ones are numbered: x, x.1
    time: str | None  # the column of the time stamps
    units: str | float  # of the time stamps
    units_from: str  # source of that unit: "given", "head", "dates"; or a guess of `time_stamps.unit_by_size`
    movement: tuple[str, ...] = ()  # the columns that tell movements apart
    label: tuple[str, ...] = ()  # the column that names the action
    ignored: tuple[str, ...] = ()
    measured_in: tuple[str, ...] = ()  # unit of each coordinate, empty where the file does not say it; or nothing
    person: tuple[str, ...] = ()  # the column that names who showed a movement
    named: bool = True  # False if the file does not name the coordinates
    sentinels: tuple[str, ...] = ()  # numbers that stand for no value, each with its column: "-9999 in x"
    in_blocks: tuple[str, ...] = ()  # columns that may tell movements apart by their values, though none was told so
    converted: tuple[str, ...] = ()  # columns that are in another unit than in the file: "y_m as y [mm]"
    notes: tuple[str, ...] = ()  # sentences on what may be wrong, though it was read


class Repair(NamedTuple):
    """The repair of values that one movement lacks."""

    filled: int = 0  # number of samples of which values are interpolated
    longest: float = 0.0  # longest gap that was filled, from the sample before to the sample after [s]
    cropped: float = 0.0  # time at both ends that was left out, since columns have no values there [s]


def no_lines(row: int) -> None:
    """The line of every row of a file that has no lines: None."""


@dataclass(frozen=True, eq=False)
class Block:
    """Movements of one file, one after the other, not yet checked."""

    positions: Array  # shape (total, d)
    # shape (total,); in seconds. None: evenly sampled over one second, as `Demonstrations.from_arrays` takes it.
    times: Array | None
    offsets: NDArray[np.intp]  # shape (n + 1,)
    labels: list[str | None]
    places: list[str]  # which movement of the file; empty if there is but one
    rows: NDArray[np.intp] | None = None  # shape (total,); row of the file that each sample comes from, if not in order
    line_of: Callable[[int], int | None] = no_lines  # row of the file -> its line, counted from 1, or None
    faults: dict[int, str] | None = None  # row of the file -> what is wrong there
    people: list[str | None] | None = None  # who showed each movement
    repairs: list[Repair] | None = None  # what was done about missing values

    @property
    def stamps(self) -> Array:
        """The time stamps; if the file has none, even ones over one second."""
        if self.times is not None:
            return self.times
        lengths = np.diff(self.offsets)
        within = np.arange(len(self.positions)) - np.repeat(self.offsets[:-1], lengths)
        return within / np.repeat(np.maximum(lengths - 1, 1), lengths)

    def row(self, k: int) -> int:
        """Row of the file that sample k comes from."""
        return k if self.rows is None else int(self.rows[k])


class Parsed(NamedTuple):
    """The content of one file or data frame."""

    detected: Detected
    block: Block
    # Why parts of it could not be read: topics, episodes. Each becomes a problem of the file.
    left_out: tuple[str, ...] = ()
    # Whether its label is no more than the name of its one array or group: a folder says better what it is.
    named_alone: bool = False
    # Whether the columns that are excluded by their numbers in the file are left out already.
    without_excluded: bool = False


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
