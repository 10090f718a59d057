"""The caller's choices about the columns of a recording; what is not given is detected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Real

from kineme.errors import SpecificationError
from kineme.movements.tables.time_stamps import PER_SECOND
from kineme.units import is_unit_of
from kineme.validation import MIN_SAMPLES, check_choice, check_count, check_number

Column = str | int  # head, or number counted from 0

SKIP = ("movement", "sample")

#: Longest gap [s] that is filled unless the caller says otherwise.
FILL_GAPS = 0.2

#: What the layout of a file ends with if nobody asked for its topic or frame, see `Layout.known`.
AS_KNOWN = ", as the movements to compare with"


@dataclass(frozen=True)
class Known:
    """What movements that were read before were read from, for recordings that are compared with them.

    Attributes
    ----------
    choices : tuple of (tuple of str, tuple of str)
        Topics and frames of bags, each choice as it was asked for.
    columns : tuple of str
        Their columns; empty if these are not known.
    n_orientations : int
        How many quaternions are among the columns.
    moving : tuple of str
        The columns without those that are discrete.
    """

    choices: tuple[tuple[tuple[str, ...], tuple[str, ...]], ...] = ()
    columns: tuple[str, ...] = ()
    n_orientations: int = 0
    moving: tuple[str, ...] = ()


@dataclass(frozen=True)
class Layout:
    """The roles of the columns. None: detect them from heads and numbers, and report them.

    Attributes
    ----------
    time : str or int, optional
        Column of the time stamps.
    columns : str or int or sequence of them, optional
        Columns of the coordinates, in that order.
    movement : str or int or sequence of them, optional
        Columns that tell the movements of a long table apart.
    label : str or int, optional
        Column that names the action.
    units : str or float, optional
        Unit of the time stamps, of time in `kineme.units.UNITS`, or the number of seconds in one unit. As a number, it
        is the step between samples of a file that has no time stamps at all.
    skip : {"movement", "sample"}
        What is dropped for a missing or repeated sample: its whole movement, or the sample alone.
    kinds : mapping, optional
        Heads of columns, separated by commas, -> "position", "angle" or "discrete"; of four -> "wxyz" or "xyzw", the
        order of a quaternion. What several heads begin with, before a dot, stands for all of them.
    topic : str or sequence of str, optional
        Topics of a bag; of several, the others are interpolated to the stamps of the first.
    frame : str or sequence of str, optional
        Pairs of frames of a bag, as ``"parent:child"``: the pose of the child in the parent.
    person : str or int, optional
        Column that names who showed a movement; another movement begins where it changes.

    known : Known, optional
        What the movements to compare with were read from: the default of topic and frame where a bag has several.
    exclude : str or int or sequence of them, optional
        Columns that are left aside, whatever else chooses them; one that a file does not have is no matter to it.
    fill_gaps : float
        Longest gap [s] that is filled, from the value before it to the value after it; 0 fills none.
    rows : bool
        Whether each line of a text is a movement, see `kineme.io.arrays.rows`; `columns` then name the coordinates
        of a sample.
    every : int, optional
        Number of samples of a movement, where a recording holds one after the other.

    Raises
    ------
    SpecificationError
        An unknown unit or choice, a gap that is no number of seconds from 0, blocks of fewer than `MIN_SAMPLES`
        samples, or columns that rows do not have.
    """

    time: Column | None = None
    columns: Column | Sequence[Column] | None = None
    movement: Column | Sequence[Column] | None = None
    label: Column | None = None
    units: str | float | None = None
    skip: str = "movement"
    kinds: Mapping[str, str] | None = None
    topic: str | Sequence[str] | None = None
    frame: str | Sequence[str] | None = None
    person: Column | None = None
    known: Known | None = None
    exclude: Column | Sequence[Column] | None = None
    fill_gaps: float = FILL_GAPS
    rows: bool = False
    every: int | None = None

    def __post_init__(self) -> None:
        check_choice("skip", self.skip, SKIP)
        check_number("fill_gaps", self.fill_gaps, least=0)
        if self.every is not None:
            check_count("every", self.every, MIN_SAMPLES)
        if self.rows and any(one is not None for one in (self.every, self.time, self.movement, self.person)):
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
        """Whether the columns of the coordinates are chosen by their numbers."""
        return bool(self.coordinates) and all(str(one).isdecimal() for one in self.coordinates or ())

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
