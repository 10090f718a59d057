"""Files with the same columns in other orders and units, as w, x, y, z beside x, y, z, w, as one set of columns."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import PurePosixPath

import numpy as np

from kineme.errors import TrajectoryError
from kineme.io.reading.read_file import FileRead
from kineme.io.records import Problem, in_shell
from kineme.movements.channels.column_match import Columns, columns_detected, columns_like
from kineme.movements.channels.coordinates import columns_of, period_by_unit
from kineme.movements.channels.detect import SENSORS, rotation_vectors
from kineme.movements.tables.columns import beside_positions
from kineme.movements.tables.layout import Detected, listed
from kineme.movements.tables.time_stamps import words_of
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.reporting.text import first_names
from kineme.units import unit_named

#: Words in names of files that say which sensor of a device wrote x, y and z.
_SENSORS = SENSORS | {"acceleration", "battery", "uncalibrated", "linear", "total"}

_NAMED = 6  # columns that a note names


def in_one_set(
    files: Sequence[FileRead], by_number: bool = False
) -> tuple[list[FileRead], list[FileRead], list[Problem]]:
    """Return files with the columns of most in their order and units, others without names of columns, and problems."""
    columns = [columns_detected(file.detected) for file in files]
    keys = [(frozenset(own.names), sensors_of(file.path)) for file, own in zip(files, columns, strict=True)]
    named = [key for key, file, own in zip(keys, files, columns, strict=True) if not _is_nameless(file, own)]
    most = Counter(named or keys).most_common(1)[0][0]
    exact = Counter(own for key, own in zip(keys, columns, strict=True) if key == most)
    units = Counter(frozenset(zip(own.names, own.units, strict=True)) for own in exact.elements())
    usual = units.most_common(1)[0][0]
    alike = [own for own in exact if frozenset(zip(own.names, own.units, strict=True)) == usual]
    ours = max(alike, key=exact.__getitem__)  # of two orders that are equally frequent, the one met first
    same, nameless, problems = list[FileRead](), list[FileRead](), list[Problem]()
    for file, key, own in zip(files, keys, columns, strict=True):
        if key[0] != most[0] and (by_number or _is_nameless(file, own)):
            nameless.append(file)
        elif key != most and not by_number:
            here, there = (" ".join(sorted(sensors)) or "no sensor" for sensors in (key[1], most[1]))
            unlike = (
                _differences(own, ours)
                if key[0] != most[0]
                else f"the file of another sensor by its name, {here} where most files are of {there}; read them apart"
            )
            problems.append(Problem(file.path, None, unlike))
        elif own == ours:
            same.append(file)
        else:
            measured_in = tuple(unit or "" for unit in ours.units)
            detected = file.detected._replace(columns=ours.heads, measured_in=measured_in)
            try:
                positions = columns_like(file.block.positions, own, ours)
                same.append(file._replace(detected=detected, block=replace(file.block, positions=positions)))
            except TrajectoryError as error:
                problems.append(Problem(file.path, None, str(error)))
    return same, nameless, problems


def dimensions_unlike(files: Sequence[FileRead], most: Sequence[FileRead]) -> list[Problem]:
    """Say which columns files lack, or have besides, that have other numbers of columns than most."""
    columns = [columns_detected(file.detected) for file in most]
    named = Counter(own for own in columns if not own.are_nameless)
    ours, n_dims = (named or Counter(columns)).most_common(1)[0][0], most[0].n_dims
    problems = []
    for file in files:
        own = columns_detected(file.detected)
        unlike = "" if _is_nameless(file, own) or not named else f": {_differences(own, ours)}"
        problems.append(Problem(file.path, None, f"{file.n_dims} dimensions where most have {n_dims}{unlike}"))
    return problems


def notes_on_order(detected: Iterable[Detected], ours: Columns) -> list[str]:
    """Return a sentence if files have the columns in another order, and one if they have them in other units."""
    several = [own for own in map(columns_detected, detected) if {*own.names} == {*ours.names}]
    notes = []
    if others := [own for own in several if own.names != ours.names]:
        moved = [[a, b] for a, b in zip(others[0].heads, ours.heads, strict=True) if a != b]
        theirs, here = (", ".join(names) for names in zip(*moved, strict=True))
        notes.append(f"some files have the columns {theirs} in this order: they are read as {here}, that of most files")
    wanted = dict(zip(ours.names, ours.units, strict=True))
    pairs = {(a, wanted[name]) for own in several for name, a in zip(own.names, own.units, strict=True)}
    if other := sorted((a, b) for a, b in pairs if a and b and unit_named(a) != unit_named(b)):
        notes.append(f"units are converted: {', '.join(f'{a} to {b}' for a, b in other)}")
    return notes


def notes_on_aside(detected: Iterable[Detected]) -> list[str]:
    """Return a sentence if columns are left aside since they are no coordinates beside the positions of their names."""
    several = {how.columns + how.ignored: {*how.ignored} for how in detected}
    aside = [head for heads, ignored in several.items() for head in heads if head in beside_positions(heads) & ignored]
    named = [*dict.fromkeys(aside)]
    if not named:
        return []
    return [
        f"left aside {first_names(named, _NAMED)}, which are no positions but of positions that are read; say "
        "--columns with all that count to read them too"
    ]


def notes_on_rotation_vectors(demos: Demonstrations) -> list[str]:
    """Say which columns are a rotation vector, by their names, and by norms that come to half a turn."""
    channels, notes = demos.channels or (), list[str]()
    for three in rotation_vectors([channel.name for channel in channels]):
        if any(channels[k].kind != "position" for k in three):
            continue
        r = demos.recorded[:, [columns_of(channels)[k].start for k in three]]
        turn = period_by_unit(channels[three[0]].unit or "rad") or 0.0
        if turn / 4 < np.linalg.norm(r, axis=1).max() <= turn:  # forces are larger, small rotations do not jump
            notes.append(
                f"{', '.join(channels[k].name for k in three)} look like a rotation vector: near half a turn, as of "
                "a tool that points down, it jumps, and is learned so; write columns qx, qy, qz, qw instead, in Python "
                f"scipy.spatial.transform.Rotation.from_rotvec(r{', degrees=True' * (turn == 360)}).as_quat()"
            )
    return notes


def _differences(own: Columns, ours: Columns) -> str:
    """Return the columns of a file that most have not, and the other way round; and the options that read all files."""
    here, there = (
        [head for head, name in zip(several.heads, several.names, strict=True) if name not in other.names]
        for several, other in ((own, ours), (ours, own))
    )
    said = f"the columns {listed(here)} where most files have {listed(there)}"
    if not here:
        said = f"it lacks {listed(there)}"
    elif not there:
        said = f"it has {listed(here)} besides"
    if {*own.names}.isdisjoint(ours.names):
        return (
            f"{said}; choose columns of the same names with columns=, or by their numbers to take them in their order, "
            "in the shell --columns"
        )
    shared = [head for head, name in zip(ours.heads, ours.names, strict=True) if name in own.names]
    # The beginning of a head before a dot, where no other one begins so: M30 of M30.x.
    stems = {head: head.rpartition(".")[0] for head in [*there, *here]}
    aside = dict.fromkeys(
        head if not stem or any(other.startswith(f"{stem}.") for other in shared) else stem
        for head, stem in stems.items()
    )
    return (
        f"{said}; say --exclude {in_shell([*aside])} to read all without, or --columns to choose others, in Python "
        "exclude= or columns="
    )


def sensors_of(path: str) -> frozenset[str]:
    """Return words in the name of a file that say which sensor of a device wrote it."""
    return _SENSORS.intersection(words_of(PurePosixPath(path).stem))


def _is_nameless(file: FileRead, own: Columns) -> bool:
    return own.are_nameless or not file.detected.named
