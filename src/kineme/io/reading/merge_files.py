"""Many files as one set of demonstrations, with sources and people; sampling rates, gaps, and notes on them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import pairwise
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError, TrajectoryError
from kineme.io.arrays.npz import Npz
from kineme.io.reading.check_block import check_block, movement_of, take_movements
from kineme.io.reading.column_order import dimensions_unlike, in_one_set, notes_on_rotation_vectors
from kineme.io.reading.read_file import FileRead
from kineme.io.records import Problem, note_on_missing
from kineme.movements.channels.channel import Channels, is_plain, recorded_names
from kineme.movements.channels.column_match import columns_detected
from kineme.movements.channels.coordinates import canonical, in_order, off_norm
from kineme.movements.channels.detect import Given, find_channels, kinds_of
from kineme.movements.preparation.glitches import without_glitches
from kineme.movements.tables.layout import Block, Detected, Layout, Repair, listed
from kineme.movements.tables.table import as_name
from kineme.movements.tables.time_stamps import GUESSED
from kineme.movements.trajectories.demonstrations import Demonstrations, MovementSequence
from kineme.movements.trajectories.labels import label_array
from kineme.movements.trajectories.movements import Movements, of_channels
from kineme.reporting.text import counted, first_names
from kineme.units import UNITS, unit_named
from kineme.validation import Array

GAP = 3.0  # steps longer than this many median steps are gaps: at least two samples are missing

_NAMED = 6  # numbers that stand for no value in a note
_RATES = (2.0, 20_000.0)  # usual sampling rates of people and robots [Hz]
_ALIKE = 10.0  # stamps of units, a thousand apart, whose steps are not as many times apart are doubtful
_PAUSE = 1.0  # s without samples from which on a movement may be several

#: Names of an array (n,) of people in an npz archive, one for each of its n movements.
NAMES = ("people", "person", "subjects", "subject")
_DEPTH = 3  # person/label/recording

_HINT = "check the order of the columns, or divide the quaternions by their norms"
_LOST = "nothing was tracked there; leave such samples out with skip='sample', in the shell --skip sample"


class Source(NamedTuple):
    """The source of a movement."""

    path: str  # relative to the folder that was read, with forward slashes; the name of the file if one was read
    sha256: str  # of the file's bytes, in hexadecimal
    size: int  # bytes
    mtime: float  # last modification of the file, in seconds since 1970
    place: str  # which movement of the file: its key in a long table, its index in arrays; empty if there is but one
    label: str | None
    person: str | None = None  # who showed it, where a column or ``label_pattern`` says it
    filled: int = 0  # number of samples of which missing values are interpolated
    longest_gap: float = 0.0  # that was filled, from the sample before to the sample after [s]
    cropped: float = 0.0  # time at both ends that was left out, since columns have no values there [s]

    @property
    def name(self) -> str:
        """File and place, as ``long.csv#3``; the file alone if it holds but one movement."""
        return f"{self.path}#{self.place}" if self.place else self.path


@dataclass(frozen=True, eq=False)
class Recordings(MovementSequence):
    """Movements with their sources, and the problems of what could not be read.

    A sequence of `Trajectory`, taken wherever movements are expected.

    - `demonstrations`: the movements of the most frequent number of dimensions (of two equally frequent, the one met
      first); those of other dimensions are among the problems. They carry labels if every one of them has one.
    - `sources`: one per movement.
    - `detected`: how files were understood, and how many in this way; most frequent first.
    - `notes`: what else a person should know of how they were read.
    """

    demonstrations: Demonstrations
    sources: tuple[Source, ...]
    problems: tuple[Problem, ...]
    detected: tuple[tuple[Detected, int], ...]
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.sources)

    @cached_property
    def labels(self) -> NDArray[Any]:
        """The label of each movement or None, shape (n,), objects, also where some have none; read-only."""
        labels = np.empty(len(self.sources), dtype=object)
        labels[:] = [source.label for source in self.sources]
        labels.setflags(write=False)
        return labels

    @property
    def people(self) -> list[str | None] | None:
        """Person of each movement, by a column, or ``{person}`` in ``label_pattern``; None where these say nothing."""
        people = [source.person for source in self.sources]
        return people if any(people) else None

    @property
    def short_names(self) -> list[str]:
        """A name for each movement: its place where all are of one file, as ``episode 3``; else file and place."""
        one_file = len({source.path for source in self.sources}) == 1
        return [source.place if source.place and one_file else source.name for source in self.sources]

    def __repr__(self) -> str:
        n_files = len({source.path for source in self.sources})
        files, problems = counted(n_files, "file"), counted(len(self.problems), "problem")
        return f"Recordings({self.demonstrations!r}, {files}, {problems})"


