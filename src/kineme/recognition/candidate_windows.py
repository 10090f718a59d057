"""Candidate windows: the stretches of a long recording that may be one movement."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from kineme.movements.segmentation.motion import Motion, Rows, observe
from kineme.movements.segmentation.segment import moving
from kineme.movements.segmentation.table import Rest
from kineme.movements.trajectories.movements import Movements
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.validation import Array

MIN_SAMPLES = 8  # of a window
N_POINTS = 64  # even samples by which a window is described
RESOLUTION = 0.04  # share of the peak speed that must be distinguished from rest
_SHARE = 0.12  # distance of boundaries, in durations of the shortest windows between them
_DEPTH = 0.2  # prominence, in the logarithm of speed, of a minimum that is a boundary
_FLOOR = 0.02  # of the peak speed: lower speeds count as equally slow
_SLOW = 0.02  # share of the peak speed below which a sample counts as at rest
_MOST_REST = 0.6  # share of a window at rest
_OPERATIONS_PER_SAMPLE = 8  # of a window and dimension
_DRIFT = 0.2  # share of the peak speed: a drift that covers less path between boundaries gets none


class Durations(NamedTuple):
    """Shortest and longest that a movement may take [s]."""

    shortest: float
    longest: float


@dataclass(frozen=True, eq=False)
class Windows:
    """n windows of one recording; they overlap.

    Attributes
    ----------
    motion : Motion
        Of the whole recording.
    bouts : ndarray of shape (b, 2)
        Stretches of motion between rests: first sample, and one past the last.
    rows : ndarray of shape (n, 2)
        First and last sample of each window.
    """

    motion: Motion
    bouts: Rows
    rows: Rows

    def __len__(self) -> int:
        return len(self.rows)


class Surroundings(NamedTuple):
    """What the ends of n windows and the rests in them tell, each of shape (n,).

    Attributes
    ----------
    edge_speeds : ndarray
        Sum of the speeds at both ends, each in peak speeds and at most 1.
    far_from_rest : ndarray
        Sum over both ends of the distance to the nearest rest, each at most 1.
    at_rest : ndarray
        Share of the duration.
    rests_inside : ndarray
        How many rests a window spans.
    """

    edge_speeds: Array
    far_from_rest: Array
    at_rest: Array
    rests_inside: Array


def candidate_windows(recording: Trajectory, durations: Durations | None, most_bouts: int) -> Windows:
    """Windows between boundaries of a recording.

    Boundaries are the ends of rests, minima of speed, and, where these are far apart, samples at even times. Windows up
    to twice as long as the shortest have boundaries of their own, those up to four times as long have boundaries twice
    as far apart, and so on, so that the number of windows grows with the logarithm of the range of durations only.

    Parameters
    ----------
    recording : Trajectory
    durations : Durations or None
        None where they are unknown: from a quarter of the typical stretch between rests to four times it.
    most_bouts : int
        Most stretches between rests that a window may span.
    """
    motion = observe(recording, RESOLUTION)
    rest = Rest()
    bouts = moving(motion, rest.pieces(motion), rest.resolution)
    if not len(bouts):
        return Windows(motion, bouts, bouts)
    t = motion.times
    least, most = durations or _unknown_durations(motion, bouts)
    least = max(least, MIN_SAMPLES * float(np.median(np.diff(t))))
    most = min(max(most, least), float(t[-1] - t[0]))
    rows = [np.empty((0, 2), dtype=np.intp)]
    n_levels = max(1, math.ceil(math.log2(most / least) - 1e-9))
    for level in range(n_levels):
        shortest = least * 2.0**level
        longest = 2.0 * shortest if level < n_levels - 1 else most * (1.0 + 1e-9)
        rows.append(_between(_boundaries(motion, bouts, _SHARE * shortest), t, shortest, longest))
    found = np.unique(np.concatenate(rows), axis=0)
    around = surroundings(motion, bouts, found)
    return Windows(
        motion, bouts, found[(around.at_rest <= _MOST_REST) & (around.rests_inside < min(most_bouts, len(bouts)))]
    )


def _unknown_durations(motion: Motion, bouts: Rows) -> Durations:
    """From the stretches between rests."""
    typical = float(np.median(motion.times[bouts[:, 1] - 1] - motion.times[bouts[:, 0]]))
    return Durations(0.25 * typical, 4.0 * typical)


def _boundaries(motion: Motion, bouts: Rows, gap: float) -> Rows:
    """Samples about `gap` seconds apart, at ends of rests and minima of speed where there are any nearby."""
    t = motion.times
    slowness = -np.log(motion.speed + max(_FLOOR * motion.peak, 2.0 * motion.noise))
    minima = find_peaks(slowness, prominence=_DEPTH)[0]
    inside = np.zeros(len(t), dtype=bool)
    for start, stop in bouts.tolist():
        inside[start:stop] = True
    ends = np.unique(np.concatenate(([0], bouts[:, 0], bouts[:, 1] - 1, [len(t) - 1])))
    minima = minima[inside[minima]]
    kept = _apart(t, ends, minima[np.argsort(-slowness[minima], kind="stable")], 0.5 * gap)
    wanted = np.diff(t[kept]) / gap
    path = np.append(0.0, np.cumsum(0.5 * np.diff(t) * (motion.speed[1:] + motion.speed[:-1])))
    resting = ~inside[(kept[:-1] + kept[1:]) // 2]
    drift = np.diff(path[kept]) / (_DRIFT * motion.peak * gap)
    wanted = np.where(resting, np.minimum(wanted, np.floor(drift)), wanted)
    parts = np.clip(np.round(wanted), 1, np.diff(kept)).astype(np.intp)
    which = np.repeat(np.arange(len(parts)), parts)
    share = (np.arange(len(which)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[which]
    even = t[kept[which]] + share * np.diff(t[kept])[which]
    return np.unique(np.append(np.minimum(np.searchsorted(t, even), len(t) - 1), len(t) - 1))


def _apart(t: Array, always: Rows, ordered: Rows, distance: float) -> Rows:
    """Samples that are always taken, and those of the others, in order, that are no nearer than `distance` [s]."""
    taken = np.zeros(len(t), dtype=bool)
    taken[always] = True
    for i in ordered.tolist():
        low, high = np.searchsorted(t, (t[i] - distance, t[i] + distance), side="right")
        if not taken[low:high].any():
            taken[i] = True
    return np.flatnonzero(taken)


def _between(boundaries: Rows, t: Array, shortest: float, longest: float) -> Rows:
    """All pairs of boundaries whose distance is from `shortest` to below `longest`, rows (n, 2)."""
    at = t[boundaries]
    low, high = np.searchsorted(at, at + shortest), np.searchsorted(at, at + longest)
    count = np.maximum(high - low, 0)
    first = np.repeat(np.arange(len(at)), count)
    last = np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count) + low[first]
    rows = boundaries[np.column_stack((first, last))]
    return rows[rows[:, 1] - rows[:, 0] >= MIN_SAMPLES - 1]


def surroundings(motion: Motion, bouts: Rows, rows: Rows, reach: float = 0.15) -> Surroundings:
    """What is at the ends of windows, and between them; ends are far from a rest by `reach` of the duration."""
    t = motion.times
    speeds = np.minimum(motion.speed / motion.peak, 1.0)
    still = np.append(0.0, np.cumsum(np.diff(t) * (speeds[1:] <= _SLOW)))
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
    """The smoothed recording from `start` to `end` (n,) [s], each at `N_POINTS` even times."""
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
