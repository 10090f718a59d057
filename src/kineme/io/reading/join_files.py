"""Files on one clock as one recording: the sensors of a phone, each in a file of its own, side by side."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from kineme.errors import DataError
from kineme.io.reading.column_order import sensors_of
from kineme.io.reading.formats import Entry, as_text, name_of
from kineme.io.reading.read_file import NO_MOVEMENTS, FileRead, select_columns, take_columns
from kineme.io.records import Problem
from kineme.io.ros.streams import values_at
from kineme.movements.channels.channel import recorded_names
from kineme.movements.channels.column_match import Columns, in_one_unit, numbers_by_name
from kineme.movements.channels.coordinates import columns_of, in_order
from kineme.movements.channels.detect import Given, find_channels
from kineme.movements.tables.columns import column_numbers, excluded_numbers
from kineme.movements.tables.layout import Block, Layout, Parsed, Repair
from kineme.reporting.text import counted, first_names
from kineme.validation import MIN_SAMPLES, Array

#: A file, and where it was found.
Placed = tuple[FileRead, Entry]

_SHARED = 0.5  # of the time of a recording that a file must cover
_SINCE_1970 = 1e8  # s: stamps that count from a time which all devices share
_ALIKE = 0.05  # of a duration by which files of one recording may begin or end apart, where no such time tells
_NAMED = 4  # files that a note names


def join_files(files: Sequence[Placed], layout: Layout) -> list[Placed]:
    """Return one recording of all files of a folder that hold one movement each on one clock; other files as they are.

    The samples are those of the file that has most in a second, while all of them last; others are interpolated.
    Columns are named by their file, ``Gyroscope.x``, also in the layout. A file that covers less than half of the
    recording is a problem; one without any of the columns that are chosen is passed over.
    """
    result: list[Placed] = []
    for members in _folders(files).values():
        timed = [read for read, _ in members if _is_timed(read)]
        if len(_together(timed)) < 2:
            result += members
            continue
        # The files that have columns which are asked for, or those of the movements to compare with; all if none has.
        heads = [_heads(read) for read in timed]
        columns = layout.reference.columns if layout.reference is not None else ()
        of_all = [name for names in heads for name in names]
        wanted = layout.coordinates or (columns if None not in numbers_by_name(of_all, columns) else ())
        having = [
            read
            for read, names in zip(timed, heads, strict=True)
            if (not wanted or excluded_numbers(names, wanted))
            and len(excluded_numbers(names, layout.excluded)) < len(names)
        ]
        chosen = having or list(timed)
        together = _together(chosen) or [chosen[0].path]
        joined = [member for member in members if member[0].path in together]
        recording, place = _joined(joined, together, layout.kinds or {})
        aside = tuple(name for read in timed if read not in chosen for name in _heads(read))
        recording = recording._replace(
            detected=recording.detected._replace(ignored=(*recording.detected.ignored, *aside))
        )
        result.append((_selected(recording, layout), place))
        for read, entry in members:
            if not _is_timed(read):
                result.append((read, entry))
            elif read.path not in together and read in chosen:
                begin, end = _span(read)
                reason = (
                    f"expected samples at the time of {together[0]}, got some from {begin:.12g} to {end:.12g} s; move "
                    "it elsewhere if it is another recording"
                )
                result.append((read.without_movements(reason), entry))
    return result


def _heads(read: FileRead) -> list[str]:
    return [f"{Path(read.path).stem}.{name}" for name in read.detected.columns]


def _selected(read: FileRead, layout: Layout) -> FileRead:
    def in_order(layout: Layout) -> Parsed:
        if layout.coordinates is None:
            return parsed
        return take_columns(parsed, column_numbers(parsed.detected.columns, layout.coordinates))

    if not read.block.labels:
        return read
    parsed = Parsed(read.detected, read.block)
    try:
        selected = select_columns(in_order, layout)
    except DataError as error:
        return read._replace(block=NO_MOVEMENTS, problems=[Problem(read.path, None, str(error)), *read.problems])
    return read._replace(detected=selected.detected, block=selected.block)


def notes_on_clocks(files: Sequence[Placed]) -> tuple[str, ...]:
    """Say that files of one folder lie on one clock, and how they are read as one recording."""
    folders = []
    for members in _folders(files).values():
        timed = [read for read, _ in members if _is_timed(read)]
        together = _together(timed)
        if len(together) > 1 and _are_sensors([read for read in timed if read.path in together]):
            folders.append(together)
    if not folders:
        return ()
    others = f", and so do files in {counted(len(folders) - 1, 'other folder')}" if len(folders) > 1 else ""
    names = first_names(sorted(folders[0]), _NAMED)
    return (f"{names} lie on one clock{others}; --join-files, in Python join_files=True, makes one recording of them",)


def _folders(files: Sequence[Placed]) -> Mapping[Path, list[Placed]]:
    folders: dict[Path, list[Placed]] = {}
    for read, entry in files:
        folders.setdefault(entry.path.parent, []).append((read, entry))
    return folders


def _is_timed(read: FileRead) -> bool:
    return read.block.times is not None and len(read.block.labels) == 1


def _times(read: FileRead) -> Array:
    assert read.block.times is not None
    return read.block.times


def _span(read: FileRead) -> tuple[float, float]:
    times = _times(read)
    return float(times[0]), float(times[-1])


def _together(files: Sequence[FileRead]) -> list[str]:
    """Return the files that share at least half of the time of the densest one, which is the first."""
    if len(files) < 2:
        return []
    durations = [end - begin for begin, end in map(_span, files)]
    shortest = _SHARED * float(np.median(durations))
    long = [k for k, duration in enumerate(durations) if duration >= shortest]
    densest = max(long, key=lambda k: len(_times(files[k])) / durations[k])
    begin, end = _span(files[densest])
    shared = [
        k
        for k, read in enumerate(files)
        if k != densest and min(end, _span(read)[1]) - max(begin, _span(read)[0]) >= _SHARED * (end - begin)
    ]
    return [files[k].path for k in (densest, *shared)]


def _are_sensors(files: Sequence[FileRead]) -> bool:
    """Tell whether files that overlap are parts of one recording, and not repetitions that all begin at 0."""
    spans = np.array([_span(read) for read in files])
    if spans[:, 0].min() > _SINCE_1970:
        return True
    if not spans[:, 0].any() or (np.ptp(spans, axis=0) > _ALIKE * np.ptp(spans)).any():
        return False
    of_files = {(frozenset(Columns(read.detected.columns, ()).names), sensors_of(read.path)) for read in files}
    return len(of_files) == len(files)


def _joined(members: Sequence[Placed], together: Sequence[str], given: Given) -> Placed:
    """Return the recording of files whose times overlap, the densest one named first in `together`."""
    entry = members[0][1]
    folder = entry.path.parent
    of_root = entry.relative.parent == Path()
    name = as_text(name_of(folder) if of_root else Path(entry.name).parent)
    place = Entry(folder, name_of(folder) if of_root else entry.relative.parent, name)
    reads = [read for read, _ in members]
    reference = next(read for read in reads if read.path == together[0])
    spans = [_span(read) for read in reads]
    begin, end = max(first for first, _ in spans), min(last for _, last in spans)
    times = _times(reference)
    at = times[(times >= begin) & (times <= end)]
    problems = [problem for read in reads for problem in read.problems]
    lines = "".join(f"{read.sha256}  {Path(read.path).name}\n" for read in reads)
    common = FileRead(
        name, problems, sha256=hashlib.sha256(lines.encode()).hexdigest(), size=sum(read.size for read in reads),
        mtime=max(read.mtime for read in reads),
    )  # fmt: skip
    if len(at) < MIN_SAMPLES:
        reason = f"expected files that last together, got {counted(len(at), 'sample')} at the time of all"
        return common.without_movements(reason), place
    if len(at) < len(times):
        n_lost, of = len(times) - len(at), Path(reference.path).name
        reason = f"{counted(n_lost, 'sample')} of {of} before others begin or after they end"
        problems.append(Problem(name, None, reason, samples=n_lost))
    parts = [_part(read, at, given) for read in reads]
    heads, units, ignored = (tuple(text for part in parts for text in part[k]) for k in (0, 1, 2))
    how = reference.detected._replace(
        format=" and ".join(dict.fromkeys(read.detected.format for read in reads)),
        layout=f"{len(reads)} files on one clock", columns=heads, movement=(), label=(), ignored=ignored, person=(),
        measured_in=units if any(units) else (), named=True, sentinels=(),
        converted=tuple(text for read in reads for text in read.detected.converted),
    )  # fmt: skip
    repairs = [repair for read in reads for repair in read.block.repairs or [Repair()]]
    repair = Repair(
        sum(each.filled for each in repairs), *(max(column) for column in [*zip(*repairs, strict=True)][1:])
    )
    labels = {read.block.labels[0] for read in reads} - {as_text(entry.relative.parent.name), None}
    label = labels.pop() if len(labels) == 1 else as_text(place.relative.parent.name) or None
    block = Block(np.hstack([part[3] for part in parts]), at, np.array([0, len(at)]), [label], [""], repairs=[repair])
    how, block = in_one_unit(how, block)
    return common._replace(detected=how, block=block), place


def _part(read: FileRead, at: Array, given: Given) -> tuple[list[str], list[str], list[str], Array]:
    """Return heads, units, columns left aside, and values of a file at other times."""
    block, detected, stem = read.block, read.detected, Path(read.path).stem
    own = {}  # the kinds that are given for columns of this file, by its own heads
    for key, kind in given.items():
        heads = [name.strip() for name in key.split(",")]
        plain = [head.removeprefix(f"{stem}.") for head in heads]
        if all(head.startswith(f"{stem}.") for head in heads) and {*plain} <= {*detected.columns}:
            own[",".join(plain)] = kind
    channels = find_channels(detected.columns, block.positions, block.offsets, own, detected.measured_in, True)
    columns = in_order(block.positions, detected.columns, channels)
    units = dict(zip(detected.columns, detected.measured_in or [""] * len(detected.columns), strict=True))
    names = recorded_names(channels)
    times = _times(read)
    values = values_at(at, times, columns, names, channels)
    for channel, where in zip(channels, columns_of(channels), strict=True):
        if channel.kind == "orientation":  # what is no rotation stays none
            values[:, where] *= np.interp(at, times, np.linalg.norm(columns[:, where], axis=1))[:, None]
    return (
        [f"{stem}.{name}" for name in names],
        [units[name] for name in names],
        [f"{stem}.{name}" for name in detected.ignored],
        values,
    )