def merge_files(files: Sequence[FileRead], where: str, layout: Layout, problems: Sequence[Problem] = ()) -> Recordings:
    """Return one `Recordings` of all files read at `where` that hold movements, and of problems that came before."""
    files = _without_unclear_times(files)
    reported = [*problems, *(problem for file in files for problem in file.problems)]
    full = [file for file in files if file.block.labels]
    if not full:
        if len(reported) == 1 and reported[0].file in (where, Path(where).name):  # one file alone: it is named once
            raise DataError(str(reported[0]._replace(file=where)))
        first = f"; {len(reported)} could not be read, the first {reported[0]}" if reported else ""
        raise DataError("; ".join([f"expected recordings in {where}, found none{first}", *note_on_missing(reported)]))
    n_dims = Counter(file.n_dims for file in full for _ in file.block.labels).most_common(1)[0][0]
    odd = [file for file in full if file.n_dims != n_dims]
    full = [file for file in full if file.n_dims == n_dims]
    reported += dimensions_unlike(odd, full)
    understood = {file.path: file.detected for file in full}
    full, channels, odd_channels = with_channels(full, layout)
    reported += odd_channels
    if not any(file.block.labels for file in full):
        none = next((problem for problem in reported if not problem.samples), reported[0])
        raise DataError(f"expected recordings in {where}, found none; the first that is none: {none}")
    sources = tuple(
        Source(file.path, file.sha256, file.size, file.mtime, place, label, person or file.person, *repair)
        for file in full
        for place, label, person, repair in zip(
            file.block.places,
            file.block.labels,
            file.block.people or [None] * len(file.block.labels),
            file.block.repairs or [Repair()] * len(file.block.labels),
            strict=True,
        )
    )
    detected = Counter(understood[file.path] for file in full).most_common()
    blocks = [file.block for file in full]
    positions = _concatenated([block.positions for block in blocks])
    times = _concatenated([block.stamps for block in blocks])
    demonstrations = demonstrations_of(positions, times, _offsets_of(blocks), sources, channels)
    taken = [how.columns for how, _ in detected if layout.by_number and how.named]
    notes = (
        [f"read the columns of these numbers, {listed(taken[0])}: counted from 0, over all of a file"] if taken else []
    )
    notes += _notes_on_unit(layout.measured_in, [how for how, _ in detected])
    if counting := [*dict.fromkeys(head for how, _ in detected for head in how.in_blocks)]:
        notes.append(
            f"{first_names(counting, _NAMED)} may count movements that are read as one: the value changes after many "
            "samples, and never back; if so, say movement=, in the shell --movement"
        )
    notes += dict.fromkeys(note for how, _ in detected for note in how.notes)
    return Recordings(demonstrations, sources, tuple(reported), tuple(detected), tuple(notes))


def _notes_on_unit(unit: str | None, detected: Sequence[Detected]) -> list[str]:
    """Say that no column is in the unit that is said to be that of all of which the files say none."""
    units = [unit_named(each or "") for how in detected for each in columns_detected(how).units]
    if unit is None or unit_named(unit) in units or any(how.converted for how in detected):
        return []
    return [f"no column is in {unit}, as measured_in= (--measured-in) says: none without a unit can be in it"]


