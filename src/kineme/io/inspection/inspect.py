"""Summary of a set of recordings in numbers, as text and as plain data, and what files hold besides."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.reading.column_order import notes_on_aside, notes_on_order
from kineme.io.reading.formats import entries_of, format_at
from kineme.io.reading.merge_files import Recordings, notes_on_gaps, sampling_of
from kineme.io.records import Contents, Problem
from kineme.movements.channels.channel import Channel, Channels
from kineme.movements.channels.column_match import columns_recorded
from kineme.movements.channels.coordinates import columns_of, lever_of
from kineme.movements.channels.detect import point_names
from kineme.movements.tables.layout import Detected
from kineme.movements.tables.time_stamps import GUESSED
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.reporting.table import Table, to_text
from kineme.reporting.text import counted, first_names, printable
from kineme.units import split_head
from kineme.validation import Array

_FILE = "file"  # head of the names of files
_IDLE = ("nothing", "is fixed")  # how the last cell of a row begins that holds no movement

_SHOWN = 20  # lines of a list; the rest is counted
_COLUMNS, _CHANNELS, _FILES = 24, 12, 3  # names in a line
_COUNTED = 30  # steps, all of one size, that no hand and no robot makes

_MORE = 10.0  # times the extent of all others
_LARGER = 30.0  # times the extent of the smallest movement of a label: a degree and a radian are 57 apart
_LISTED = 6  # columns that the note on extents names
_END = re.compile(r"[\W\d_]*([\[(][^\[\]()]*[\])]\s*)?$")  # number and unit

_STAMP = 1e-6  # times since the start are equal if they differ by less than this share of the duration

_MANY, _NAMED = 7, 12  # columns from which on still ones are counted; channels that a note names


class Range(NamedTuple):
    """Least, median and greatest of several numbers."""

    least: float
    median: float
    greatest: float


class LabelSummary(NamedTuple):
    """Summary of the movements of one label, or of those without a label."""

    label: str | None
    movements: int
    samples: Range
    duration: Range  # [s]
    rate: Range  # [Hz]
    extent: Range  # of the longest side of the box around a movement
    jitter: float  # the median of movements, see `Sampling`
    gaps: int  # in all
    longest_gap: float  # [s]; 0 without any


class Inspection(NamedTuple):
    """The result of `inspect`."""

    movements: int
    files: int
    dimensions: int
    labels: tuple[LabelSummary, ...]  # in alphabetic order, those without a label last
    detected: tuple[tuple[Detected, int], ...]
    channels: Channels | None  # what the columns are, where all files have the same
    duplicates: tuple[tuple[str, ...], ...]  # names of movements that are the same, sample for sample
    problems: tuple[Problem, ...]
    notes: tuple[str, ...]  # hints that a person should check


def nothing_read(file: str, reason: str) -> Inspection:
    """Return the inspection of a file of which no movement is read."""
    return Inspection(0, 0, 0, (), (), None, (), (Problem(file, None, reason),), ())


class Measures(NamedTuple):
    """Numbers of n movements, of which a summary is made; each of shape (n,)."""

    labels: NDArray[np.object_]
    samples: NDArray[np.intp]
    durations: Array  # [s]
    rates: Array  # [Hz]
    jitters: Array  # see `Sampling`
    gaps: NDArray[np.intp]
    longest: Array  # gap [s]
    extents: Array  # of the longest side of the box around the movement


def measures_of(recordings: Recordings) -> Measures:
    """Measure each movement."""
    demos, extents = recordings.demonstrations, extents_of(recordings.demonstrations).max(axis=1)
    return Measures(recordings.labels, demos.lengths, demos.durations, *sampling_of(demos), extents)


def summaries(measures: Measures) -> tuple[LabelSummary, ...]:
    """Summarize movements by their labels, in alphabetic order, those without a label last."""
    order = labels_in_order(measures.labels.tolist())
    number = {label: k for k, label in enumerate(order)}
    codes = np.array([number[label] for label in measures.labels], dtype=np.intp)
    return tuple(_summary(label, np.flatnonzero(codes == k), measures) for k, label in enumerate(order))


def inspect(recordings: Recordings) -> Inspection:
    """Summarize recordings."""
    demos = recordings.demonstrations
    names = demos.names or ()
    duplicates = tuple(tuple(str(names[i]) for i in group) for group in duplicates_among(demos))
    labels = summaries(measures_of(recordings))
    return Inspection(
        len(demos),
        len({source.path for source in recordings.sources}),
        demos.n_dims,
        labels,
        recordings.detected,
        demos.channels,
        duplicates,
        recordings.problems,
        tuple(_notes(recordings, labels)),
    )


def labels_in_order(labels: Iterable[str | None]) -> list[str | None]:
    """Return each label once, in alphabetic order, None last."""
    distinct = set(labels)
    named = sorted(label for label in distinct if label is not None)
    return [*named, *([None] if None in distinct else [])]


def _summary(label: str | None, chosen: NDArray[np.intp], measures: Measures) -> LabelSummary:
    gaps, jitter = measures.gaps[chosen], float(np.median(measures.jitters[chosen]))
    several = [x[chosen] for x in (measures.samples, measures.durations, measures.rates, measures.extents)]
    samples, duration, rate, extent = (Range(float(x.min()), float(np.median(x)), float(x.max())) for x in several)
    longest = float(measures.longest[chosen][gaps > 0].max(initial=0.0))
    return LabelSummary(label, len(chosen), samples, duration, rate, extent, jitter, int(gaps.sum()), longest)


def _notes(recordings: Recordings, labels: tuple[LabelSummary, ...]) -> list[str]:
    notes, demos = [*recordings.notes], recordings.demonstrations
    guessed = sorted({str(how.units) for how, _ in recordings.detected if how.units_from in GUESSED})
    if len(guessed) > 1:
        notes.append(f"time counts in {' here, in '.join(guessed)} there, to judge by its size; give --units")
    if any(how.units_from.startswith("no times") for how, _ in recordings.detected):
        notes.append("some files have no times: each of their movements counts as one second; give --units STEP")
    heads = [head for how, _ in recordings.detected if how.format.startswith("LeRobot") for head in how.columns]
    if silent := [head for head in heads if split_head(head)[1] is None]:
        of = "joints" if len(silent) == len(heads) else first_names(silent, 3)
        notes.append(f"LeRobot does not declare the units of {of}: they are taken as they are stored")
    notes += notes_on_heads(recordings)
    single = [str(summary.label) for summary in labels if summary.label is not None and summary.movements == 1]
    if single:
        notes.append(f"only one movement labeled {', '.join(single[:5])}{' and others' if len(single) > 5 else ''}")
    unlabeled = sum(summary.movements for summary in labels if summary.label is None)
    if 0 < unlabeled < len(recordings):
        notes.append(f"{unlabeled} movements have no label: their files lie in no folder of their own")
    return notes + notes_on_samples(recordings) + _notes_on_channels(demos)


def notes_on_heads(recordings: Recordings) -> list[str]:
    """Say which columns are left aside, and which are read in another order or unit than their file has them."""
    several, ours = dict(recordings.detected), columns_recorded(recordings.demonstrations.channels or ())
    return notes_on_aside(several) + notes_on_order(several, ours)


def notes_on_samples(recordings: Recordings) -> list[str]:
    """Say what a person should know of the samples, beside the notes that they have, before they rely on them."""
    demos = recordings.demonstrations
    notes = notes_on_gaps(recordings) + notes_on_sizes(demos)
    return notes + _notes_on_points(demos) + _notes_on_extents(demos)


def _notes_on_channels(demos: Demonstrations) -> list[str]:
    """Return columns whose values do not fit their kind, and those that never change."""
    channels, x, notes = demos.channels or (), demos.recorded, list[str]()
    named = [*zip(channels, columns_of(channels), strict=True)]
    if len(columns_recorded(channels).heads) >= _MANY:
        still = (_sides(x, demos.offsets) == 0).all(axis=0)  # one value throughout every movement
        if quiet := [channel.name for channel, columns in named if still[columns].all()]:
            names = first_names(quiet, _NAMED)
            notes.append(f"{len(quiet)} of {len(channels)} channels never move: {names}; --exclude leaves them out")
    for channel, columns in named:
        values = x[:, columns.start]
        if channel.kind == "position" and values.min() < values.max() and ((values == 0) | (values == 1)).all():
            notes.append(f"{channel.name} is 0 or 1 throughout; if it is a switch, say --kind {channel.name}=discrete")
        steps = np.delete(np.diff(values), demos.offsets[1:-1] - 1)
        step = steps[0] if (steps == steps[0]).all() and (values == np.rint(values)).all() else 0
        if channel.kind == "position" and step and len(steps) >= _COUNTED and len(named) > 1:
            notes.append(f"{channel.name} counts in steps of {step:g}; if it is no coordinate, --exclude leaves it out")
    return notes


def duplicates_among(demonstrations: Demonstrations) -> list[list[int]]:
    """Return groups of indices of equal movements. Those of equal lengths, ends and sums are compared by sample."""
    x, offsets = demonstrations.positions, demonstrations.offsets
    key = np.column_stack(
        (demonstrations.lengths, x[offsets[:-1]], x[offsets[1:] - 1], np.add.reduceat(x, offsets[:-1], axis=0))
    )
    _, group, size = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    group = group.ravel()
    candidates = np.flatnonzero(size[group] > 1)
    candidates = candidates[np.argsort(group[candidates], kind="stable")]
    result: list[list[int]] = []
    for alike in np.split(candidates, np.flatnonzero(np.diff(group[candidates])) + 1):
        groups: list[list[int]] = []
        for i in alike.tolist():
            movement = demonstrations[i]
            for members in groups:
                other = demonstrations[members[0]]
                apart = np.abs((other.times - other.times[0]) - (movement.times - movement.times[0])).max()
                if np.array_equal(other.recorded, movement.recorded) and apart <= _STAMP * other.duration:
                    members.append(i)
                    break
            else:
                groups.append([i])
        result += [members for members in groups if len(members) > 1]
    return sorted(result)


def extents_of(demos: Demonstrations) -> Array:
    """Return the sides (n, d) of the box around each movement."""
    return _sides(demos.positions, demos.offsets)


def _sides(x: Array, offsets: NDArray[np.intp]) -> Array:
    return np.asarray(np.maximum.reduceat(x, offsets[:-1], axis=0) - np.minimum.reduceat(x, offsets[:-1], axis=0))


def _notes_on_points(demos: Demonstrations) -> list[str]:
    """Say which points the columns are, by their names, and how they are compared."""
    names = point_names(demos.channels)
    return [f"{len(names)} points that turn together: {first_names(names, _CHANNELS)}"] if names else []


def _notes_on_extents(demos: Demonstrations) -> list[str]:
    """Say that a group of columns reaches much further than all others, as a gripper in mm beside joints in radians."""
    greatest = extents_of(demos).max(axis=0, initial=0.0)
    groups: dict[str, dict[str, float]] = {}
    at = 0
    for channel in demos.channels or ():
        if channel.kind in ("position", "angle"):
            groups.setdefault(_group(channel), {})[channel.name] = float(greatest[at])
        at += len(channel.coordinates)
    if len(groups) < 2:
        return []
    *_, second, widest = sorted(groups.values(), key=lambda group: max(group.values()))
    here, there = max(widest.values()), max(second.values())
    if not there > 0 or here < _MORE * there:
        return []
    names = [*widest]
    spans, steps = ("spans", f", or say --kind {names[0]}=discrete") if len(names) == 1 else ("span", "")
    return [
        f"{first_names(names, _LISTED)} {spans} up to {here:.3g}, the other columns up to {there:.3g}, which hardly "
        f"count in what is learned: bring all to similar sizes, or choose some with --columns{steps}"
    ]


def notes_on_sizes(demos: Demonstrations) -> list[str]:
    """Say that movements of one label differ in size as millimeters and meters do, if no file says their unit."""
    extents = extents_of(demos).max(axis=1, initial=0.0)
    labels = np.full(len(demos), None) if demos.labels is None else demos.labels
    for label in dict.fromkeys(labels[extents > 0.0].tolist()):
        chosen = np.flatnonzero((labels == label) & (extents > 0.0))
        small, large = (int(chosen[k]) for k in (extents[chosen].argmin(), extents[chosen].argmax()))
        if extents[large] >= _LARGER * extents[small]:
            of_label = "" if label is None else f" of {label}"
            names = demos.names or [f"movement {k}" for k in range(len(demos))]
            return [
                f"movements{of_label} extend from {extents[small]:.3g}, {names[small]}, to {extents[large]:.3g}, "
                f"{names[large]}; if these are two units, as of mm and m or degrees and radians, say them in the heads"
            ]
    return []


def _group(channel: Channel) -> str:
    """Return a text that columns of one unit share: the unit is known, or their names are those of axes or joints."""
    if channel.unit or channel.kind == "angle":
        return channel.unit or "an angle"
    stem = _END.sub("", channel.name).lower()
    return "an axis" if stem.endswith(("x", "y", "z")) else stem


def as_data(inspection: Inspection) -> dict[str, Any]:
    """Return nested lists and dictionaries; units as the fields of `Inspection` and `LabelSummary` say."""
    return inspection._asdict() | {
        "labels": [summary_as_data(summary) for summary in inspection.labels],
        "detected": [{**how._asdict(), "files": n} for how, n in inspection.detected],
        "channels": [channel._asdict() for channel in inspection.channels or ()],
        "duplicates": [list(group) for group in inspection.duplicates],
        "problems": [
            {"file": problem.file, "line": problem.line, "reason": problem.reason} for problem in inspection.problems
        ],
        "notes": list(inspection.notes),
    }


def summary_as_data(summary: LabelSummary) -> dict[str, Any]:
    """Return the summary of a label as plain data."""
    return {name: value._asdict() if isinstance(value, Range) else value for name, value in summary._asdict().items()}


def labels_as_words(labels: Sequence[LabelSummary], title: str) -> str:
    """Write a table of labels."""
    heads = ("label", "movements", "samples", "duration [s]", "rate [Hz]", "jitter", "gaps", "extent")
    return to_text(Table(title, heads, [_row(summary) for summary in labels]))


def as_words(inspection: Inspection) -> str:
    """Write a table of labels, how files were read, duplicates, and what could not be read."""
    movements, dimensions = counted(inspection.movements, "movement"), counted(inspection.dimensions, "dimension")
    title = f"{movements} of {dimensions} in {counted(inspection.files, 'file')}"
    parts = [labels_as_words(inspection.labels, title)]
    lists = {
        "read as": [f"{_understood(how)} ({counted(n, 'file')})" for how, n in inspection.detected],
        "kinds": _kinds(inspection.channels or ()),
        "the same movement more than once": [" = ".join(group) for group in inspection.duplicates],
        "not read": _by_reason([problem for problem in inspection.problems if not problem.samples]),
        "read but for samples": _by_reason([problem for problem in inspection.problems if problem.samples]),
        "note": inspection.notes,
    }
    for head, lines in lists.items():
        more = [f"  and {len(lines) - _SHOWN} more"] if len(lines) > _SHOWN else []
        if lines:
            parts.append("\n".join([f"{head}:", *(f"  {printable(line)}" for line in lines[:_SHOWN]), *more]))
    return "\n\n".join(parts)


def _by_reason(problems: Sequence[Problem]) -> list[str]:
    files: dict[str, dict[str, None]] = {}
    for problem in problems:
        files.setdefault(problem.what, {})[problem.file] = None
    return [
        f"{first_names([*names], _FILES)}{', ' if what.startswith('line ') else ': '}{what}"
        for what, names in files.items()
    ]


def _row(summary: LabelSummary) -> tuple[str, ...]:
    gaps = f"{summary.gaps} (to {summary.longest_gap:.3g} s)" if summary.gaps else "-"
    jitter = f"{100 * summary.jitter:.2g} %" if summary.jitter >= 1e-6 else "-"
    ranges = [_rate_range(values) for values in (summary.samples, summary.duration, summary.rate)]
    label = "(no label)" if summary.label is None else printable(summary.label)
    return (label, f"{summary.movements}", *ranges, jitter, gaps, _rate_range(summary.extent))


def _rate_range(values: Range) -> str:
    """Return the median alone if minimum and maximum are equal, else all three."""
    least, median, greatest = (f"{value:.4g}" if value < 1e6 else f"{value:.3g}" for value in values)
    return median if least == greatest else f"{median} ({least} to {greatest})"


def _kinds(channels: Channels) -> list[str]:
    """Return a line for each channel that is no position; of many, a line for each kind."""
    lever = lever_of(channels)
    others = [(channel, _kind(channel, lever)) for channel in channels if channel.kind != "position"]
    if len(others) <= _CHANNELS:
        return [f"{', '.join(channel.columns)}: {kind}" for channel, kind in others]
    names: dict[str, list[str]] = {}
    for channel, kind in others:
        names.setdefault(kind, []).append(channel.name)
    return [f"{first_names(alike, _CHANNELS)}: {kind}" for kind, alike in names.items()]


def _kind(channel: Channel, lever: float) -> str:
    what = {
        "angle": f"angle{f' in {channel.unit}' if channel.unit else ''}; wraps are taken away",
        "orientation": f"orientation, a quaternion {', '.join(channel.order)}; learned as its integrated rotation"
        + ("" if lever == 1 else f", a radian as {lever:g}"),
        "discrete": "discrete; kept as it is, not learned",
    }
    return what[channel.kind]


def _understood(how: Detected) -> str:
    times = "no times" if how.time is None else f"time {how.time!r} in {how.units} ({how.units_from})"
    parts = [f"{how.format}, {how.layout}: {times}", f"coordinates {_coordinates(how)}"]
    for what, columns in (
        ("movement", [column for column in how.movement if column not in how.person]),
        ("label", how.label),
        ("person", how.person),
        ("left aside", how.ignored),
    ):
        if named := [column for column in columns if column]:
            parts.append(f"{what} {first_names(named, _COLUMNS)}")
    return "; ".join(parts)


def _coordinates(how: Detected) -> str:
    units = set(how.measured_in)
    if len(units) == 1:
        return f"{first_names(how.columns, _COLUMNS)} in {units.pop()}"
    named = zip(how.columns, how.measured_in or [""] * len(how.columns), strict=True)
    return first_names([f"{name} [{unit}]" if unit else name for name, unit in named], _COLUMNS)


def contents_of_all(paths: Sequence[Path], follow_links: bool = False) -> list[Contents]:
    """Give the contents of all recordings at these paths; of several that have some, each row begins with its file."""
    try:
        entries, _ = entries_of(paths, follow_links) if paths else ([], [])
    except (DataError, OSError):  # reading gives the reason
        return []
    listed = {entry.name: contents for entry in entries if (contents := contents_of(entry.path))}
    if len(listed) < 2:
        return next(iter(listed.values()), [])
    merged: dict[tuple[str, tuple[str, ...]], Contents] = {}
    for name, several in listed.items():
        for content in several:
            key, rows = (content.name, content.heads), tuple((name, *row) for row in content.rows)
            before = merged.get(key, Contents(content.name, (_FILE, *content.heads), ()))
            merged[key] = before._replace(rows=before.rows + rows, note=before.note or content.note)
    return list(merged.values())


def contents_of(path: Path) -> list[Contents]:
    """Return the contents of one recording; none of what cannot be opened, of which reading gives the reason."""
    form = format_at(path)
    if form is None or form.contents is None or not (path.is_dir() or path.is_file()):
        return []
    try:
        return form.contents(path)
    except (DataError, OSError):
        return []


def contents_as_data(contents: list[Contents]) -> dict[str, Any]:
    """Return a list of dictionaries under each name."""
    return {content.name: [dict(zip(content.heads, row, strict=True)) for row in content.rows] for content in contents}


def contents_as_words(contents: list[Contents]) -> list[str]:
    """Return a table of each: what several files have alike once, and of a long list only what holds movements."""
    texts = []
    for name, heads, all_rows, note in map(_alike_once, contents):
        rows = all_rows
        if len(rows) > _SHOWN:
            rows = tuple(row for row in rows if not any(str(cell).startswith(_IDLE) for cell in row[-2:]))
        n_idle = len(all_rows) - len(rows)
        more = f"\nand {n_idle} {name} that hold no movement; --json lists them" if n_idle else ""
        cells = [tuple(f"{cell:,}" if isinstance(cell, int) else printable(cell) for cell in row) for row in rows]
        texts.append(to_text(Table(f"{name} {note}".strip(), heads, cells)) + more)
    return texts


def _alike_once(content: Contents) -> Contents:
    """Give rows that several files have alike but for their counts, once: the range of these, and in how many files."""
    if content.heads[0] != _FILE:
        return content
    n_files = len({file for file, *_ in content.rows})
    groups: dict[tuple[str, ...], list[list[str | int]]] = {}
    for _, *cells in content.rows:
        groups.setdefault(tuple(cell for cell in cells if isinstance(cell, str)), []).append(cells)
    rows = tuple(
        (*map(_range_of_counts, zip(*alike, strict=True)), f"{len(alike)} of {n_files}") for alike in groups.values()
    )
    return content._replace(heads=(*content.heads[1:], "files"), rows=rows)


def _range_of_counts(cells: Sequence[str | int]) -> str:
    """Return a text that all rows have, or the least and the greatest of their numbers."""
    numbers = [cell for cell in cells if isinstance(cell, int)]
    if not numbers:
        return str(cells[0])
    least, greatest = min(numbers), max(numbers)
    return f"{least:,}" if least == greatest else f"{least:,} to {greatest:,}"
