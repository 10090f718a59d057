"""Candidate windows of one recording, compared with the demonstrations as far as it can matter.

Nearly all windows of a long recording are far from every class. How far does not matter, except for how common a
distance is: that is estimated from some windows, which are compared completely. The others are compared in the order of
a coarse distance, until none is within reach any more.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.movements.segmentation.segment import moving
from kineme.movements.segmentation.table import Motion, Rest, Rows, observe, steps_of
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import Movements
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.recognition.coarse_windows import coarse_distances, coarse_references
from kineme.recognition.conformal import LEAST, Calibration
from kineme.recognition.levels import Levels, gripper_levels, level_scores
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.runtime.parallel import for_tiles
from kineme.sampling import evenly_spaced
from kineme.similarity.comparison import Comparison, References
from kineme.similarity.scores import Compared, for_compared, nearest_above
from kineme.validation import Array

MIN_SAMPLES = 8  # of a window
N_POINTS = 64  # even samples by which a window is described
RESOLUTION = 0.04  # share of the peak speed that must be distinguished from rest
_SHARE = 0.12  # distance of boundaries, in durations of the shortest windows between them
_DEPTH = 0.2  # prominence, in the logarithm of speed, of a minimum that is a boundary
_FLOOR = 0.02  # of the peak speed: lower speeds count as equally slow
_SLOW = 0.02  # share of the peak speed below which a sample counts as at rest
_MOST_REST = 0.6  # share of a window at rest
_DRIFT = 0.2  # share of the peak speed: a drift that covers less path between boundaries gets none

_TILE, _AT_ONCE = 4096, 256  # windows between two calls of `progress`, and those that a thread describes at a time
_COMPLETELY = 256  # windows that are compared completely, evenly spaced: they tell how common distances are
#: Windows are compared in steps, those that are coarsely nearest first, until none of a step is within reach.
_STEPS, _LEAST_TILE = 32, 256  # steps of all windows, at most; windows in a step, at least
_CELL, _NEAR = 0.5, 0.2  # width of cells of windows, in their duration, and the share of each that is compared
_ABOVE = 1e-6  # share by which the score of a window that is not compared is above the bar
_RESTING = 0.2  # share of the mean speed of a window below which it rests
_COMMON = 0.2  # share of the windows of a recording whose distance to a class, or less, is common
_OPERATIONS_PER_SAMPLE = 8  # of the size of a path
_RARITY = 0.3  # power with which distances count in common ones

Progress = Callable[[float], object]  # takes the share that is done


class Templates(NamedTuple):
    """Known movements that windows are compared with."""

    comparison: Comparison
    references: References
    calibration: Calibration
    steps: bool = True  # whether recordings have the discrete columns of the references

    def of(self, recording: Trajectory) -> Templates:
        """Return templates for one recording."""
        n = sum(channel.kind == "discrete" for channel in self.comparison.channels or ())
        return self._replace(steps=steps_of(recording).shape[1] == n)

    @property
    def levels(self) -> Levels | None:
        """Levels of grippers of the references; kept with them."""
        held = vars(self.references).setdefault("_levels", {})
        if self.steps not in held:
            held[self.steps] = gripper_levels(self.references, self.comparison.channels, RESOLUTION, self.steps)
        levels: Levels | None = held[self.steps]
        return levels

    def level_scores(self, motion: Motion, rows: Rows) -> Array:
        """Return the nonconformity (n, C) of windows by their levels: 0 where these are no evidence."""
        if self.levels is None:
            return np.zeros((len(rows), len(self.references.classes)))
        return level_scores(self.levels, motion, rows)


@dataclass(frozen=True, eq=False)
class ComparedWindows:
    """n windows, compared with C classes.

    `log_durations`, `log_sizes`, `slowness` (n,): slowness is the share of the duration that is slow.
    """

    rows: Rows  # (n, 2), first and last sample
    scores: Array  # (n, C), nonconformity to each class
    log_durations: Array
    log_sizes: Array
    slowness: Array

    def take(self, chosen: Any) -> ComparedWindows:
        """Return the chosen windows: a mask or indices."""
        return ComparedWindows(*(getattr(self, attribute.name)[chosen] for attribute in fields(self)))


class Candidates(NamedTuple):
    """n windows, compared as far as it can matter.

    `completely` (n,): whether all scores of a window are known. Those of the others that exceed the reach, once
    weighted, are lower bounds that exceed it too.
    """

    compared: ComparedWindows
    weights: Array  # (C,), what the scores of each class are to be multiplied by, see `rarity_weights`
    completely: NDArray[np.bool_]

    def weighted(self) -> ComparedWindows:
        """Return the windows with weighted scores."""
        rows, scores, *others = (getattr(self.compared, attribute.name) for attribute in fields(self.compared))
        return ComparedWindows(rows, scores * self.weights, *others)


def compare_candidates(
    templates: Templates,
    motion: Motion,
    rows: Rows,
    reach: float,
    progress: Progress | None = None,
    most: Callable[[ComparedWindows], Array] | None = None,
) -> Candidates:
    """Compare the windows from sample rows[:, 0] to rows[:, 1] with the references.

    `rows` (n, 2); `reach`: weighted nonconformity beyond which a window counts as far, however far it is; `progress`:
    called now and then with the share of the windows that is compared; `most`: from windows, whose scores are 0, to
    the weighted nonconformity (n, C) beyond which they do not matter as each class, where that is below the reach.
    """
    completely = np.zeros(len(rows), dtype=bool)
    completely[evenly_spaced(len(rows), _COMPLETELY)] = True
    sample, others = np.flatnonzero(completely), np.flatnonzero(~completely)
    windows = _not_compared(templates, motion, rows)
    within = None if most is None else most(windows)
    scores = windows.scores
    scores[sample] = _scores(templates, motion, rows[sample], None, _part(progress, 0.0, completely.mean()))
    weights = rarity_weights(scores[sample] * templates.calibration.scales)
    bars = reach / weights
    scores[others] = bars * (1.0 + _ABOVE)
    within = np.broadcast_to(bars, scores.shape) if within is None else np.minimum(within, reach) / weights
    order, near = _by_coarse_distance(templates, motion, rows[others], weights)
    others, size = others[order], int(np.clip(len(rows) // _STEPS, _LEAST_TILE, _TILE))
    for begin in range(0, near, size):
        some = others[begin : min(begin + size, near)]
        tell = _part(progress, 1.0 - (len(others) - begin) / len(rows), len(some) / len(rows))
        scores[some] = _scores(templates, motion, rows[some], within[some], tell)
        if (scores[some] > bars).all():  # none is within reach: of those that are coarsely farther none is, either
            break
    if progress is not None:
        progress(1.0)
    return Candidates(windows, weights, completely)


def _by_coarse_distance(
    templates: Templates, motion: Motion, rows: Rows, weights: Array
) -> tuple[NDArray[np.intp], int]:
    """Return the order of windows, coarsely nearest first, and how many of them are to be compared.

    That is all of them, unless levels are evidence too. The reach is wide then, and holds many windows: only those that
    are among the nearest of the windows of about the same time and duration can be chosen before others.
    """
    if not len(rows):
        return np.empty(0, dtype=np.intp), 0
    coarse = coarse_references(templates.comparison, templates.references, RESOLUTION)
    distances = coarse_distances(templates.comparison, coarse, motion, rows)
    if templates.levels is None:
        return np.argsort((distances * weights).min(axis=1), kind="stable"), len(rows)
    distances = np.hypot(distances, level_scores(templates.levels, motion, rows)) * weights
    times = motion.times[rows]
    lasting = times[:, 1] - times[:, 0]
    octave = np.floor(np.log2(lasting / lasting.min())).astype(np.intp)
    cell = np.floor(times.mean(axis=1) / (_CELL * lasting.min() * 2.0**octave)).astype(np.intp)
    far = np.ones(len(rows), dtype=bool)
    for of_class in distances.T:
        by_cell = np.lexsort((of_class, cell, octave))
        first = np.flatnonzero(np.diff(octave[by_cell], prepend=-1) | np.diff(cell[by_cell], prepend=-1))
        counts = np.diff(first, append=len(rows))
        far[by_cell] &= np.arange(len(rows)) - np.repeat(first, counts) >= np.repeat(np.ceil(_NEAR * counts), counts)
    return np.lexsort((distances.min(axis=1), far)), int(len(rows) - far.sum())


def _not_compared(templates: Templates, motion: Motion, rows: Rows) -> ComparedWindows:
    """Return windows with scores of 0."""
    start, end = motion.times[rows].T
    sizes, slowness = np.empty((2, len(rows)))

    def fill(first: int, last: int) -> None:
        tile = slice(first, last)
        paths = resampled(motion, start[tile], end[tile]).positions.reshape(last - first, N_POINTS, -1)
        sizes[tile], slowness[tile] = size_and_slowness(paths.transpose(0, 2, 1))

    for_tiles(fill, len(rows), _TILE)
    scores = np.zeros((len(rows), len(templates.references.classes)))
    return ComparedWindows(rows, scores, np.log(end - start), sizes, slowness)


def _part(progress: Progress | None, begin: float, share: float) -> Progress | None:
    """Return progress of a part of the work."""
    return None if progress is None else lambda done: progress(min(1.0, begin + done * share))


def compare_windows(templates: Templates, motion: Motion, rows: Rows) -> ComparedWindows:
    """Compare windows with all references."""
    return replace(_not_compared(templates, motion, rows), scores=_scores(templates, motion, rows))


def _scores(
    templates: Templates, motion: Motion, rows: Rows, within: Array | None = None, progress: Progress | None = None
) -> Array:
    """Return the nonconformity (n, C) of windows to each class, tile by tile, in threads.

    Scores above `within` (n, C) may be lower bounds, which exceed it too.
    """
    comparison, references, calibration, _ = templates
    start, end = motion.times[rows].T
    levels = templates.level_scores(motion, rows)
    logs, bars = np.empty(levels.shape), np.full(levels.shape, np.inf)
    if within is not None:  # of both parts of a score, the levels are known: what they leave is how far the path may be
        possible = levels <= within
        paths = np.sqrt(np.where(possible, within**2 - levels**2, 0.0))
        bars[possible] = np.exp(-0.5 * (paths * calibration.scales) ** 2)[possible]

    def fill(begin: int, first: int, last: int) -> None:
        tile = slice(begin + first, begin + last)

        def compare(part: slice, compared: Compared) -> None:
            own = slice(tile.start + part.start, tile.start + part.stop)
            described, known = compared.described, references.described
            logs[own] = (
                compared.nearest
                if within is None
                else nearest_above(comparison.similarity, described, known, references.first, bars[own])
            )

        demos = Demonstrations.of_movements(resampled(motion, start[tile], end[tile]))
        for_compared(comparison, references, demos, compare)

    for begin in range(0, len(rows), _TILE):
        n = min(_TILE, len(rows) - begin)
        for_tiles(partial(fill, begin), n, _AT_ONCE)
        if progress is not None:
            progress((begin + n) / len(rows))
    return np.hypot(calibration.scores(logs), levels)


def size_and_slowness(paths: Array) -> tuple[Array, Array]:
    """Return log sizes of paths (n, d, T), and the shares of their steps that are far below the mean step."""
    if use_compiled(_OPERATIONS_PER_SAMPLE * paths.size):
        size, slow = np.empty((2, len(paths)))
        samples = np.ascontiguousarray(paths.transpose(0, 2, 1))
        compiled_module("kineme.recognition._windows").fill_size_and_slowness(samples, _RESTING, size, slow)
        return np.log(np.maximum(size, np.finfo(float).tiny)), slow
    size = np.sqrt(paths.var(axis=2).sum(axis=1))
    steps = np.linalg.norm(np.diff(paths, axis=2), axis=1)
    slow = (steps <= _RESTING * steps.mean(axis=1, keepdims=True)).mean(axis=1)
    return np.log(np.maximum(size, np.finfo(float).tiny)), slow


def rarity_weights(distances: Array) -> Array:
    """Return weights (C,) of scores, larger for classes that much of the recording is near to.

    Simple shapes are part of many movements: of a sphere drawn in space, a half is a circle. Scores of class c are
    divided by ``m_c^0.3``, with m_c the distance that a fifth of the windows is within, over the geometric mean of all
    classes.

    `distances` (n, C): of windows to the nearest demonstration of each class.
    """
    common = np.log(np.maximum(np.quantile(distances, _COMMON, axis=0), LEAST))
    return np.asarray(np.exp(_RARITY * (common.mean() - common)))


class Durations(NamedTuple):
    """Shortest and longest that a movement may take [s]."""

    shortest: float
    longest: float


@dataclass(frozen=True, eq=False)
class Windows:
    """n windows of one recording; they overlap."""

    motion: Motion  # of the whole recording
    bouts: Rows  # (b, 2), stretches of motion between rests: first sample, and one past the last
    rows: Rows  # (n, 2), first and last sample of each window

    def __len__(self) -> int:
        return len(self.rows)


class Surroundings(NamedTuple):
    """Ends of n windows and rests in them, each of shape (n,)."""

    edge_speeds: Array  # sum of the speeds at both ends, each in peak speeds and at most 1
    far_from_rest: Array  # sum over both ends of the distance to the nearest rest, each at most 1
    at_rest: Array  # share of the duration
    rests_inside: Array  # how many rests a window spans


def candidate_windows(recording: Trajectory, durations: Durations | None, most_bouts: int) -> Windows:
    """Return windows between boundaries of a recording.

    Boundaries are the ends of rests, minima of speed, and, where these are far apart, samples at even times. Windows up
    to twice as long as the shortest have boundaries of their own, those up to four times as long have boundaries twice
    as far apart, and so on, so that the number of windows grows with the logarithm of the range of durations only.

    `durations`: none where they are unknown: from a quarter of the typical stretch between rests to four times it;
    `most_bouts`: most stretches between rests that a window may span.
    """
    motion = observe(recording, RESOLUTION)
    rest = Rest()
    bouts = moving(motion, rest.pieces(motion), rest.resolution)
    if not len(bouts):
        return Windows(motion, bouts, bouts)
    t = motion.times
    typical = float(np.median(t[bouts[:, 1] - 1] - t[bouts[:, 0]]))  # stretch between rests
    least, most = durations or Durations(0.25 * typical, 4.0 * typical)
    least = max(least, MIN_SAMPLES * float(np.median(np.diff(t))))
    most = min(max(most, least), float(t[-1] - t[0]))
    rows = [np.empty((0, 2), dtype=np.intp)]
    n_levels = max(1, math.ceil(math.log2(most / least) - 1e-9))
    for level in range(n_levels):
        shortest = least * 2.0**level
        longest = 2.0 * shortest if level < n_levels - 1 else most * (1.0 + 1e-9)
        rows.append(_between(_boundaries(motion, bouts, _SHARE * shortest), t, shortest, longest))
    windows = np.unique(np.concatenate(rows), axis=0)
    around = surroundings(motion, bouts, windows)
    return Windows(
        motion, bouts, windows[(around.at_rest <= _MOST_REST) & (around.rests_inside < min(most_bouts, len(bouts)))]
    )


def _boundaries(motion: Motion, bouts: Rows, gap: float) -> Rows:
    """Return samples about `gap` seconds apart, at ends of rests and minima of speed where there are any nearby."""
    from scipy.signal import find_peaks

    t = motion.times
    slowness = -np.log(motion.speed + max(_FLOOR * motion.peak, 2.0 * motion.noise))
    minima = find_peaks(slowness, prominence=_DEPTH)[0]
    inside = np.zeros(len(t), dtype=bool)
    for start, stop in bouts.tolist():
        inside[start:stop] = True
    ends = np.unique(np.concatenate(([0], bouts[:, 0], bouts[:, 1] - 1, [len(t) - 1])))
    minima = minima[inside[minima]]
    chosen = _apart(t, ends, minima[np.argsort(-slowness[minima], kind="stable")], 0.5 * gap)
    wanted = np.diff(t[chosen]) / gap
    path = np.append(0.0, np.cumsum(0.5 * np.diff(t) * (motion.speed[1:] + motion.speed[:-1])))
    resting = ~inside[(chosen[:-1] + chosen[1:]) // 2]
    drift = np.diff(path[chosen]) / (_DRIFT * motion.peak * gap)
    wanted = np.where(resting, np.minimum(wanted, np.floor(drift)), wanted)
    parts = np.clip(np.round(wanted), 1, np.diff(chosen)).astype(np.intp)
    which = np.repeat(np.arange(len(parts)), parts)
    share = (np.arange(len(which)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[which]
    even = t[chosen[which]] + share * np.diff(t[chosen])[which]
    return np.unique(np.append(np.minimum(np.searchsorted(t, even), len(t) - 1), len(t) - 1))


def _apart(t: Array, always: Rows, ordered: Rows, distance: float) -> Rows:
    """Choose samples: all of `always`, and those of the others, in order, that are no nearer than `distance` [s]."""
    taken = np.zeros(len(t), dtype=bool)
    taken[always] = True
    for i in ordered.tolist():
        low, high = np.searchsorted(t, (t[i] - distance, t[i] + distance), side="right")
        if not taken[low:high].any():
            taken[i] = True
    return np.flatnonzero(taken)


def _between(boundaries: Rows, t: Array, shortest: float, longest: float) -> Rows:
    """Return all pairs of boundaries whose distance is from `shortest` to below `longest`, rows (n, 2)."""
    at = t[boundaries]
    low, high = np.searchsorted(at, at + shortest), np.searchsorted(at, at + longest)
    count = np.maximum(high - low, 0)
    first = np.repeat(np.arange(len(at)), count)
    last = np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count) + low[first]
    rows = boundaries[np.column_stack((first, last))]
    return rows[rows[:, 1] - rows[:, 0] >= MIN_SAMPLES - 1]


def surroundings(motion: Motion, bouts: Rows, rows: Rows, reach: float = 0.15) -> Surroundings:
    """Measure the ends of windows, and the rests between; ends are far from a rest by `reach` of the duration."""
    t = motion.times
    speeds = np.minimum(motion.speed / motion.peak, 1.0)
    still = np.append(0.0, np.cumsum(np.diff(t) * (speeds[1:] <= max(_SLOW, 2.0 * motion.noise / motion.peak))))
    lasting = t[rows[:, 1]] - t[rows[:, 0]]
    ends = np.sort(np.concatenate((t[bouts[:, 0]], t[bouts[:, 1] - 1], [-np.inf, np.inf])))
    times = t[rows]
    after = np.searchsorted(ends, times)
    distance = np.minimum(ends[after] - times, times - ends[after - 1])
    spanned = np.searchsorted(bouts[:, 0], rows[:, 1]) - np.searchsorted(bouts[:, 1], rows[:, 0] + 1)
    return Surroundings(
        speeds[rows].sum(axis=1),
        np.minimum(distance / (reach * lasting[:, None]), 1.0).sum(axis=1),
        (still[rows[:, 1]] - still[rows[:, 0]]) / lasting,
        np.maximum(spanned - 1, 0).astype(np.float64),
    )


def resampled(motion: Motion, start: Array, end: Array) -> Movements:
    """Return the smoothed recording from `start` to `end` (n,) [s], each at `N_POINTS` even times."""
    t, x = motion.times, motion.positions
    share = np.linspace(0.0, 1.0, N_POINTS)
    offsets: NDArray[np.intp] = np.arange(len(start) + 1) * N_POINTS
    if use_compiled(_OPERATIONS_PER_SAMPLE * len(start) * N_POINTS * x.shape[1]):
        windows = np.empty((len(start), N_POINTS, x.shape[1]))
        fill = compiled_module("kineme.recognition._windows").fill_windows
        fill(*map(np.ascontiguousarray, (t, x, start, end)), share, windows)
        return Movements(windows.reshape(-1, x.shape[1]), offsets, np.asarray(end - start))
    at = (start[:, None] + (end - start)[:, None] * share).ravel()
    below = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    weight = ((at - t[below]) / (t[below + 1] - t[below]))[:, None]
    positions = x[below] * (1.0 - weight) + x[below + 1] * weight
    return Movements(np.ascontiguousarray(positions), offsets, np.asarray(end - start))