def _without_unclear_times(files: Sequence[FileRead]) -> list[FileRead]:
    """Refuse files whose stamps, below one head, are of several units to judge by their steps, which are alike."""
    steps: dict[str, dict[str | float, list[float]]] = {}  # head of times -> unit -> the files' steps in it
    guessed = {file.path: file.detected for file in files if file.detected.units_from in GUESSED and file.block.labels}
    if len({how.units for how in guessed.values()}) > 1:
        for file in files:
            if (how := guessed.get(file.path)) is not None:
                step = float(np.median(np.abs(np.diff(file.block.stamps))) / float(UNITS[str(how.units)].size))
                steps.setdefault(str(how.time), {}).setdefault(how.units, []).append(step)
    reasons = {}
    for head, by_unit in steps.items():
        ordered = sorted(by_unit.items(), key=lambda pair: min(pair[1]))
        if any(min(more) < _ALIKE * max(less) for (_, less), (_, more) in pairwise(ordered)):
            words = " or ".join(f"{unit} (in steps of {min(several):.4g})" for unit, several in ordered)
            reasons[head] = (
                f"expected times whose unit can be told, got {head!r} that is {words}, to judge by its steps, which "
                "are too much alike; say units=, in the shell --units, or read files of each unit apart"
            )
    return [
        file.without_movements(reasons[str(file.detected.time)])
        if file.path in guessed and str(file.detected.time) in reasons
        else file
        for file in files
    ]


def demonstrations_of(
    positions: Array,
    times: Array,
    offsets: NDArray[np.intp],
    sources: Sequence[Source],
    channels: Channels | None,
    dimensions: tuple[str, ...] | None = None,
) -> Demonstrations:
    """Return movements with their names, and with labels if every one of them has one."""
    labels, names = [source.label for source in sources], tuple(source.name for source in sources)
    labeled = None if None in labels else label_array(labels, len(labels), names)
    durations = times[offsets[1:] - 1] - times[offsets[:-1]]
    merged = Movements(positions, offsets, durations, times, labeled, names, dimensions)
    return Demonstrations.of_movements(merged if channels is None else of_channels(merged, channels))


def _offsets_of(blocks: Sequence[Block]) -> NDArray[np.intp]:
    return np.concatenate(([0], np.cumsum(np.concatenate([np.diff(block.offsets) for block in blocks]))))


def _concatenated(arrays: Sequence[Any]) -> Any:
    return np.ascontiguousarray(arrays[0] if len(arrays) == 1 else np.concatenate(arrays))


def with_channels(files: Sequence[FileRead], layout: Layout) -> tuple[list[FileRead], Channels | None, list[Problem]]:
    """Return files with equally many columns that have the same channels, these channels, and problems.

    Kinds are found for all files together. Files whose columns have no names, or are chosen by numbers, are merged by
    the order of their columns while all are positions or angles, and then nothing is known of the channels.
    """
    given = layout.kinds or {}
    same, nameless, problems = in_one_set(files, layout.by_number)
    channels = _channels_of(same, given)
    if nameless and is_plain(channels):
        place = {file.path: k for k, file in enumerate(files)}
        return _without_wraps(sorted([*same, *nameless], key=lambda file: place[file.path]), given), None, problems
    heads = list(recorded_names(channels))
    problems += [
        Problem(file.path, None, f"no names of columns where most files have {heads}; name them as these are")
        for file in nameless
    ]
    checked = [_check_orientations(file, channels, layout.skip) for file in same]
    problems += [problem for _, several in checked for problem in several]
    return [file for file, _ in checked], channels, problems


def _channels_of(files: Sequence[FileRead], given: Given) -> Channels:
    blocks, detected = [file.block for file in files], files[0].detected
    positions = np.concatenate([block.positions for block in blocks]) if len(blocks) > 1 else blocks[0].positions
    return find_channels(detected.columns, positions, _offsets_of(blocks), given, detected.measured_in)


