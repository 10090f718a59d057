"""An episode of robot data, prepared for its checks: what moves in it, how fast, and how noisy that is."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.movements.episodes import LARGEST, LATEST, Episode
from kineme.movements.preparation.resample import arc_length_phase, resample_by_phase
from kineme.movements.segmentation.table import noise_deviations
from kineme.sampling import runs
from kineme.validation import Array

#: Samples of the way that stands for an episode, evenly spaced by arc length.
PATH = 64
FEWEST_FRAMES = 8
STEADY = 0.98  # share of the samples that spikes are not among
_MOST_CHANNELS = 64
_SET_ASIDE = re.compile(r"(^|[./])(next|reward|done|success|timestamp|mask|\w*index)([./]|$)")  # no motion
_ACTION = re.compile(r"(^|[./])actions?([./]|$)")
_STATE = re.compile(r"(^|[./])(state|qpos)$")
_MOVING = 30.0  # standard deviations of the noise: a channel whose range is less does not move
_LONGEST_LAG = 0.5  # [s]
_LEAST_CORRELATION = 0.3  # below, the action is not what the state follows


class Motion(NamedTuple):
    """An episode, prepared for all checks: what moves in it, free of gaps."""

    episode: Episode
    times: Array  # (T,) [s], from 0; counted by the rate where the stamps do not increase
    step: float  # [s]
    state: Array  # (T, d), missing values replaced by those before
    names: tuple[str, ...]  # of the channels
    scale: Array  # (d,), range of the channel from its 5 % to its 95 % quantile; infinite below 30 times the noise
    noise: Array  # (d,), standard deviation of what changes from frame to frame without being motion, at least 1/2 step
    lead: Array | None  # (T, d), the action, where it commands the channels of the state
    late: float  # frames by which the state follows the action; NaN where it does not

    @property
    def seconds(self) -> float:
        """Duration [s]."""
        return len(self.state) * self.step

    def frames(self, seconds: float) -> int:
        """Return a number of frames, at least 1 and at most half of the episode."""
        return max(1, min(round(seconds / self.step), len(self.state) // 2))


def features_of(episode: Episode) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the features that say how the robot moved, and those that say how it was commanded."""
    filled = (name for name, values in episode.signals.items() if values.ndim == 2 and values.size)
    names = [name for name in filled if not _SET_ASIDE.search(name)]
    actions = tuple(name for name in names if _ACTION.search(name))
    others = [name for name in names if name not in actions]
    states = [name for name in others if _STATE.search(name)] or others
    return tuple(states) or actions, actions


def motion_of(episode: Episode) -> Motion | None:
    """Prepare an episode for its checks; None if it has too few frames, or no feature of numbers."""
    states, actions = features_of(episode)
    if len(episode) < FEWEST_FRAMES or not states:
        return None
    state = _filled(np.concatenate([episode.signals[name] for name in states], axis=1)[:, :_MOST_CHANNELS])
    names = [
        entry if len(states) == 1 else f"{name} {entry}".strip()
        for name in states
        for entry in episode.names.get(name, map(str, range(episode.signals[name].shape[1])))
    ]
    steps = steps_of(episode)
    step = float(np.median(steps)) if np.isfinite(steps).all() else np.nan
    if not step > 0:
        step = 1 / episode.fps if episode.fps > 1 / LATEST else 1.0
    increasing = bool((steps > 0).all())
    times = episode.times - episode.times[0] if increasing else np.arange(float(len(episode))) * step
    changes = np.abs(np.diff(state, axis=0))
    least = np.where(changes > 0, changes, np.inf).min(axis=0)  # that the sensor resolves; infinite if it never changes
    noise = np.maximum(noise_deviations(state), np.where(np.isinf(least), 0.0, 0.5 * least))
    low, high = np.quantile(state, [0.05, 0.95], axis=0)
    scale = np.asarray(np.where(high - low > _MOVING * noise, high - low, np.inf))
    lead = None
    for name in actions:
        if state.shape == episode.signals[name].shape and name not in states:
            lead = _filled(episode.signals[name])
            break
    late = np.nan if lead is None else frames_behind(lead / scale, state / scale, round(_LONGEST_LAG / step))
    return Motion(episode, times, step, state, tuple(names[: state.shape[1]]), scale, noise, lead, late)


