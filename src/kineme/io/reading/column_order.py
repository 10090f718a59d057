"""Files with the same columns in other orders and units, as w, x, y, z beside x, y, z, w, as one set of columns."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import PurePosixPath
from typing import NamedTuple

from kineme.errors import TrajectoryError
from kineme.io.reading.read_file import FileRead
from kineme.io.records import Problem, in_shell
from kineme.movements.channels.column_match import Columns, columns_like
from kineme.movements.channels.detect import unit_of
from kineme.movements.tables.columns import beside_positions
from kineme.movements.tables.parsed import Detected, listed
from kineme.movements.tables.time_stamps import words_of
from kineme.reporting.text import first_names
from kineme.units import unit_named

#: Words in names of files that say which sensor of a device wrote x, y and z.
_SENSORS = frozenset(
    {
        "accelerometer", "acceleration", "gyroscope", "gyro", "magnetometer", "gravity", "barometer", "battery",
        "uncalibrated", "linear", "total",
    }
)  # fmt: skip

_NAMED = 6  # columns that a note names


class ColumnSet(NamedTuple):
    """The files with one set of columns, in one order and unit; those whose columns have no names; problems."""

    same: list[FileRead]
    nameless: list[FileRead]
    problems: list[Problem]


def in_one_set(files: Sequence[FileRead], by_number: bool = False) -> ColumnSet:
    """Files with the columns of most, in the order and in the units of these.

    Parameters
    ----------
    files : sequence of FileRead
        Of equally many columns.
    by_number : bool, default False
        The caller chose the columns by their numbers: names do not matter.
    """
    columns = [_columns(one) for one in files]
    keys = [(frozenset(known.names), sensors_of(one.path)) for one, known in zip(files, columns, strict=True)]
    named = [key for key, one, known in zip(keys, files, columns, strict=True) if not _is_nameless(one, known)]
    most = Counter(named or keys).most_common(1)[0][0]
    exact = Counter(known for key, known in zip(keys, columns, strict=True) if key == most)
    units = Counter(frozenset(zip(known.names, known.units, strict=True)) for known in exact.elements())
    usual = units.most_common(1)[0][0]
    alike = [known for known in exact if frozenset(zip(known.names, known.units, strict=True)) == usual]
    ours = max(alike, key=exact.__getitem__)  # of two orders that are equally frequent, the one met first
    result = ColumnSet([], [], [])
    for one, key, known in zip(files, keys, columns, strict=True):
        if key[0] != most[0] and (by_number or _is_nameless(one, known)):
            result.nameless.append(one)
        elif key != most and not by_number:
            result.problems.append(Problem(one.path, None, _otherness(one.path, known, ours, most)))
        else:
            try:
                result.same.append(_as(one, known, ours))
            except TrajectoryError as error:
                result.problems.append(Problem(one.path, None, str(error)))
    return result


def dimensions_unlike(files: Sequence[FileRead], most: Sequence[FileRead]) -> list[Problem]:
    """Say which columns files lack, or have besides, that have other numbers of columns than most."""
    named = Counter(known for known in map(_columns, most) if not known.are_nameless)
    ours, n_dims = (named or Counter(map(_columns, most))).most_common(1)[0][0], _width(most[0])
    problems = []
    for one in files:
        known = _columns(one)
        unlike = "" if _is_nameless(one, known) or not named else f": {_differences(known, ours)}"
        problems.append(Problem(one.path, None, f"{_width(one)} dimensions where most have {n_dims}{unlike}"))
    return problems


def notes_on_order(detected: Iterable[Detected], ours: Columns) -> list[str]:
    """A sentence if files have the columns in another order, and one if they have them in other units."""
    several = [known for known in map(_columns_of, detected) if {*known.names} == {*ours.names}]
    notes = []
    if others := [known for known in several if known.names != ours.names]:
        moved = [[a, b] for a, b in zip(others[0].heads, ours.heads, strict=True) if a != b]
        theirs, here = (", ".join(names) for names in zip(*moved, strict=True))
        notes.append(f"some files have the columns {theirs} in this order: they are read as {here}, that of most files")
    wanted = dict(zip(ours.names, ours.units, strict=True))
    pairs = {(a, wanted[name]) for known in several for name, a in zip(known.names, known.units, strict=True)}
    if other := sorted((a, b) for a, b in pairs if a and b and unit_named(a) != unit_named(b)):
        notes.append(f"units are converted: {', '.join(f'{a} to {b}' for a, b in other)}")
    return notes


def notes_on_aside(detected: Iterable[Detected]) -> list[str]:
    """A sentence if columns are left aside since they are no coordinates beside the positions of their names."""
    several = {how.columns + how.ignored: {*how.ignored} for how in detected}
    aside = [head for heads, ignored in several.items() for head in heads if head in beside_positions(heads) & ignored]
    named = [*dict.fromkeys(aside)]
    if not named:
        return []
    return [
        f"left aside {first_names(named, _NAMED)}, which are no positions but of positions that are read; say "
        "--columns with all that count to read them too"
    ]


def _as(one: FileRead, known: Columns, ours: Columns) -> FileRead:
    """A file with the heads, the order and the units of others."""
    if known == ours or one.detected is None or one.block is None:
        return one
    positions = columns_like(one.block.positions, known, ours)
    detected = one.detected._replace(columns=ours.heads, measured_in=tuple(unit or "" for unit in ours.units))
    return one._replace(detected=detected, block=replace(one.block, positions=positions))


def _otherness(path: str, known: Columns, ours: Columns, most: tuple[frozenset[str], frozenset[str]]) -> str:
    """What keeps a file from having the columns of most."""
    if {*known.names} != most[0]:
        return _differences(known, ours)
    here, there = (" ".join(sorted(sensors)) or "no sensor" for sensors in (sensors_of(path), most[1]))
    return f"the file of another sensor by its name, {here} where most files are of {there}; read them apart"


def _differences(known: Columns, ours: Columns) -> str:
    """The columns of a file that most have not, and the other way round; and the options that read all files."""
    here, there = (
        [head for head, name in zip(one.heads, one.names, strict=True) if name not in other.names]
        for one, other in ((known, ours), (ours, known))
    )
    said = f"the columns {listed(here)} where most files have {listed(there)}"
    if not here:
        said = f"it lacks {listed(there)}"
    elif not there:
        said = f"it has {listed(here)} besides"
    if {*known.names}.isdisjoint(ours.names):
        return (
            f"{said}; choose columns of the same names with columns=, or by their numbers to take them in their order, "
            "in the shell --columns"
        )
    shared = [head for head, name in zip(ours.heads, ours.names, strict=True) if name in known.names]
    aside = dict.fromkeys(_stem(head, shared) for head in [*there, *here])
    return (
        f"{said}; say --exclude {in_shell([*aside])} to read all without, or --columns to choose others, in Python "
        "exclude= or columns="
    )


def _stem(head: str, others: Sequence[str]) -> str:
    """What a head begins with before a dot, where no other one begins so: M30 of M30.x."""
    stem, dot, _ = head.rpartition(".")
    return head if not dot or any(other.startswith(f"{stem}.") for other in others) else stem


def _width(one: FileRead) -> int:
    return 0 if one.block is None else one.block.positions.shape[1]


def sensors_of(path: str) -> frozenset[str]:
    """Words in the name of a file that say which sensor of a device wrote it."""
    return _SENSORS.intersection(words_of(PurePosixPath(path).stem))


def _is_nameless(one: FileRead, known: Columns) -> bool:
    return known.are_nameless or (one.detected is not None and not one.detected.named)


def _columns(one: FileRead) -> Columns:
    return _columns_of(one.detected) if one.detected else Columns((), ())


def _columns_of(how: Detected) -> Columns:
    measured_in = how.measured_in or [""] * len(how.columns)
    return Columns(how.columns, tuple(a or unit_of(head) for a, head in zip(measured_in, how.columns, strict=True)))