def _without_wraps(files: Sequence[FileRead], given: Given) -> list[FileRead]:
    """Return files of several heads, in the columns of each the angles continuous."""
    groups: dict[tuple[str, ...], list[FileRead]] = {}
    for file in files:
        groups.setdefault(file.detected.columns, []).append(file)
    channels_of_heads = {heads: _channels_of(group, kinds_of(given, heads)) for heads, group in groups.items()}
    result = []
    for file in files:
        block, channels = file.block, channels_of_heads[file.detected.columns]
        if is_plain(channels):
            block = replace(block, positions=canonical(block.positions, block.offsets, channels))
        result.append(file._replace(block=block))
    return result


def _check_orientations(file: FileRead, channels: Channels, skip: str) -> tuple[FileRead, list[Problem]]:
    """Return a file with the columns of channels side by side, without samples or movements of wrong quaternions."""
    block = replace(file.block, positions=in_order(file.block.positions, file.detected.columns, channels))
    problems, faults = list[Problem](), dict[int, str]()
    good = np.ones(len(block.labels), dtype=bool)
    for channel, odd, norms in off_norm(block.positions, channels):
        owners = np.searchsorted(block.offsets, odd, side="right") - 1
        reasons = [
            f"expected unit quaternions in {', '.join(channel.columns)}, got norm {norms[k]:.6g} at sample "
            f"{k - block.offsets[i]}; {_HINT if norms[k] or skip == 'sample' else _LOST}"
            for i, k in zip(owners.tolist(), odd.tolist(), strict=True)
        ]
        faults |= dict(zip((block.row(k) for k in odd.tolist()), reasons, strict=True))
        for i, first in zip(*map(np.ndarray.tolist, np.unique(owners, return_index=True)), strict=True):
            line = block.line_of(block.row(int(odd[first])))
            problems.append(Problem(file.path, line, movement_of(block, i) + reasons[first], TrajectoryError))
        good[owners] = False
    if faults and skip == "sample":
        block, problems = check_block(replace(block, faults=faults), file.path, Layout(skip=skip), ())
        return file._replace(block=block), problems
    return file._replace(block=take_movements(block, good)), problems


def each_person(path: Path, sources: Sequence[Source]) -> list[str | None]:
    """Return the person of each movement of what was read at `path`, None where it is unknown."""
    of_file = cache(lambda name: _people_in(path / name if path.is_dir() else path))
    return [source.person or _person(source, of_file(source.path)) for source in sources]


def _person(source: Source, listed: list[str | None] | None) -> str | None:
    if listed is None:
        folders = PurePosixPath(source.path).parts
        if source.label in folders[:-2] and source.label != folders[-2]:  # label/person/recording
            return folders[folders.index(source.label) + 1]
        return folders[-_DEPTH] if len(folders) >= _DEPTH else None
    index = int(source.place or 0)
    if index >= len(listed):
        raise DataError(f"expected a person for each movement in {source.path}, got {len(listed)}; add the others")
    return listed[index]


def _people_in(file: Path) -> list[str | None] | None:
    if file.suffix.lower() != ".npz":
        return None
    arrays = Npz(file.read_bytes(), file)
    name = next((name for name in NAMES if name in arrays), None)
    return None if name is None else [as_name(person) or None for person in np.atleast_1d(arrays[name]).tolist()]


def notes_on_gaps(recordings: Recordings) -> list[str]:
    """Say which numbers count as no value, what is converted, what was filled and cropped, what lacks values."""
    sources, notes = recordings.sources, []
    if sentinels := [*dict.fromkeys(sentinel for how, _ in recordings.detected for sentinel in how.sentinels)]:
        notes.append(f"{first_names(sentinels, _NAMED)} counts as no value, far from all others")
    if converted := [*dict.fromkeys(unit for how, _ in recordings.detected for unit in how.converted)]:
        notes.append(f"units are converted to those of most columns: {first_names(converted, _NAMED)}")
    if filled := [source for source in sources if source.filled]:
        samples, longest = sum(source.filled for source in filled), max(source.longest_gap for source in filled)
        notes.append(
            f"gaps of up to {longest:.3g} s were filled in {counted(len(filled), 'movement')}, "
            f"{counted(samples, 'sample')} in all; --fill-gaps 0 fills none"
        )
    if cropped := [source.cropped for source in sources if source.cropped]:
        notes.append(
            f"{counted(len(cropped), 'movement')} cropped to where all columns have values, by up to "
            f"{max(cropped):.3g} s, {sum(cropped):.3g} s in all"
        )
    return notes + note_on_missing(recordings.problems)


