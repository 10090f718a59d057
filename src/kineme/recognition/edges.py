"""Edges of the movements found in a recording: where exactly an arm at work begins and ends them, and how sure that is.

Windows end at samples some hundredths of a movement apart, and what is compared, paths, hardly depends on a rest at
their ends. When the arm pauses and when it moves on is plain from its speed, once the windows say what the movements
are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kineme.movements.segmentation.table import Motion, Rows, moving_bouts
from kineme.recognition.compared_windows import MIN_SAMPLES
from kineme.validation import Array

_REST = 0.05  # share of the peak speed below which an arm rests
_LATE = 0.1  # longest extrapolation of an onset, as a share of the bout
_BLUR = 0.25  # time that smoothing moves a crossing outward, in cycles at the cutoff
_NEAR = 0.2  # distance of an edge from the pause that it is moved to, at most [s]
_SHORT = 0.15  # a shorter pause is one boundary, a shorter movement none [s]
_SLIVER = 0.5  # shorter motion that nothing parts from a movement belongs to it [s]
_SLOW = 0.1  # share of the peak speed below which a movement may begin or end
_SHARE = 0.12  # distance of the edges of windows, in durations of the shortest windows between them


def pauses(motion: Motion) -> Array:
    """Return rests between bouts of motion, from when to when (p, 2) [s]; before the first and after the last too.

    Speed grows at first about as the square of the time since the onset, which so lies as far before the crossing of a
    level as that lies before the crossing of four times the level; smoothing moves crossings outward.
    """
    t, speed = motion.times, motion.speed
    low = max(_REST * motion.peak, 2.0 * motion.noise)
    bouts = moving_bouts(speed, low, 2.0 * low)
    if not len(bouts):
        return np.array([[t[0], t[-1]]])
    owner = np.searchsorted(bouts[:, 0], np.arange(len(t)), side="right") - 1
    peaks = np.maximum.reduceat(np.append(speed, 0.0), bouts.ravel())[::2]
    higher = np.flatnonzero((owner >= 0) & (speed >= np.minimum(4.0 * low, 0.9 * peaks)[owner]))
    first, last = bouts[:, 0], bouts[:, 1] - 1
    longest, blur = _LATE * (t[last] - t[first]), _BLUR / motion.cutoff
    begin = t[first] - np.minimum(t[higher[np.searchsorted(higher, first)]] - t[first], longest) + blur
    end = t[last] + np.minimum(t[last] - t[higher[np.searchsorted(higher, last, side="right") - 1]], longest) - blur
    rests = np.column_stack((np.append(t[0], end), np.append(begin, t[-1])))
    return np.asarray(rests[rests[:, 1] > rests[:, 0]])


def settled(motion: Motion, rests: Array, rows: Rows, known: NDArray[np.bool_], tools: Rows) -> Rows:
    """Return movements of an arm at work, first sample and one past the last (n, 2), with edges at pauses.

    Each edge is moved to the pause within 0.2 s, if there is one: a movement begins where the pause ends. Between two
    that are less than 0.15 s apart is one boundary. Of motion that is not `known` (n,), less than half a second beside
    a known movement, from which no pause parts it, belongs to that, unless only tools move: coordinates `tools` (k,),
    such as grippers; such rows then have no samples.
    """
    order = np.argsort(rows[:, 0], kind="stable")
    t, known = motion.times, known[order]
    start, end = t[rows[order] - (0, 1)].T
    begin = rests[_nearest(rests, start)]
    fits = (_distance(begin, start) <= _NEAR) & (begin[:, 1] < end - _SHORT)
    start = np.where(fits, begin[:, 1], start)
    stop = rests[_nearest(rests, end)]
    fits = (_distance(stop, end) <= _NEAR) & (stop[:, 0] > start + _SHORT)
    end = np.where(fits, stop[:, 0], end)
    joint = start[1:] - end[:-1] < _SHORT
    end[:-1][joint] = start[1:][joint] = 0.5 * (start[1:] + end[:-1])[joint]
    start, end = np.maximum.accumulate(np.column_stack((start, end)).ravel()).reshape(-1, 2).T.copy()
    _join_slivers(motion, start, end, known, joint, tools)
    edges = np.empty_like(rows)
    edges[order] = np.searchsorted(t, np.column_stack((start, end)) - 0.5 * float(np.median(np.diff(t)))) + (0, 1)
    few = edges[:, 1] - edges[:, 0] < MIN_SAMPLES
    edges[few] = np.where(known[np.argsort(order)][few, None], rows[few], 0)
    return edges


def uncertainties(motion: Motion, rests: Array, rows: Rows) -> Array:
    """Return half of the 95 % interval (n,) [s] of the edges of movements, rows (n, 2): of the less certain of both.

    It is the time that the speed stays below a tenth of its peak beside the edge: within the movement where a rest ends
    there, else on either side. It is at least a cycle at the cutoff of the smoothing, and at most 0.12 of the duration,
    the distance of the edges of windows; this where the speed is higher, so that no event says where to cut.
    """
    t = motion.times
    fast = np.concatenate(([-np.inf], t[motion.speed > _SLOW * motion.peak], [np.inf]))
    edges = t[rows - (0, 1)]
    after = np.searchsorted(fast, edges)
    later, before = fast[after] - edges, edges - fast[after - 1]
    step = float(np.median(np.diff(t)))
    resting = np.column_stack([_distance(rests[_nearest(rests, edge)], edge) <= step for edge in edges.T])
    inward = np.column_stack((later[:, 0], before[:, 1]))
    slow = np.where(resting, inward, np.maximum(later, before))
    most = _SHARE * (edges[:, 1] - edges[:, 0])[:, None]
    slow = np.where(motion.speed[rows - (0, 1)] > _SLOW * motion.peak, most, np.minimum(slow, most))
    return np.asarray(np.maximum(slow, 1.0 / motion.cutoff).max(axis=1))


def _nearest(rests: Array, at: Array) -> NDArray[np.intp]:
    """Return which of the rests (p, 2) [s] is nearest to each time."""
    after = np.searchsorted(rests[:, 0], at, side="right").clip(1, len(rests) - 1) if len(rests) > 1 else 0 * at
    after = np.asarray(after, dtype=np.intp)
    before = np.maximum(after - 1, 0)
    return np.where(_distance(rests[before], at) <= _distance(rests[after], at), before, after)


def _distance(rests: Array, at: Array) -> Array:
    """Return how far each time (n,) is from a rest (n, 2), 0 within it [s]."""
    return np.asarray(np.maximum(np.maximum(rests[:, 0] - at, at - rests[:, 1]), 0.0))


def _join_slivers(
    motion: Motion, start: Array, end: Array, known: NDArray[np.bool_], joint: NDArray[np.bool_], tools: Rows
) -> None:
    """Give short unknown motion of the arm to the known movement beside it, in place; it then lasts no time."""
    arm = np.delete(motion.positions, tools, axis=1)
    t = motion.times
    speed = np.linalg.norm(np.gradient(arm, t, axis=0), axis=1)
    for i in np.flatnonzero(~known & (end - start < _SLIVER)).tolist():
        first, last = np.searchsorted(t, (start[i], end[i]))
        if last <= first or speed[first:last].max() < _SLOW * motion.peak:
            continue
        before, after = i > 0 and known[i - 1] and joint[i - 1], i + 1 < len(known) and known[i + 1] and joint[i]
        if before or after:
            cut = end[i] if not after else start[i] if not before else t[first + int(speed[first:last].argmin())]
            start[i] = end[i] = cut
            if before:
                end[i - 1] = cut
            if after:
                start[i + 1] = cut
