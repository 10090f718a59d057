"""Checks of an episode of robot data: one table of what each measures, what that means, and what to do about it.

A check is a pure function of a `Motion`: values, each with the stretch of time that it is about. Those whose `side` is
"exact" count contradictions; all others are compared with those of other episodes, see `kineme.audit.calibrate`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.audit.motion import STEADY, Motion, features_of, longest_runs, smoothed, steps_of
from kineme.movements.episodes import LARGEST
from kineme.sampling import runs
from kineme.validation import Array

_WINDOW = 0.4  # [s], over which an arm that stays within the next two rests
_NOISE, _REST = 5.0, 0.01  # of the standard deviation of the noise, and of the channel's range
_TREMBLING = 2.0  # of the extent of the quietest windows
_EDGE = 0.1  # [s], of the beginning and of the end
_REPEATED = 12  # frames: longer runs of equal ones are rests
_SECOND = 1.0  # [s]


class Measure(NamedTuple):
    """Values of a check (k,), and the stretches [s] that they are about (k, 2)."""

    values: Array
    spans: Array


class Check(NamedTuple):
    """A row of `CHECKS`."""

    name: str
    measure: Callable[[Motion], Measure] | None  # None: of its way among others, `kineme.audit.calibrate.unlike`
    side: str  # which values tell of a fault: "upper", "lower", "both", or "exact" for all above 0
    least: float  # difference between values that means nothing; of the channel's range if relative
    words: str  # of the finding, with {channel}, {value}, {usual} and {column}
    meaning: str
    remedy: str
    shown: Callable[[float], float] = float  # a value as it is shown
    columns: tuple[str, ...] = ("",)  # of the values, each repeated for all channels where there are more values
    by_task: bool = False  # how values spread depends on what is done, not on sensors and hands alone
    relative: bool = False  # values are in the unit of their channel, and compared in multiples of its usual range


def _over_all(motion: Motion, *values: float) -> Measure:
    """Return values of the whole episode."""
    return Measure(np.array(values, dtype=float), np.tile([0.0, motion.times[-1]], (len(values), 1)))


def _at(motion: Motion, values: Array, first: NDArray[np.intp], last: NDArray[np.intp]) -> Measure:
    """Return values with their stretches as indices of frames, the last one included."""
    ends = np.clip(np.stack([first, last], axis=1), 0, len(motion.times) - 1)
    return Measure(np.asarray(values, dtype=float), motion.times[ends])


def _counted(motion: Motion, mask: NDArray[np.bool_], count: float | None = None) -> Measure:
    """Return how many frames a mask names, or another count of them, from the first to the last of these."""
    rows = np.flatnonzero(mask)
    if not len(rows):
        return _over_all(motion, 0.0)
    return _at(motion, np.array([len(rows) if count is None else count]), rows[:1], rows[-1:])


def problems(motion: Motion) -> Measure:
    """Count what the reader of the data set could not read or reconcile."""
    return _over_all(motion, len(motion.episode.problems))


def values(motion: Motion) -> Measure:
    """Count frames in which some feature is not a finite number."""
    columns = [motion.episode.signals[name] for names in features_of(motion.episode) for name in names]
    return _counted(motion, np.asarray((~(np.abs(np.concatenate(columns, axis=1)) <= LARGEST)).any(axis=1)))


def rate(motion: Motion) -> Measure:
    """Return the stored rate [1/s], from the median step, where it differs from the declared one by 5 %; else 0."""
    declared = motion.episode.fps
    wrong = declared > 0 and abs(np.log(motion.step * declared)) > np.log(1.05)
    return _over_all(motion, 1 / motion.step if wrong else 0.0)


def stamps(motion: Motion) -> Measure:
    """Count stamps that are missing, repeat the one before, or go back."""
    return _counted(motion, np.append(False, ~(steps_of(motion.episode) > 0)))


def gaps(motion: Motion) -> Measure:
    """Count missing frames: ``sum(round(step / median step) - 1)`` over steps of more than 1.5 median ones.

    Where steps vary by themselves, as of a busy computer, only steps beyond six of their standard deviations count.
    """
    steps = steps_of(motion.episode)
    spread = 1.4826 * np.median(np.abs(steps - motion.step))
    long = np.nan_to_num(steps) > max(1.5 * motion.step, motion.step + 6 * spread)
    missing = float((np.round(steps[long] / motion.step) - 1).sum()) if long.any() else 0.0
    return _counted(motion, np.append(False, long) | np.append(long, False), missing)


def repeats(motion: Motion) -> Measure:
    """Count frames in which no channel changes at all although the arm moves before and after, log(1 + n)."""
    change = np.abs(np.diff(motion.state, axis=0))
    speed = (change / motion.scale).max(axis=1)
    ends = runs(np.asarray(~change.any(axis=1)))
    ends = ends[(ends[:, 0] > 0) & (ends[:, 1] < len(speed)) & (ends[:, 1] - ends[:, 0] <= _REPEATED)]
    moving = 0.3 * np.median(speed[speed > 0]) if speed.any() else np.inf
    ends = ends[np.minimum(speed[ends[:, 0] - 1], speed[np.minimum(ends[:, 1], len(speed) - 1)]) > moving]
    if not len(ends):
        return _over_all(motion, 0.0)
    return _at(motion, np.log1p([(ends[:, 1] - ends[:, 0]).sum()]), ends[:1, 0], ends[-1:, 1])


def spikes(motion: Motion) -> Measure:
    """Return log of the largest step of each channel beyond the median of five around it, over its usual difference.

    A spike has two such steps, a jump one; of an onset of motion, the median follows. The usual difference is the
    noise, at least 0.002 of the channel's range.
    """
    steps = np.diff(motion.state, axis=0)
    beyond = np.abs(steps[2:-2] - _median_of_five(steps))
    rows = beyond.argmax(axis=0)
    usual = np.maximum(motion.noise * np.sqrt(2), np.where(np.isinf(motion.scale), 1e-9, 0.002 * motion.scale))
    return _at(motion, np.log(1 + beyond.max(axis=0) / usual), rows + 2, rows + 3)


def _median_of_five(steps: Array) -> Array:
    """Return medians (T - 4, d) of five rows around each, by a network of comparisons: ten times as fast as sorting."""
    a, b, c, d, e = (steps[k : len(steps) - 4 + k] for k in range(5))
    low, high = np.maximum(np.minimum(a, b), np.minimum(c, d)), np.minimum(np.maximum(a, b), np.maximum(c, d))
    return np.asarray(np.maximum(np.minimum(low, high), np.minimum(np.maximum(low, high), e)))


def jerk(motion: Motion) -> Measure:
    """Return ``log(rms jerk / rms velocity)`` [1/s^2] of the whole, and of the second in which it is largest.

    All channels together, each in multiples of its range, without the largest 2 %, which are spikes. Duration,
    amplitude and rests do not count, as they do in the dimensionless jerk: N. Hogan, D. Sternad, "Sensitivity of
    smoothness measures to movement duration, amplitude, and arrests", J. Motor Behavior 41(6), 2009.
    """
    smooth = smoothed(motion.state / motion.scale, 3)
    power = (np.diff(smooth, 3, axis=0) ** 2).sum(axis=1, keepdims=True)
    power = np.minimum(power, np.quantile(power, STEADY))
    speed = (np.diff(smooth, axis=0) ** 2).sum(axis=1).mean()
    if not speed > 0:
        return _over_all(motion, np.nan, np.nan)
    width = motion.frames(_SECOND)
    windows = smoothed(power, width)[:, 0]
    worst = int(windows.argmax())
    ratios = np.log(np.maximum(np.array([power.mean(), windows[worst]]) / speed, 1e-30)) / 2 - 2 * np.log(motion.step)
    return _at(motion, ratios, np.array([0, worst - width // 2]), np.array([len(smooth), worst + width // 2]))


def _doubled(width: int) -> list[int]:
    """Return shifts by which the extremes of neighbors become those of windows of `width` + 1 frames."""
    shifts = [1 << k for k in range((width + 1).bit_length() - 1)]
    return [*shifts, width - sum(shifts)] if width > sum(shifts) else shifts


def idle(motion: Motion) -> Measure:
    """Return log of the longest rest [s] at the beginning, in between, and at the end, plus a second.

    The arm rests where each channel stays, for 0.4 s, within five standard deviations of its noise, a hundredth of its
    range, or twice the extent that it exceeds in 95 % of such windows, whichever is the most: hands tremble at rest.
    """
    width = motion.frames(_WINDOW)
    high, low = motion.state, motion.state
    for shift in _doubled(width):
        high, low = np.maximum(high[shift:], high[:-shift]), np.minimum(low[shift:], low[:-shift])
    extents = high - low
    limit = np.maximum(_NOISE * motion.noise, _REST * np.where(np.isinf(motion.scale), 0.0, motion.scale))
    limit = np.maximum(limit, _TREMBLING * np.quantile(extents, 0.05, axis=0))
    ends = runs(np.asarray((extents <= limit).all(axis=1))) + np.array([0, width])
    at_start, at_end = ends[:, 0] == 0, ends[:, 1] >= len(motion.state)
    spans = np.zeros((3, 2), dtype=np.intp)
    for k, chosen in enumerate((ends[at_start], ends[~at_start & ~at_end], ends[at_end & ~at_start])):
        if len(chosen):
            spans[k] = chosen[np.diff(chosen, axis=1)[:, 0].argmax()]
    return _at(motion, np.log1p((spans[:, 1] - spans[:, 0]) * motion.step), *spans.T)


def frozen(motion: Motion) -> Measure:
    """Return log of the longest time [s] in which a channel does not change at all while another moves, plus 0.2 s.

    One value for each channel. A channel moves where it changes by more than three standard deviations of its noise;
    frames in which none does are left out.
    """
    changes = np.abs(np.diff(motion.state, axis=0))
    rows = np.flatnonzero((changes > 3 * motion.noise).any(axis=1))
    ends = longest_runs(changes[rows] == 0)
    seconds = (ends[:, 1] - ends[:, 0]) * motion.step
    frames = np.append(rows, len(motion.state))
    return _at(motion, np.log(0.2 + seconds), frames[ends[:, 0]], frames[np.maximum(ends[:, 1] - 1, 0)])


def still(motion: Motion) -> Measure:
    """Return minus log of each channel's extent, largest minus smallest value."""
    return _over_all(motion, *-np.log(np.ptp(motion.state, axis=0) + 1e-9))