def steps_of(episode: Episode) -> Array:
    """Return the steps between stamps (T - 1,) [s]; NaN beside one that is none."""
    return np.diff(np.where(np.abs(episode.times) <= LATEST, episode.times, np.nan))


def path_of(motion: Motion) -> NDArray[np.float32]:
    """Return (d, 64) values of the channels at even shares of the way: independent of tempo and of pauses."""
    smooth = smoothed(motion.state, motion.frames(0.2)).T[None]
    phase = arc_length_phase(smooth / motion.scale[:, None])
    return np.asarray(resample_by_phase(smooth, phase, PATH)[0], dtype=np.float32)


def _filled(values: Array) -> Array:
    """Replace what is not finite by the value before, at the beginning by the first finite one, else by 0."""
    finite = np.abs(values) <= LARGEST
    if finite.all():
        return np.asarray(values, dtype=np.float64)
    rows = np.maximum.accumulate(np.where(finite, np.arange(len(values))[:, None], -1), axis=0)
    rows = np.where(rows < 0, finite.argmax(axis=0), rows)
    filled = np.take_along_axis(values, rows, axis=0)
    return np.asarray(np.where(np.abs(filled) <= LARGEST, filled, 0.0))


def smoothed(values: Array, width: int) -> Array:
    """Average (T, d) over windows of `width` frames, shorter at the ends."""
    sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    centers = np.arange(len(values))
    first, last = np.maximum(centers - width // 2, 0), np.minimum(centers + width // 2 + 1, len(values))
    return np.asarray((sums[last] - sums[first]) / (last - first)[:, None])


def longest_runs(mask: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return (d, 2) first and last of the longest run of True in each column of (T, d); 0, 0 without one."""
    length = len(mask) + 1
    ends = runs(np.concatenate([mask, np.zeros((1, mask.shape[1]), dtype=np.bool_)]).T.ravel())
    columns, longest = ends[:, 0] // length, np.zeros((mask.shape[1], 2), dtype=np.intp)
    order = np.argsort(ends[:, 1] - ends[:, 0], kind="stable")  # the longest is written last
    longest[columns[order]] = (ends - columns[:, None] * length)[order]
    return longest


def frames_behind(leader: Array, follower: Array, most: int) -> float:
    """Return frames by which one motion (T, d) follows another: argmax of the correlation of velocities, by a parabola.

    Velocities are cut at what 2 % exceed, so that spikes do not count. NaN where they correlate by less than 0.3, or
    most at a lag of `most` frames.
    """
    lead, follow = np.diff(leader, axis=0), np.diff(follower, axis=0)
    largest = np.quantile(np.abs(np.concatenate([lead, follow])), STEADY, axis=0)
    lead, follow = np.clip(lead, -largest, largest), np.clip(follow, -largest, largest)
    most = max(1, min(most, len(lead) // 2))
    size = 1 << (len(lead) + most).bit_length()
    spectrum = (np.fft.rfft(lead, size, axis=0).conj() * np.fft.rfft(follow, size, axis=0)).sum(axis=1)
    products = np.roll(np.fft.irfft(spectrum, size), most)[: 2 * most + 1]
    products *= len(lead) / (len(lead) - np.abs(np.arange(-most, most + 1)))  # else lags near 0 win by their overlap
    energy = np.sqrt((lead**2).sum() * (follow**2).sum())
    top = int(products.argmax())
    if not energy > 0 or products[top] < _LEAST_CORRELATION * energy or top in (0, 2 * most):
        return np.nan
    before, peak, after = products[top - 1 : top + 2]
    return top - most + 0.5 * float((before - after) / (before - 2 * peak + after))
