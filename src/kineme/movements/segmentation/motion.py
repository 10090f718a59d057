"""The motion of one recording: smoothed positions, speed over time, and the share of noise in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter

from kineme.errors import TrajectoryError
from kineme.movements.preparation.smooth import Smooth
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.validation import Array

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

    Raises
    ------
    TrajectoryError
        Fewer than eight samples, or a recording without motion.
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