def extremes(motion: Motion, sign: int) -> Measure:
    """Return the largest value of each channel, or with the sign -1 the smallest."""
    rows = (sign * motion.state).argmax(axis=0)
    return _at(motion, np.take_along_axis(motion.state, rows[None], axis=0)[0], rows, rows)


def ends(motion: Motion) -> Measure:
    """Return where each channel is at the beginning, and where at the end: means over a tenth of a second."""
    n = motion.frames(_EDGE)
    first, last = np.zeros(motion.state.shape[1], dtype=np.intp), np.full(motion.state.shape[1], len(motion.state))
    places = np.concatenate([motion.state[:n].mean(axis=0), motion.state[-n:].mean(axis=0)])
    return _at(motion, places, np.concatenate([first, last - n]), np.concatenate([first + n, last]))


def cut(motion: Motion) -> Measure:
    """Return log of the speed in the first and in the last tenth of a second, in the mean speed, plus 0.3."""
    n = motion.frames(_EDGE)
    moved = np.array([motion.state[n] - motion.state[0], motion.state[-1] - motion.state[-1 - n]]) / motion.scale / n
    mean = np.linalg.norm(np.diff(motion.state[::n], axis=0) / motion.scale / n, axis=1).mean()
    if not mean > 0:
        return _over_all(motion, np.nan, np.nan)
    length = len(motion.state)
    spans = np.array([[0, length - n], [n, length]])
    return _at(motion, np.log(0.3 + np.linalg.norm(moved, axis=1) / mean), *spans)


