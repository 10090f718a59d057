"""The motion of one recording: smoothed positions, speed over time, and the share of noise in it.

Bouts are runs of samples in motion, found with hysteresis; onset and end of a movement lie within its piece.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter

from kineme.errors import TrajectoryError
from kineme.movements.preparation.smooth import Smooth
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.validation import Array

_LEVEL = 0.05  # threshold, as a share of the movement's own peak speed
_STILL = 1e-3  # of the same: speed at rest in a recording without noise
_BLUR = 0.25  # time that smoothing moves a crossing outward, in cycles at the cutoff
_REACH = 0.1  # longest extrapolation of an onset, as a share of the movement

Rows = NDArray[np.intp]

_ROUNDS = 6  # at most: peak speed and smoothing depend on each other, and are found by iteration
_SLOWEST = 2.0  # cycles per recording: the lowest cutoff
_PEAK_PATH = 0.9  # of the path is covered below the peak speed
_MIN_SAMPLES = 8  # two movements of four samples
_GLITCH = 3  # samples, at most: what leaves the path for longer is a movement
_GLITCH_STEPS = 10.0  # distance of a glitch from the path, in the longest steps of the path beside it, at least
_NOISE_EXTENTS = 4.0  # a smoothed recording rests if its extent is less than this many standard deviations of noise


@dataclass(frozen=True, eq=False)
class Motion:
    """A recording, smoothed as much as its noise requires.

    Attributes
    ----------
    times : ndarray of shape (T,)
    positions : ndarray of shape (T, d)
        Smoothed.
    speed : ndarray of shape (T,)
        Norm of the derivative of the smoothed positions [unit/s].
    peak : float
        Robust peak speed: nine tenths of the path are covered at lower speed. Weighted by path, not by time, so that
        long rests do not lower it.
    noise : float
        Root mean square speed of the noise that remains after smoothing [unit/s].
    cutoff : float
        Cutoff frequency of the smoothing [Hz].
    """

    times: Array
    positions: Array
    speed: Array
    peak: float
    noise: float
    cutoff: float


def observe(recording: Trajectory, resolution: float) -> Motion:
    """Smooth a recording until the speed of its noise is a quarter of ``resolution * peak``; return its motion.

    White noise of variance sigma^2 per dimension, sampled at rate r, passes the smoothing spline (see `Smooth`) of
    cutoff c [Hz] with a speed of variance ``(pi^3 / sqrt 2) sigma^2 c^3 / r`` per dimension: the integral of
    ``(2 pi nu)^2 (2 sigma^2 / r) / (1 + (nu / c)^4)^2``. The largest c that keeps this below the limit is taken, so a
    clean recording is hardly smoothed, and no cutoff in hertz assumes how fast people or robots move. Glitches are
    taken out first, see `without_glitches`.

    Parameters
    ----------
    recording : Trajectory
    resolution : float
        Speed that must be distinguished from rest, as a share of the peak speed.
    """
    who = f"recording {recording.name!r}" if recording.name else "recording"
    if len(recording) < _MIN_SAMPLES:
        raise TrajectoryError(f"{who}: expected at least {_MIN_SAMPLES} samples to cut, got {len(recording)}")
    t = recording.times - recording.times[0]
    positions = without_glitches(recording.positions)
    variance = noise_variance(positions)
    passed = np.pi**3 / np.sqrt(2) * variance * recording.duration / (len(t) - 1)
    slowest, cutoff = _SLOWEST / recording.duration, (len(t) - 1) / recording.duration / 4.0
    demos = Demonstrations([Trajectory(recording.times, positions)])
    for _ in range(_ROUNDS):
        smooth = Smooth(cutoff * recording.duration).apply(demos).positions
        speed = np.linalg.norm(np.gradient(smooth, t, axis=0), axis=1)
        peak = peak_speed(speed, t)
        noise = float(np.sqrt(passed * cutoff**3))
        aim = resolution * peak / 4.0
        if noise <= 1.05 * aim or cutoff <= slowest:
            break
        cutoff = max((aim**2 / passed) ** (1.0 / 3.0), slowest)
    extent, sigma = float(np.linalg.norm(np.ptp(smooth, axis=0))), float(np.sqrt(variance))
    if extent <= max(_NOISE_EXTENTS * sigma, 1e-12 * np.abs(positions).max()):
        raise TrajectoryError(
            f"{who}: expected some movement, got {recording.duration:.3g} s at rest: the smoothed positions stay "
            f"within {extent:.3g}, the noise is {sigma:.3g}; check the dimensions and the unit of the recording"
        )
    return Motion(recording.times, smooth, speed, peak, noise, cutoff)


def without_glitches(positions: Array) -> Array:
    """Positions (T, d) with the median of seven samples in place of those that leave the path at once and return.

    One sample 100 m away would be most of the path, and all else would be at rest beside its speed. A glitch lasts up
    to three samples; it lies ten times as far from the medians as these move in a step beside it, and as a typical step
    of the recording is long. Other samples stay as they are, to the last bit.
    """
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    typical = float(np.median(steps[steps > 0])) if steps.any() else 0.0
    if steps.max() <= _GLITCH_STEPS * typical:
        return positions
    width = 2 * _GLITCH + 1
    path = median_filter(positions, (width, 1), mode="mirror")
    moved = np.linalg.norm(np.diff(path, axis=0, prepend=path[:1]), axis=1)
    beside = maximum_filter1d(moved, 2 * width + 1)
    glitches = np.linalg.norm(positions - path, axis=1) > _GLITCH_STEPS * np.maximum(beside, typical)
    return np.where(glitches[:, None], path, positions) if glitches.any() else positions


def noise_variance(positions: Array) -> float:
    """Variance of white noise on (T, d) positions, summed over dimensions.

    Estimated from the median size of third differences, to which a smooth path hardly contributes: for Gaussian noise
    it is ``0.6745 sqrt(20) sigma``. A median, so that single jumps have no influence.
    """
    sizes = np.median(np.abs(np.diff(positions, n=3, axis=0)), axis=0)
    return float(((sizes / (0.6745 * np.sqrt(20.0))) ** 2).sum())


def peak_speed(speed: Array, times: Array) -> float:
    """The speed (T,) below which nine tenths of the path are covered."""
    order = np.argsort(speed)
    path = np.cumsum((speed * np.gradient(times))[order])
    return float(speed[order[np.searchsorted(path, _PEAK_PATH * path[-1])]])


def moving_bouts(speed: Array, low: float, high: float) -> Rows:
    """Runs of samples faster than `low` that exceed `high` somewhere: rows (n, 2), first and one past the last."""
    edges = np.diff(np.concatenate(([False], speed > low, [False])).astype(np.int8))
    rows = np.column_stack((np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)))
    if not len(rows):
        return rows
    fastest = np.maximum.reduceat(np.append(speed, 0.0), rows.ravel())[::2]
    return rows[fastest > high]


def typical_duration(durations: Array) -> float:
    """The duration such that half of the moving time lies in bouts at least as long; twitches hardly change it."""
    ordered = np.sort(durations)
    return float(ordered[np.searchsorted(np.cumsum(ordered), 0.5 * ordered.sum())])


def merge_across(bouts: Rows, times: Array, gap: float) -> Rows:
    """Merge bouts that are at most `gap` seconds apart."""
    starts, ends = times[bouts[:, 0]], times[bouts[:, 1] - 1]
    apart = np.flatnonzero(starts[1:] - ends[:-1] > gap)
    return np.column_stack((bouts[np.append(0, apart + 1), 0], bouts[np.append(apart, len(bouts) - 1), 1]))


def durations_of(bouts: Rows, times: Array) -> Array:
    """Duration of each bout [s]."""
    return np.asarray(times[bouts[:, 1] - 1] - times[bouts[:, 0]])


def consecutive(inner_cuts: Rows, n_samples: int) -> Rows:
    """The pieces between cuts: rows (n, 2) that cover all samples."""
    edges = np.concatenate(([0], inner_cuts, [n_samples]))
    return np.column_stack((edges[:-1], edges[1:]))


def onset_rows(motion: Motion, pieces: Rows) -> Rows:
    """Narrow pieces (n, 2) to their motion.

    A movement starts smoothly, so a threshold on the speed detects it late: a minimum-jerk movement reaches 5 % of its
    peak speed after 6 % of its duration. Speed at first grows about as the square of the time since the onset, so the
    onset is extrapolated: it lies as far before the crossing of a level as that lies before the crossing of four times
    the level, but not within rest. Smoothing moves the crossings outward: with cutoff c, the extrapolated onset of a
    minimum-jerk movement by 0.1 / c, that of a movement at full speed from the start by 0.4 / c. The mean of the two,
    0.25 / c, is subtracted. The end is found in the same way, backward in time.
    """
    if not len(pieces):  # np.maximum.reduceat needs a piece
        return pieces
    begin = _crossings(motion, motion.times, motion.speed, pieces)
    backward = len(motion.times) - pieces[:, ::-1]
    end = _crossings(motion, -motion.times[::-1], motion.speed[::-1], backward[::-1])
    return np.column_stack((begin, len(motion.times) - end[::-1]))


def _crossings(motion: Motion, t: Array, speed: Array, pieces: Rows) -> Rows:
    """First row of the motion in each piece; pieces are increasing and disjoint; t and speed may be reversed."""
    piece_of = np.searchsorted(pieces[:, 0], np.arange(len(t)), side="right") - 1
    inside = (piece_of >= 0) & (np.arange(len(t)) < pieces[np.maximum(piece_of, 0), 1])
    peaks = np.maximum.reduceat(np.where(inside, speed, 0.0), pieces[:, 0])
    level = np.maximum(_LEVEL * peaks, 2.0 * motion.noise)
    row = np.arange(len(t))
    higher = _first(inside & (speed >= np.minimum(4.0 * level, 0.9 * peaks)[piece_of]), pieces)
    before = inside & (row < higher[piece_of])
    first = _last(before & (speed < level[piece_of]), pieces) + 1  # earlier crossings may be noise at rest
    reach = np.minimum(t[higher] - t[first], _REACH * (t[pieces[:, 1] - 1] - t[first]))
    onset = np.searchsorted(t, t[first] - reach + _BLUR / motion.cutoff, side="right") - 1
    still = _last(before & (speed < _STILL * peaks[piece_of]), pieces)
    return np.clip(np.maximum(onset, still), pieces[:, 0], higher)


def _last(where: NDArray[np.bool_], pieces: Rows) -> Rows:
    """Last row of each piece where the condition holds, else the row before it."""
    rows = np.maximum.reduceat(np.where(where, np.arange(len(where)), -1), pieces[:, 0])
    return np.maximum(rows, pieces[:, 0] - 1)


def _first(where: NDArray[np.bool_], pieces: Rows) -> Rows:
    """First row of each piece where the condition holds, else its first row."""
    rows = np.minimum.reduceat(np.where(where, np.arange(len(where)), len(where)), pieces[:, 0])
    return np.asarray(np.where(rows < pieces[:, 1], rows, pieces[:, 0]))
