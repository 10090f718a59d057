"""Boundaries between the movements of an arm at work, from several cues at once, each with its uncertainty.

An arm that a person leads hardly rests between two movements. What tells them apart is spread over several columns: the
arm slows down, turns to another direction, the gripper begins or ceases to close, a contact is made, an object begins
to move. Each such cue is a row of `CUES`: it finds events, their strength in units of the cue's own noise, and how
exactly it places them. Strengths add up to log odds, and dynamic programming chooses the boundaries.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, uniform_filter1d
from scipy.special import logsumexp

from kineme.errors import DataError
from kineme.movements.segmentation.table import moving_bouts, noise_variance, weighted_quantile
from kineme.movements.tables.time_stamps import words_of
from kineme.sampling import runs
from kineme.validation import Array, check_count, check_number

#: Role of a column -> words of its name, the first role that fits; columns of none of them are the arm's own.
ROLES: dict[str, frozenset[str]] = {
    "aside": frozenset({"vel", "velocity", "velocities", "qvel", "effort", "torque", "torques", "acc", "current"}),
    "contact": frozenset({"contact", "contacts", "touch", "tactile", "force", "forces", "pressure", "wrench"}),
    "gripper": frozenset(
        {"gripper", "grippers", "finger", "fingers", "grip", "jaw", "jaws", "claw", "suction", "vacuum"}
    ),
    "object": frozenset({"object", "objects", "obj", "cube", "block", "target", "environment", "env"}),
}

_RATE = 50.0  # [1/s], at most: what people and robots do at work has little above 10 Hz
_SMOOTHING = 0.06  # standard deviation of the Gaussian that velocities are taken with [s]
_FLOOR, _MOST = 0.05, 0.15  # of the peak speed: lower speeds count as equally slow, and where a hand trembles
_SLOWEST, _HAND = 0.05, 2.5  # share of samples that are slowest; times their speed is trembling
_REST = 1.0  # of the floor of the speed: slower is rest
_PAUSE = 0.2  # a longer rest has two ends [s]
_SHALLOW = 0.3  # prominence in the logarithm of speed [nats] of a minimum that counts, at least
_WINDOW = 0.2  # over which directions before and after are taken [s]
_BACK = -0.8  # cosine between a stroke and the one before it, at most
_AS_LONG = 0.3  # the shorter of two strokes by the longer, at least
_GRIPPED = 0.2  # of a gripper's range, or of the largest range: it moves
_STILL = 0.12  # extent of a rest, in shares of the extents of the joints, at most
_STEP = 6.0  # height of a step of a contact, in standard deviations of its noise, at least
_LARGEST = 3.0  # strength of one event, at most: a cue alone does not outweigh all others
_NARROW = 0.04  # standard deviation of the place of an event [s], at least
_NEIGHBORHOOD = 1.92  # chi-square of one degree of freedom at 95 %, halved: log odds within an interval


@dataclass(frozen=True)
class Work:
    """Parameters of cutting the work of an arm.

    - `penalty`: log odds that a boundary costs; the larger, the fewer there are.
    - `min_movement`: the shortest movement [s].
    - `strokes`: so many ways there and back without a rest between them, or more, are one movement, as wiping is.

    Raises `SpecificationError`: a parameter out of its range.
    """

    penalty: float = 1.5
    min_movement: float = 0.2
    strokes: int = 3

    def __post_init__(self) -> None:
        check_number("penalty", self.penalty)
        check_number("min_movement", self.min_movement, least=0.0)
        check_count("strokes", self.strokes, 2)


class Boundaries(NamedTuple):
    """Times between the movements of a recording, ascending, without its ends; all of shape (n,) or (n, 2)."""

    times: Array  # [s]
    confidence: Array  # probability that there is a boundary, within the interval
    intervals: Array  # from when to when it may lie [s], at 95 %
    evidence: Array  # (n, cues): strength of each row of `CUES` at the boundary


class Events(NamedTuple):
    """Events of a cue: when [s since the start], how strong in nats, and the standard deviation of when [s]."""

    times: Array
    strengths: Array
    widths: Array


class Observed(NamedTuple):
    """Columns of a recording on an even grid, by their roles."""

    times: Array  # (n,) since the start [s]
    rate: float  # [1/s]
    arm: Array  # (n, d) in shares of the extents
    velocity: Array  # (n, d) of the arm [1/s]
    speed: Array  # (n,) its norm
    floor: float  # of the speed: lower ones are noise, or equally slow
    others: dict[str, Array]  # role -> (n, k)


def roles_of(names: Sequence[str]) -> dict[str, NDArray[np.intp]]:
    """Return role -> its columns, by the words of their names; "arm" are all that have no other role."""
    roles = [next((role for role, words in ROLES.items() if words & {*words_of(name)}), "arm") for name in names]
    return {role: np.flatnonzero(np.array(roles) == role) for role in ("arm", *ROLES)}


def boundaries(times: Array, columns: Array, names: Sequence[str], how: Work | None = None) -> Boundaries:
    """Find the boundaries between movements in the columns (T, m) of a recording at increasing times (T,) [s].

    Events of all cues add up to log odds ``E(t) = sum strength exp(-(t - event)^2 / (2 width^2))``, of each cue the
    largest term, whose maxima are candidates c. Of all sets of candidates that are ``min_movement`` apart, the one with
    the largest sum of ``E(c) - penalty`` is found exactly, by dynamic programming over candidates. The confidence of a
    boundary is its probability among all these sets (forward-backward); its interval holds the times whose E is within
    1.92 of the maximum: a profile likelihood at 95 %. Boundaries within strokes there and back are left out.

    Columns that are NaN throughout are left aside; other NaN are interpolated. Raises `DataError`: times that do not
    increase, or another number of names than of columns.
    """
    how = Work() if how is None else how
    observed = observe_work(times, columns, names)
    if observed is None:
        return Boundaries(np.empty(0), np.empty(0), np.empty((0, 2)), np.empty((0, len(CUES))))
    t = observed.times
    evidence = np.stack([_on_grid(cue(observed), t) for cue in CUES.values()])  # (cues, n)
    total = evidence.sum(axis=0)
    inside = (t >= how.min_movement) & (t <= t[-1] - how.min_movement)
    peak = inside[1:-1] & (total[1:-1] > total[:-2]) & (total[1:-1] >= total[2:]) & (total[1:-1] > 0)
    candidates = np.flatnonzero(peak) + 1
    odds = total[candidates] - how.penalty
    chosen, probability = _best_subset(t[candidates], odds, how.min_movement)
    chosen = chosen[~_within_strokes(observed, candidates[chosen], how.strokes)]
    rows = candidates[chosen]
    spans = np.array([_interval(total, row) for row in rows.tolist()], dtype=np.intp).reshape(-1, 2)
    return Boundaries(times[0] + t[rows], probability[chosen], times[0] + t[spans], evidence[:, rows].T)


def at_rest(times: Array, columns: Array, names: Sequence[str], edges: Array) -> NDArray[np.bool_]:
    """Tell which of the n pieces between times `edges` (n + 1,) [s] are rests: neither the arm nor a gripper moves."""
    observed = observe_work(times, columns, names)
    if observed is None:
        return np.ones(len(edges) - 1, dtype=bool)
    rows = np.searchsorted(observed.times, edges - times[0] - 1e-9).clip(0, len(observed.times) - 1)
    gripper = observed.others["gripper"]
    moving = np.column_stack((observed.arm, gripper / np.maximum(np.ptp(gripper, axis=0), np.finfo(float).tiny)))
    starts = np.minimum(rows[:-1], rows[1:])
    highest, lowest = (reach.reduceat(moving, starts, axis=0) for reach in (np.maximum, np.minimum))
    return np.asarray(np.linalg.norm(highest - lowest, axis=1) < _STILL)


def interpolated(at: Array, times: Array, columns: Array) -> Array:
    """Return columns (T, d) at other times, (*at.shape, d): linear between `times` (T,) at which they are finite."""
    values = np.empty((*at.shape, columns.shape[1]))
    for k, column in enumerate(columns.T):
        valid = np.isfinite(column)
        values[..., k] = np.interp(at, times[valid], column[valid])
    return values


def observe_work(times: Array, columns: Array, names: Sequence[str]) -> Observed | None:
    """Return the columns on an even grid; None where nothing of the arm moves, or there are too few samples."""
    if columns.shape != (len(times), len(names)):
        raise DataError(
            f"expected columns of shape {(len(times), len(names))}, a row for each time and a name for each column, "
            f"got {columns.shape}"
        )
    if not (np.diff(times) > 0).all():
        raise DataError("expected times that increase, got some that repeat or go back; count samples by their rate")
    if len(times) < 8:
        return None
    duration = float(times[-1] - times[0])
    n = min(len(times), int(duration * _RATE) + 1)
    t = np.linspace(0.0, duration, n)
    usable: NDArray[np.bool_] = np.asarray(np.isfinite(columns).any(axis=0))
    even = np.zeros((n, len(names)))
    even[:, usable] = interpolated(t, times - times[0], columns[:, usable])
    roles = {role: own[usable[own]] for role, own in roles_of(names).items()}
    openings = np.ptp(even[:, roles["gripper"]], axis=0)  # of a hand that stays as it is, it is noise
    roles["gripper"] = roles["gripper"][openings > _GRIPPED * openings.max(initial=0.0)]
    rate = (n - 1) / duration
    arm = even[:, roles["arm"]]
    extents = np.ptp(arm, axis=0)
    if n < 8 or not extents.any():
        return None
    arm = arm / np.maximum(extents, 0.3 * extents.max())
    velocity = rate * gaussian_filter1d(arm, _SMOOTHING * rate, axis=0, order=1, mode="nearest")
    speed = np.linalg.norm(velocity, axis=1)
    # Of white noise of variance s^2 at rate r, a Gaussian derivative of width w passes s^2 / (4 sqrt(pi) w^3 r).
    noise = np.sqrt(noise_variance(arm) / (4.0 * np.sqrt(np.pi) * _SMOOTHING**3 * rate))
    fast = weighted_quantile(speed, speed, 0.9)
    trembling = min(_HAND * float(np.quantile(speed, _SLOWEST)), _MOST * fast)  # a hand's, which is no white noise
    floor = max(_FLOOR * fast, 2.0 * float(noise), trembling)
    return Observed(t, rate, arm, velocity, speed, floor, {role: even[:, own] for role, own in roles.items()})


def slow_moments(observed: Observed) -> Events:
    """Minima of speed, and both ends of rests: their prominence in the logarithm of speed, at most 3."""
    from scipy.signal import find_peaks, peak_widths  # it takes long to load, and most commands cut nothing

    slowness = -np.log(observed.speed + observed.floor)
    rows, properties = find_peaks(slowness, prominence=_SHALLOW)
    strengths = np.minimum(properties["prominences"], _LARGEST)
    widths = 0.25 * peak_widths(slowness, rows, rel_height=0.5)[0] / observed.rate
    rests = runs(observed.speed < _REST * observed.floor)
    rests = rests[rests[:, 1] - rests[:, 0] > _PAUSE * observed.rate]
    owner = np.searchsorted(rests[:, 0], rows, side="right") - 1
    resting = (owner >= 0) & (rows < rests[np.maximum(owner, 0), 1]) if len(rests) else np.zeros(len(rows), dtype=bool)
    deepest = np.zeros(len(rests))
    np.maximum.at(deepest, owner[resting], strengths[resting])
    ends = np.column_stack((rests[:, 0], rests[:, 1] - 1)).ravel()
    return Events(
        observed.times[np.append(rows[~resting], ends)],
        np.append(strengths[~resting], np.repeat(np.maximum(deepest, _LARGEST), 2)),
        np.append(widths[~resting], np.full(len(ends), _SMOOTHING)),
    )


def turns(observed: Observed) -> Events:
    """Moments at which the direction of the arm changes: ``1 - cos`` of the angle between before and after."""
    from scipy.signal import find_peaks

    reach = max(1, round(_WINDOW * observed.rate))
    mean = uniform_filter1d(observed.velocity, reach, axis=0, mode="nearest")
    half = reach // 2 + 1
    before, after = np.roll(mean, half, axis=0), np.roll(mean, -half, axis=0)
    before[:half], after[-half:] = mean[:1], mean[-1:]
    sizes = np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)
    least = np.maximum(observed.floor, sizes)  # what is slow has no direction
    turn = 1.0 - np.einsum("ij,ij->i", before, after) / (least[0] * least[1])
    turn[np.minimum(*sizes) < observed.floor] = 0.0
    rows = find_peaks(turn, height=_SHALLOW)[0]
    return Events(observed.times[rows], turn[rows], np.full(len(rows), 0.5 * _WINDOW))


def contact_events(observed: Observed) -> Events:
    """Steps of contacts and forces: their height by the standard deviation of noise, from 6 on."""
    from scipy.signal import find_peaks

    several = [np.empty((0, 2))]
    for column in observed.others["contact"].T:
        step = np.abs(gaussian_filter1d(column, _SMOOTHING * observed.rate, order=1, mode="nearest"))
        noise = max(1.4826 * float(np.median(step)), 0.05 * float(step.max()))
        rows = find_peaks(step, height=max(_STEP * noise, 0.3 * float(step.max())))[0] if noise > 0 else []
        several.append(np.column_stack((observed.times[rows], np.full(len(rows), 1.0))))
    times, strengths = np.concatenate(several).T
    return Events(times, strengths, np.full(len(times), _SMOOTHING))


def _begin_and_end(observed: Observed, columns: Array, strength: float) -> Events:
    """Return begin and end of the bouts of motion of columns (n, k) together."""
    extents = np.ptp(columns, axis=0)
    if not extents.any():
        return Events(np.empty(0), np.empty(0), np.empty(0))
    moving = columns[:, extents > 0] / extents[extents > 0]
    sigma = 0.5 * _SMOOTHING * observed.rate
    speed = np.linalg.norm(gaussian_filter1d(moving, sigma, axis=0, order=1, mode="nearest"), axis=1)
    low = max(0.1 * float(speed.max()), 4.0 * 1.4826 * float(np.median(speed)))
    bouts = moving_bouts(speed, low, 3.0 * low if 3.0 * low < speed.max() else low)
    times = observed.times[np.column_stack((bouts[:, 0], bouts[:, 1] - 1)).ravel()]
    return Events(times, np.full(len(times), strength), np.full(len(times), _SMOOTHING))


#: Cue -> its events in an observed recording.
CUES: dict[str, Callable[[Observed], Events]] = {
    "speed": slow_moments,
    "direction": turns,
    "gripper": lambda observed: _begin_and_end(observed, observed.others["gripper"], 2.0),
    "contact": contact_events,
    "object": lambda observed: _begin_and_end(observed, observed.others["object"], 1.0),  # lag behind the arm
}


def _on_grid(events: Events, t: Array) -> Array:
    """Return the log odds (n,) of events at times t."""
    if not len(events.times):
        return np.zeros(len(t))
    widths = np.maximum(events.widths, _NARROW)[:, None]
    near = np.exp(-0.5 * ((t - events.times[:, None]) / widths) ** 2)
    return np.asarray((events.strengths[:, None] * near).max(axis=0))


def _best_subset(times: Array, odds: Array, apart: float) -> tuple[NDArray[np.intp], Array]:
    """Return the candidates with the largest sum of log odds, and the probability of each of all candidates (C,)."""
    n = len(times)
    before = np.searchsorted(times, times - apart + 1e-9, side="right")  # candidates that may come before each
    after = np.searchsorted(times, times + apart - 1e-9, side="left")
    best, last = np.zeros(n + 1), np.full(n + 1, -1, dtype=np.intp)  # of the first k candidates
    ahead, behind = np.zeros(n), np.zeros(n)  # log sums of all sets that end, or begin, at a candidate
    for k in range(n):
        taken = best[before[k]] + odds[k]
        best[k + 1], last[k + 1] = (taken, k) if taken > best[k] else (best[k], last[k])
        ahead[k] = odds[k] + logsumexp(np.append(0.0, ahead[: before[k]]))
    for k in range(n - 1, -1, -1):
        behind[k] = odds[k] + logsumexp(np.append(0.0, behind[after[k] :]))
    chosen = []
    k = int(last[n])
    while k >= 0:
        chosen.append(k)
        k = int(last[before[k]])
    probability = np.exp(ahead + behind - odds - logsumexp(np.append(0.0, ahead)))
    return np.array(chosen[::-1], dtype=np.intp), np.minimum(probability, 1.0)


def _within_strokes(observed: Observed, rows: NDArray[np.intp], strokes: int) -> NDArray[np.bool_]:
    """Tell which boundaries lie within so many strokes: each turns back, is about as long, and no gripper moves."""
    edges = np.concatenate(([0], rows, [len(observed.times) - 1]))
    way = np.diff(observed.arm[edges], axis=0)
    size = np.linalg.norm(way, axis=1)
    gripper = observed.others["gripper"]
    grip = np.abs(np.diff(gripper[edges], axis=0)) > _GRIPPED * np.ptp(gripper, axis=0)
    product = np.maximum(size[:-1] * size[1:], np.finfo(float).tiny)
    back = (np.einsum("ij,ij->i", way[:-1], way[1:]) < _BACK * product) & ~(grip[:-1] | grip[1:]).any(axis=1)
    back &= np.minimum(size[:-1], size[1:]) > _AS_LONG * np.maximum(size[:-1], size[1:])
    turning = runs(back)
    inside = np.zeros(len(rows), dtype=bool)
    for first, stop in turning[turning[:, 1] - turning[:, 0] >= strokes - 1].tolist():
        inside[first:stop] = True
    return inside


def _interval(total: Array, row: int) -> tuple[int, int]:
    """Return the first and the last row around a maximum whose log odds are within 1.92 of it."""
    low = np.flatnonzero(total < max(total[row] - _NEIGHBORHOOD, 0.1 * total[row]))
    k = int(np.searchsorted(low, row))
    first = int(low[k - 1]) + 1 if k else 0
    return first, int(low[k]) - 1 if k < len(low) else len(total) - 1
