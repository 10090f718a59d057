"""Edges of the movements found in a recording: where exactly they begin and end, and how sure that is.

Windows end at samples some hundredths of a movement apart, and what is compared, the path, hardly depends on a rest at
their ends. When an arm at work pauses and when it moves on is plain from its speed, once windows say what it does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kineme.movements.segmentation.table import Motion, Rows, moving_bouts, weighted_quantile
from kineme.recognition.compared_windows import MIN_SAMPLES
from kineme.recognition.levels import Levels, openings
from kineme.validation import Array

_REST = 0.05  # share of the peak speed below which an arm rests
_CLOSING = 1.875  # least peak speed of a gripper, in its range [1/s]
_FINGERS = 0.06  # standard deviation of the Gaussian for steps of a gripper [s]: they are commands, fingers follow
_LATE = 0.1  # longest extrapolation of an onset, as a share of the bout
_BLUR = 0.25  # time that smoothing moves a crossing outward, in cycles at the cutoff
_NEAR = 0.2  # distance of an edge from the pause that it is moved to, at most [s]
_SHORT = 0.15  # a shorter pause is one boundary [s]
_SLIVER = 0.5  # shorter motion that nothing parts from a movement belongs to it [s]
_SLOW = 0.1  # share of the peak speed below which a movement may begin or end
_SHARE = 0.12  # distance of the edges of windows, in durations of the shortest windows between them
#: Half of the 95 % interval where edges are those of windows, in durations. Of gestures that people make in the air,
#: 93 to 99 of 100 edges are that near to where the gesture was cut; of the shapes of LASA all.
_BY_WINDOWS = 0.18


def placed(
    motion: Motion, rows: Rows, known: NDArray[np.bool_], levels: Levels | None, longest: float | None
) -> tuple[Rows, Array]:
    """Return movements, first sample and one past the last (n, 2), each at its place, and the uncertainty (n,) [s].

    Those of an arm at work, which has `levels` of its grippers, are `settled`; there are fewer if some then are part of
    others. `known` (n,): movements of known classes; `longest`: that of the demonstrations [s], None without time
    stamps. The uncertainty is half of the 95 % interval of start and end, of the less certain of both.
    """
    if levels is None or longest is None:
        lasting = motion.times[rows[:, 1] - 1] - motion.times[rows[:, 0]]
        return rows, _BY_WINDOWS * (lasting if longest is None else np.minimum(lasting, longest))
    t, arm, tools = motion.times, *speeds(motion, levels)
    speed, noise = np.hypot(arm, tools), motion.noise / motion.peak
    rests = pauses(t, speed, max(_REST, 2.0 * noise), _BLUR / motion.cutoff)
    rows = settled(t, arm, rests, rows, known)
    rows = rows[rows[:, 1] > 0]
    return rows, _by_speed(t, speed, rests, rows, longest, 1.0 / motion.cutoff)


def speeds(motion: Motion, levels: Levels) -> tuple[Array, Array]:
    """Return the speeds of an arm and of its grippers (T,), each as a share of its own peak.

    So an opening in percent does not hide joints in radians. Nine tenths of a path are covered below its peak speed;
    that of grippers is at least 1.875 of their range in the demonstrations in a second: what least jerk over it takes
    (they may not move at all).
    """
    n = motion.positions.shape[1]
    arm = np.delete(motion.positions, [k for k in levels.columns if k < n], axis=1)
    grippers = openings(motion, levels.columns, _FINGERS)
    ways, least = (arm, grippers / levels.ranges), (np.finfo(float).tiny, _CLOSING)
    rates = [np.linalg.norm(np.gradient(way, motion.times, axis=0), axis=1) for way in ways]
    shares = [rate / max(weighted_quantile(rate, rate, 0.9), slow) for rate, slow in zip(rates, least, strict=True)]
    return shares[0], shares[1]


def pauses(t: Array, speed: Array, low: float, blur: float) -> Array:
    """Return rests between bouts of motion, from when to when (p, 2) [s]; before the first and after the last too.

    Bouts are faster than `low`, somewhere twice as fast. Speed grows at first about as the square of the time since the
    onset, which so lies as far before the crossing of a level as that lies before the crossing of four times the level;
    smoothing moves crossings outward, by `blur` [s].
    """
    bouts = moving_bouts(speed, low, 2.0 * low)
    if not len(bouts):
        return np.array([[t[0], t[-1]]])
    owner = np.searchsorted(bouts[:, 0], np.arange(len(t)), side="right") - 1
    peaks = np.maximum.reduceat(np.append(speed, 0.0), bouts.ravel())[::2]
    higher = np.flatnonzero((owner >= 0) & (speed >= np.minimum(4.0 * low, 0.9 * peaks)[owner]))
    first, last = bouts[:, 0], bouts[:, 1] - 1
    longest = _LATE * (t[last] - t[first])
    begin = t[first] - np.minimum(t[higher[np.searchsorted(higher, first)]] - t[first], longest) + blur
    end = t[last] + np.minimum(t[last] - t[higher[np.searchsorted(higher, last, side="right") - 1]], longest) - blur
    rests = np.column_stack((np.append(t[0], end), np.append(begin, t[-1])))
    return np.asarray(rests[rests[:, 1] > rests[:, 0]])


def settled(t: Array, arm: Array, rests: Array, rows: Rows, known: NDArray[np.bool_]) -> Rows:
    """Return movements of an arm at work, first sample and one past the last (n, 2), with edges at rests (p, 2) [s].

    Each edge is moved to the rest within 0.2 s, if there is one on its side of the middle: a movement begins where the
    rest ends. Between two that are less than 0.15 s apart is one boundary. Of motion that is not `known` (n,), less
    than half a second beside a known movement, from which no rest parts it, belongs to that, if the arm moves: `arm`
    (T,) is its speed in shares of the peak. Such rows, and unknown ones that are too short, then have no samples.
    """
    order = np.argsort(rows[:, 0], kind="stable")
    start, end = t[rows[order] - (0, 1)].T
    middle = 0.5 * (start + end)
    before = rests[_nearest(rests, start)]
    near = (_distance(before, start) <= _NEAR) & (before[:, 1] < middle)
    start = np.where(near, before[:, 1], start)
    after = rests[_nearest(rests, end)]
    near = (_distance(after, end) <= _NEAR) & (after[:, 0] > middle)
    end = np.where(near, after[:, 0], end)
    joint = start[1:] - end[:-1] < _SHORT
    end[:-1][joint] = start[1:][joint] = 0.5 * (start[1:] + end[:-1])[joint]
    edges = np.column_stack((start, end))
    _join_slivers(t, arm, edges, known[order], joint)
    moved = np.empty_like(rows)
    half = 0.5 * float(np.median(np.diff(t)))
    moved[order] = np.searchsorted(t, edges - half) + np.array([0, 1])
    few = moved[:, 1] - moved[:, 0] < MIN_SAMPLES
    moved[few] = np.where(known[few, None], rows[few], 0)
    return moved


def _by_speed(t: Array, speed: Array, rests: Array, rows: Rows, longest: float, least: float) -> Array:
    """Return half of the 95 % interval (n,) [s] of the edges of movements of an arm at work, rows (n, 2).

    It is the time that the speed stays below a tenth of its peak beside the edge: within the movement where a rest ends
    there, else on either side. It is at least a cycle at the cutoff of the smoothing, `least`, and at most 0.12 of the
    duration, the distance of the edges of windows; this where the speed is higher, so that no event says where to cut.
    """
    ends, slow = rows - (0, 1), speed <= _SLOW
    fast = np.concatenate(([-np.inf], t[~slow], [np.inf]))
    edges = t[ends]
    ahead = np.searchsorted(fast, edges)
    later, before = fast[ahead] - edges, edges - fast[ahead - 1]
    inward = np.column_stack((later[:, 0], before[:, 1]))
    step = float(np.median(np.diff(t)))
    resting = np.column_stack([_distance(rests[_nearest(rests, edge)], edge) <= step for edge in edges.T])
    most = _SHARE * np.minimum(edges[:, 1] - edges[:, 0], longest)[:, None]
    lasting = np.where(slow[ends], np.minimum(np.where(resting, inward, np.maximum(later, before)), most), most)
    return np.asarray(np.maximum(lasting, least).max(axis=1))


def _nearest(rests: Array, at: Array) -> NDArray[np.intp]:
    """Return which of the rests (p, 2) [s] is nearest to each time."""
    after = np.searchsorted(rests[:, 0], at, side="right").clip(1, len(rests) - 1) if len(rests) > 1 else 0 * at
    after = np.asarray(after, dtype=np.intp)
    before = np.maximum(after - 1, 0)
    return np.where(_distance(rests[before], at) <= _distance(rests[after], at), before, after)


def _distance(rests: Array, at: Array) -> Array:
    """Return how far each time (n,) is from a rest (n, 2), 0 within it [s]."""
    return np.asarray(np.maximum(np.maximum(rests[:, 0] - at, at - rests[:, 1]), 0.0))


def _join_slivers(t: Array, arm: Array, edges: Array, known: NDArray[np.bool_], joint: NDArray[np.bool_]) -> None:
    """Give short unknown motion of the arm to the known movement beside it, in `edges` (n, 2); it then has no time.

    `joint` (n - 1,): whether no rest parts a movement from the next one. Of two known ones beside it, each gets the
    part up to the slowest sample.
    """
    ahead = np.append(False, known[:-1] & joint)
    behind = np.append(known[1:] & joint, False)
    short = ~known & (edges[:, 1] - edges[:, 0] < _SLIVER) & (ahead | behind)
    for i in np.flatnonzero(short).tolist():
        start, end = edges[i]
        first, stop = np.searchsorted(t, edges[i])
        if stop <= first or arm[first:stop].max() < _SLOW:
            continue
        cut = end if not behind[i] else start if not ahead[i] else t[first + int(arm[first:stop].argmin())]
        edges[i] = cut
        if ahead[i]:
            edges[i - 1, 1] = cut
        if behind[i]:
            edges[i + 1, 0] = cut