def notes_on_values(recordings: Recordings) -> list[str]:
    """Say what stamps and columns of movements let doubt: unit, gaps, lost samples, rotation vectors that jump."""
    of_vectors = notes_on_rotation_vectors(recordings.demonstrations)
    return _notes_on_sampling(recordings) + _notes_on_glitches(recordings) + of_vectors


def _notes_on_glitches(recordings: Recordings) -> list[str]:
    """Say that samples leave the path, as of a tracker that lost what it follows."""
    demos = recordings.demonstrations
    positions = without_glitches(demos.positions, demos.offsets)
    if positions is demos.positions:
        return []
    rows = np.flatnonzero((positions != demos.positions).any(axis=1))
    movement = np.searchsorted(demos.offsets, rows, side="right") - 1
    at = demos.times[rows[0]] - demos.times[demos.offsets[movement[0]]]
    return [
        f"{counted(len(np.unique(movement)), 'movement')} with samples far from the path, the first "
        f"{recordings.short_names[movement[0]]} after {at:.3g} s, as of a tracker that lost what it follows; they are "
        "left out where movements are recognized and moved again, in Python by kineme.movements.RemoveGlitches()"
    ]


def _notes_on_sampling(recordings: Recordings) -> list[str]:
    """Say that the rate is unusual, and that there are no samples for so long that a movement may be several."""
    sampling, notes = sampling_of(recordings.demonstrations), []
    rate = float(np.median(sampling.rates))
    if not _RATES[0] <= rate <= _RATES[1]:
        notes.append(f"{rate:.3g} samples per second are unusual; if the unit of time is another, give --units")
    paused = (sampling.gaps > 0) & (sampling.longest > _PAUSE)
    if not paused.any():
        return notes
    first = int(np.flatnonzero(paused)[0])
    longest = sampling.longest[paused].max()
    return [
        *notes,
        f"{counted(int(paused.sum()), 'movement')} without samples for up to {longest:.3g} s, the first "
        f"{recordings.short_names[first]}; if these are several movements, say which column tells them apart, "
        "--movement, in Python movement=, or cut them by kineme segment",
    ]


class Sampling(NamedTuple):
    """One row per movement; arrays of shape (n,)."""

    rates: Array  # one over the median step between samples [Hz]
    # Root mean square deviation of the steps from the median step, as a share of it; gaps are not counted.
    jitters: Array
    gaps: NDArray[np.intp]  # number of steps longer than `GAP` median steps
    longest: Array  # the longest step [s]


def sampling_of(demonstrations: Demonstrations) -> Sampling:
    """Return rates, jitters and gaps of every movement."""
    offsets, lengths = demonstrations.offsets, demonstrations.lengths - 1
    inner = np.ones(len(demonstrations.times) - 1, dtype=bool)
    inner[offsets[1:-1] - 1] = False  # from one movement to the next
    steps = np.diff(demonstrations.times)[inner]
    starts = np.concatenate(([0], np.cumsum(lengths)[:-1]))
    owner = np.repeat(np.arange(len(lengths)), lengths)
    ordered = steps[np.lexsort((steps, owner))]
    median = 0.5 * (ordered[starts + (lengths - 1) // 2] + ordered[starts + lengths // 2])
    relative = steps / median[owner]
    gaps = relative > GAP
    deviation = np.where(gaps, 0.0, relative - 1.0) ** 2
    n_gaps = np.add.reduceat(gaps.astype(np.intp), starts)
    jitters = np.sqrt(np.add.reduceat(deviation, starts) / np.maximum(lengths - n_gaps, 1))
    return Sampling(1.0 / median, jitters, n_gaps, ordered[starts + lengths - 1])
