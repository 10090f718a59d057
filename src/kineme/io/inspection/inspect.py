"""Summary of a set of recordings in numbers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.io.column_order import notes_on_aside, notes_on_order
from kineme.io.inspection.extents import extents_of, notes_on_extents, notes_on_sizes
from kineme.io.inspection.gaps import notes_on_gaps, notes_on_sampling
from kineme.io.inspection.sampling import Sampling, sampling_of
from kineme.io.merge_files import Recordings
from kineme.io.problem import Problem
from kineme.movements.channels.channel import Channels
from kineme.movements.channels.column_match import columns_recorded
from kineme.movements.channels.coordinates import columns_of
from kineme.movements.tables.parsed import Detected
from kineme.movements.tables.time_stamps import GUESSED
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.reporting.text import first_names
from kineme.validation import Array

_STAMP = 1e-6  # times since the start are equal if they differ by less than this share of the duration

_MANY, _NAMED = 7, 12  # columns from which on still ones are counted; channels that a note names


class Range(NamedTuple):
    """Least, median and greatest of several numbers."""

    least: float
    median: float
    greatest: float


class LabelSummary(NamedTuple):
    """Summary of the movements of one label, or of those without a label.

    `samples`, `duration` [s], `rate` [Hz] and `extent` (the longest side of the box around a movement) range over
    movements; `jitter` is their median, see `Sampling`; `gaps` counts all, `longest_gap` [s] is 0 without any.
    """

    label: str | None
    movements: int
    samples: Range
    duration: Range
    rate: Range
    extent: Range
    jitter: float
    gaps: int
    longest_gap: float


class Inspection(NamedTuple):
    """The result of `inspect`.

    Attributes
    ----------
    movements, files, dimensions : int
    labels : tuple of LabelSummary
        In alphabetic order, those without a label last.
    detected : tuple of (Detected, int)
    channels : tuple of Channel or None
        What the columns are, where all files have the same.
    duplicates : tuple of tuple of str
        Names of movements that are the same, sample for sample.
    problems : tuple of Problem
    notes : tuple of str
        Hints that a person should check.
    """

    movements: int
    files: int
    dimensions: int
    labels: tuple[LabelSummary, ...]
    detected: tuple[tuple[Detected, int], ...]
    channels: Channels | None
    duplicates: tuple[tuple[str, ...], ...]
    problems: tuple[Problem, ...]
    notes: tuple[str, ...]


def nothing_read(file: str, reason: str) -> Inspection:
    """The inspection of a file of which no movement is read."""
    return Inspection(0, 0, 0, (), (), None, (), (Problem(file, None, reason),), ())


def inspect(recordings: Recordings) -> Inspection:
    """Summarize recordings."""
    demos = recordings.demonstrations
    sampling = sampling_of(demos)
    names = demos.names or ()
    duplicates = tuple(tuple(str(names[i]) for i in group) for group in duplicates_among(demos))
    labels = _summaries(recordings, sampling)
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


def labels_in_order(recordings: Recordings) -> list[str | None]:
    """Each label once, in alphabetic order, None last."""
    known = set(recordings.labels)
    named = sorted(label for label in known if label is not None)
    return [*named, *([None] if None in known else [])]


def _summaries(recordings: Recordings, sampling: Sampling) -> tuple[LabelSummary, ...]:
    demos, order = recordings.demonstrations, labels_in_order(recordings)
    number = {label: k for k, label in enumerate(order)}
    codes = np.array([number[label] for label in recordings.labels])
    extents = extents_of(demos).max(axis=1)
    return tuple(_summary(order[k], np.flatnonzero(codes == k), demos, sampling, extents) for k in range(len(order)))


def _summary(
    label: str | None, chosen: NDArray[np.intp], demos: Demonstrations, sampling: Sampling, extents: Array
) -> LabelSummary:
    gaps = sampling.gaps[chosen]
    return LabelSummary(
        label,
        len(chosen),
        _range(demos.lengths[chosen].astype(float)),
        _range(demos.durations[chosen]),
        _range(sampling.rates[chosen]),
        _range(extents[chosen]),
        float(np.median(sampling.jitters[chosen])),
        int(gaps.sum()),
        float(sampling.longest[chosen][gaps > 0].max(initial=0.0)),
    )


def _range(values: Array) -> Range:
    return Range(float(values.min()), float(np.median(values)), float(values.max()))


def _notes(recordings: Recordings, labels: tuple[LabelSummary, ...]) -> list[str]:
    notes, demos = [*recordings.notes], recordings.demonstrations
    guessed = sorted({str(how.units) for how, _ in recordings.detected if how.units_from in GUESSED})
    if len(guessed) > 1:
        notes.append(f"time counts in {' here, in '.join(guessed)} there, to judge by its size; give --units")
    if any(how.units_from.startswith("no times") for how, _ in recordings.detected):
        notes.append("some files have no times: each of their movements counts as one second; give --units STEP")
    if any(how.format.startswith("LeRobot") for how, _ in recordings.detected):
        notes.append("LeRobot does not declare the units of joints: they are taken as they are stored")
    notes += notes_on_aside(how for how, _ in recordings.detected)
    notes += notes_on_order((how for how, _ in recordings.detected), columns_recorded(demos.channels or ()))
    single = [str(one.label) for one in labels if one.label is not None and one.movements == 1]
    if single:
        notes.append(f"only one movement labeled {', '.join(single[:5])}{' and others' if len(single) > 5 else ''}")
    unlabeled = sum(one.movements for one in labels if one.label is None)
    if 0 < unlabeled < len(recordings):
        notes.append(f"{unlabeled} movements have no label: their files lie in no folder of their own")
    notes += notes_on_gaps(recordings) + notes_on_sampling(recordings) + notes_on_sizes(demos)
    return notes + notes_on_extents(demos) + _notes_on_channels(demos)


def _notes_on_channels(demos: Demonstrations) -> list[str]:
    """Columns whose values do not fit their kind, and those that never change."""
    notes = _notes_on_still_columns(demos)
    for one, columns in zip(demos.channels or (), columns_of(demos.channels or ()), strict=True):
        values = demos.recorded[:, columns.start]
        if one.kind == "position" and values.min() < values.max() and ((values == 0) | (values == 1)).all():
            notes.append(f"{one.name} is 0 or 1 throughout; if it is a switch, say --kind {one.name}=discrete")
    return notes


def _notes_on_still_columns(demos: Demonstrations) -> list[str]:
    """Columns of many that have one value throughout every movement: they tell nothing of what moves."""
    names, x, starts = columns_recorded(demos.channels or ()).heads, demos.recorded, demos.offsets[:-1]
    if len(names) < _MANY:
        return []
    still = (np.maximum.reduceat(x, starts, axis=0) == np.minimum.reduceat(x, starts, axis=0)).all(axis=0)
    quiet = [
        one.name
        for one, columns in zip(demos.channels or (), columns_of(demos.channels or ()), strict=True)
        if still[columns].all()
    ]
    if not quiet:
        return []
    named = first_names(quiet, _NAMED)
    return [f"{len(quiet)} of {len(demos.channels or ())} channels never move: {named}; --exclude leaves them out"]


def duplicates_among(demonstrations: Demonstrations) -> list[list[int]]:
    """Groups of indices of equal movements, each group in order.

    Candidates have equal lengths, ends and sums, computed for all movements at once; they are compared by sample.
    """
    x, offsets = demonstrations.positions, demonstrations.offsets
    key = np.column_stack(
        (demonstrations.lengths, x[offsets[:-1]], x[offsets[1:] - 1], np.add.reduceat(x, offsets[:-1], axis=0))
    )
    _, group, size = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    group = group.ravel()
    candidates = np.flatnonzero(size[group] > 1)
    candidates = candidates[np.argsort(group[candidates], kind="stable")]
    groups = []
    for alike in np.split(candidates, np.flatnonzero(np.diff(group[candidates])) + 1):
        groups += _equal(demonstrations, alike.tolist())
    return sorted(groups)


def _equal(demonstrations: Demonstrations, alike: list[int]) -> list[list[int]]:
    groups: list[list[int]] = []
    for i in alike:
        same = next((group for group in groups if _are_equal(demonstrations, group[0], i)), None)
        if same is None:
            groups.append([i])
        else:
            same.append(i)
    return [group for group in groups if len(group) > 1]


def _are_equal(demonstrations: Demonstrations, i: int, k: int) -> bool:
    one, other = demonstrations[i], demonstrations[k]
    since = np.abs((one.times - one.times[0]) - (other.times - other.times[0])).max()
    return np.array_equal(one.recorded, other.recorded) and bool(since <= _STAMP * one.duration)
