"""Long recordings cut into labeled movements by a table of labels."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from kineme.errors import DataError
from kineme.io.annotations.label_table import LabelRow
from kineme.io.annotations.read_labels import LabelTable
from kineme.io.merge_files import Recordings, Source
from kineme.io.problem import Problem
from kineme.movements.trajectories.channels import of_channels
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.labels import label_array
from kineme.movements.trajectories.movements import Movements
from kineme.reporting.text import counted
from kineme.validation import MIN_SAMPLES, Array


def labeled_pieces(recordings: Recordings, table: LabelTable) -> Recordings:
    """The stretches of recordings that a table labels, as movements of their own.

    A stretch begins and ends at the samples nearest to its times. Times by the recording's clock that all lie outside
    of it, and would fit counted from its first sample, are taken so. Columns named recording and place say which
    recording a row is of; without them there must be one. A stretch outside of its recording, of fewer than four
    samples, or labeled twice is a problem, and so are rows of recordings that are not there.

    Raises
    ------
    DataError
        Several recordings, and a table that does not say which row is of which; no stretch at all.
    """
    demos, rows = recordings.demonstrations, table.rows
    if len(demos) > 1 and not any(row.recording or row.place for row in rows):
        raise DataError(
            f"expected labels {table.name} beside one recording, got {len(demos)}; say which row is of which in "
            "columns recording and place"
        )
    stretches: list[tuple[int, int]] = []
    sources: list[Source] = []
    paths = {source.path for source in recordings.sources}
    meant = {name: _paths_of(name, paths) for name in dict.fromkeys(row.recording for row in rows)}
    problems = [*recordings.problems, *_of_none(table, recordings.sources, meant), *_of_several(table, meant)]
    for i, source in enumerate(recordings.sources):
        first, last = demos.offsets[i : i + 2]
        own = [
            row for row in rows if (not row.recording or len(meant[row.recording]) == 1) and _is_of(row, source, meant)
        ]
        times = demos.movements.stamps[first:last]
        since = table.since_start or _counts_from_start(own, times)
        lines: dict[tuple[int, int], int] = {}  # stretch -> line that labels it
        for row in own:
            origin = float(times[0]) if since else 0.0
            start, stop = _samples(row, times, origin)
            outside = max(times[0] - origin - row.start, 0.0) + max(row.end + origin - times[-1], 0.0)
            if stop - start < MIN_SAMPLES or outside > _OUTSIDE * (row.end - row.start):
                problems.append(Problem(table.name, row.line, _too_short(row, source, times, since)))
            elif (line := lines.setdefault((start, stop), row.line)) != row.line:
                problems.append(
                    Problem(table.name, row.line, f"expected one label for a stretch, line {line} has it too")
                )
            else:
                stretches.append((int(first) + start, int(first) + stop))
                sources.append(source._replace(place=_place(source, times, start, stop), label=row.label))
    if not stretches:
        raise DataError(
            f"expected labels {table.name} within {recordings.sources[0].path}, found none"
            + (f"; the first that is none: {problems[-1]}" if len(problems) > len(recordings.problems) else "")
        )
    return replace(
        recordings, demonstrations=_cut(demos, stretches, sources), sources=tuple(sources), problems=tuple(problems)
    )


#: Share of a stretch that may lie outside its recording: somebody who labels to the end rounds it up.
_OUTSIDE = 0.1


def _of_none(table: LabelTable, sources: Sequence[Source], meant: Mapping[str, Sequence[str]]) -> list[Problem]:
    """The rows of recordings that are not there, as one problem."""
    lost = [row for row in table.rows if not any(_is_of(row, source, meant) for source in sources)]
    if not lost:
        return []
    wanted = f"{lost[0].recording} {lost[0].place}".strip()
    more = f", and {counted(len(lost) - 1, 'row')} more" if len(lost) > 1 else ""
    return [
        Problem(table.name, lost[0].line, f"expected a recording {wanted} among those that are read, found none{more}")
    ]


def _of_several(table: LabelTable, meant: Mapping[str, Sequence[str]]) -> list[Problem]:
    """The rows of which several recordings may be meant, one problem for each name."""
    first = {row.recording: row.line for row in reversed(table.rows)}
    return [
        Problem(
            table.name,
            first[name],
            f"expected one recording {name}, got {', '.join(paths)}; write its folder in the column recording too",
        )
        for name, paths in meant.items()
        if name and len(paths) > 1
    ]


def _paths_of(recording: str, paths: Collection[str]) -> list[str]:
    """The recordings that a name may mean: itself, else those in folders below, else the end of a longer path."""
    if recording in paths:
        return [recording]
    below = sorted(path for path in paths if path.endswith(f"/{recording}"))
    return below or sorted((path for path in paths if recording.endswith(f"/{path}")), key=len)[-1:]


def _is_of(row: LabelRow, source: Source, meant: Mapping[str, Sequence[str]]) -> bool:
    if row.place and row.place != source.place:
        return False
    return not row.recording or source.path in meant[row.recording]


def _counts_from_start(rows: Sequence[LabelRow], times: Array) -> bool:
    """Whether no stretch is within the recording by its clock, and all are counted from its first sample."""
    duration = float(times[-1] - times[0])
    outside = all(row.end < times[0] or row.start > times[-1] for row in rows)
    return outside and all(row.start >= 0.0 and row.end <= duration * (1.0 + 1e-6) for row in rows)


def _samples(row: LabelRow, times: Array, origin: float) -> tuple[int, int]:
    """The samples from the one nearest to the start to the one nearest to the end: first, and one past the last."""
    half = 0.5 * float(np.median(np.diff(times)))
    start = int(np.searchsorted(times, origin + row.start - half))
    return start, int(np.searchsorted(times, origin + row.end + half))


def _place(source: Source, times: Array, start: int, stop: int) -> str:
    ends = (np.format_float_positional(times[k], precision=4, trim="-") for k in (start, stop - 1))
    return f"{source.place} {'-'.join(ends)} s".strip()


def _too_short(row: LabelRow, source: Source, times: Array, since: bool) -> str:
    origin = float(times[0]) if since else 0.0
    return (
        f"expected at least {MIN_SAMPLES} samples, and nine tenths, of the time between {row.start:g} and "
        f"{row.end:g} s in {source.path}; it lasts from {times[0] - origin:g} to {times[-1] - origin:g} s"
    )


def _cut(demos: Demonstrations, stretches: Sequence[tuple[int, int]], sources: Sequence[Source]) -> Demonstrations:
    """The stretches of samples as movements; what is learned of orientations and angles begins anew in each."""
    whole, kept = demos.movements, np.concatenate([np.arange(*one) for one in stretches])
    offsets = np.concatenate(([0], np.cumsum([stop - start for start, stop in stretches])))
    times, labels = whole.stamps[kept], [one.label for one in sources]
    names = tuple(f"{one.path}#{one.place}" for one in sources)
    positions = np.ascontiguousarray((demos.positions if whole.channels is None else demos.recorded)[kept])
    labeled = None if None in labels else label_array(labels, len(labels), names)
    durations = times[offsets[1:] - 1] - times[offsets[:-1]]
    pieces = Movements(positions, offsets, durations, times, labeled, names, whole.dimensions)
    return Demonstrations.of_movements(pieces if whole.channels is None else of_channels(pieces, whole.channels))