def duration(motion: Motion) -> Measure:
    """Return log of the duration [s]."""
    return _over_all(motion, np.log(motion.seconds))


def speed(motion: Motion) -> Measure:
    """Return log of the speed that is exceeded a tenth of the time, in ranges of the channels per second."""
    n = motion.frames(_EDGE)
    moved = np.linalg.norm((motion.state[n:] - motion.state[:-n]) / motion.scale, axis=1)
    return _over_all(motion, np.log(np.quantile(moved, 0.9) / (n * motion.step) + 1e-6))


def lag(motion: Motion) -> Measure:
    """Return the time [s] by which the state follows the action, see `frames_behind`."""
    return _over_all(motion, motion.late * motion.step)


def offset(motion: Motion) -> Measure:
    """Return for each channel the median of state minus action at their lag."""
    behind = _behind(motion)
    return _over_all(motion, *(np.full(motion.state.shape[1], np.nan) if behind is None else np.median(behind, axis=0)))


def following(motion: Motion) -> Measure:
    """Return log of the largest mean distance over a second of state and action at their lag and offset, in ranges."""
    behind = _behind(motion)
    if behind is None:
        return _over_all(motion, np.nan)
    away = np.abs(behind - np.median(behind, axis=0)) / motion.scale
    width = motion.frames(_SECOND)
    windows = smoothed(away, width).max(axis=1)
    worst = np.array([windows.argmax()])
    return _at(motion, np.log(1e-3 + windows.max(keepdims=True)), worst - width // 2, worst + width // 2)


def _behind(motion: Motion) -> Array | None:
    """Return state minus action (n, d) at their lag; None where they have none."""
    if motion.lead is None or np.isnan(motion.late):
        return None
    k, n = round(motion.late), len(motion.state)
    return motion.state[max(k, 0) : n + min(k, 0)] - motion.lead[max(-k, 0) : n - max(k, 0)]


#: All checks. The first contradict what the data set declares; the others are compared.
CHECKS: tuple[Check, ...] = (
    Check(
        "problems", problems, "exact", 0.0, "{problems}",
        "The files contradict themselves.", "Record the episode again, or leave it out.",
    ),
    Check(
        "values", values, "exact", 0.0, "{value:.0f} frames hold values that are no finite numbers",
        "A sensor or a conversion failed.", "Leave it out: in training, one NaN spreads over all weights.",
    ),
    Check(
        "rate", rate, "exact", 0.0, "frames come at {value:.4g} per second, the data set declares {fps:.4g}",
        "Velocities and horizons of actions are wrong by the ratio.", "Declare the true rate, or resample the episode.",
    ),
    Check(
        "stamps", stamps, "exact", 0.0, "{value:.0f} stamps are missing, repeat, or go back",
        "Frames were stored twice or in another order.", "Drop the repeated frames, or leave the episode out.",
    ),
    Check(
        "gaps", gaps, "exact", 0.0, "{value:.0f} frames are missing between stamps",
        "The recorder lost frames.", "Leave the episode out, or interpolate short gaps.",
    ),
    Check(
        "repeats", repeats, "upper", 1.4, "{value:.0f} frames repeat the one before in mid motion (usual: {usual:.0f})",
        "A slow sensor was stored at a higher rate, or frames were stored twice.", "Drop them, or lower the rate.",
        np.expm1,
    ),
    Check(
        "spikes", spikes, "upper", 0.3,
        "{channel} jumps within one frame, {value:.0f} times its noise (usual: {usual:.0f})",
        "A glitch of a sensor, or frames that are missing although stamps go on.",
        "Leave the episode out, or repair the samples.", np.expm1,
    ),
    Check(
        "jerk", jerk, "upper", 0.1, "{value:.0f} times as much jerk as speed [1/s^2], {column} (usual: {usual:.0f})",
        "Shaky teleoperation, collisions, or a controller that oscillates.", "Look at the stretch; record it again.",
        np.exp, ("over all", "at its worst"),
    ),
    Check(
        "idle", idle, "upper", 0.35, "rests for {value:.1f} s {column} (usual: {usual:.1f} s)",
        "A policy learns to wait.", "Trim the beginning and the end; split the episode, or leave it out.",
        np.expm1, ("at the beginning", "in between", "at the end"),
    ),
    Check(
        "frozen", frozen, "upper", 0.3, "{channel} keeps one value for {value:.1f} s of motion (usual: {usual:.1f} s)",
        "The sensor or its bus stood still while the arm went on.", "Leave the episode out; check the cable.",
        lambda value: float(np.exp(value)) - 0.2,
    ),
    Check(
        "still", still, "upper", 0.3, "{channel} moves by {value:.3g} in all (usual: {usual:.3g})",
        "A gripper that never closes, or a joint that was not connected.", "See if the task was done at all.",
        lambda value: float(np.exp(-value)), by_task=True,
    ),
    Check(
        "above", partial(extremes, sign=1), "upper", 0.05, "{channel} goes up to {value:.3g} (usual: {usual:.3g})",
        "Another calibration, channels in another order, or a collision.", "Compare the calibration of that day.",
        by_task=True, relative=True,
    ),
    Check(
        "below", partial(extremes, sign=-1), "lower", 0.05, "{channel} goes down to {value:.3g} (usual: {usual:.3g})",
        "Another calibration, channels in another order, or a collision.", "Compare the calibration of that day.",
        by_task=True, relative=True,
    ),
    Check(
        "place", ends, "both", 0.05, "{channel} {column} at {value:.3g} (usual: {usual:.3g})",
        "The episode begins or ends elsewhere: cut off, or not brought to its end.", "See if the task was finished.",
        columns=("begins", "ends"), by_task=True, relative=True,
    ),
    Check(
        "cut", cut, "upper", 0.3,
        "in its {column} tenth of a second the arm moves at {value:.1f} times its mean speed (usual: {usual:.1f})",
        "The recording began late or was stopped early.", "Leave the episode out if the task is not finished.",
        lambda value: float(np.exp(value)) - 0.3, ("first", "last"),
    ),
    Check(
        "duration", duration, "both", 0.1, "lasts {value:.1f} s (usual: {usual:.1f} s)",
        "Cut off, forgotten to stop, another task, or another rate.", "Look at its end.", np.exp, by_task=True,
    ),
    Check(
        "speed", speed, "both", 0.05, "moves {value:.2g} ranges of its channels in a second (usual: {usual:.2g})",
        "Another rate than declared, or another manner.", "Compare stamps with a clock; record in one tempo.", np.exp,
    ),
    Check(
        "lag", lag, "both", 0.01, "the state follows the action after {value:.3f} s (usual: {usual:.3f} s)",
        "Clocks or buffers differ: observations are paired with the actions of another time.",
        "Shift the action, or leave the episode out.",
    ),
    Check(
        "offset", offset, "both", 0.01, "{channel} is {value:+.3g} from its action all the time (usual: {usual:+.3g})",
        "Leader and follower were calibrated differently.", "Calibrate again; subtract the offset.",
        by_task=True, relative=True,
    ),
    Check(
        "following", following, "upper", 0.2,
        "a channel is {value:.0%} of its range from its action for a second (usual: {usual:.0%})",
        "The follower was held, lost its load, or ran into something.", "Look at the stretch.",
        lambda value: float(np.exp(value)) - 1e-3,
    ),
    Check(
        "unlike", None, "upper", 0.05,
        "its way is {value:.2g} ranges from the nearest of its task (usual: {usual:.2g})",
        "Another task than it says, a failed attempt, or a manner of its own.", "See what was done; correct the task.",
        np.exp, by_task=True,
    ),
    Check(
        "task", None, "upper", 0.05,
        "its way is {value:.2g} times as far from its own task as from another (usual: {usual:.2g})",
        "It carries the name of another task.", "See what was done; correct the task.", np.exp, by_task=True,
    ),
)  # fmt: skip
