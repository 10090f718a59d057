"""Faults planted in clean episodes of robot data, one function each; severity 1 is what should be found, 0.3 is slight.

Every fault takes an episode, a random generator and a severity, and returns another episode with the same number:
signals and time stamps as a data set would store them. The truth of its movements is of no use afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bench.work_sets import ACTION, FPS, STATE, TASKS, Array, Work, work_episodes
from kineme.movements.episodes import Episode

Fault = Callable[[Episode, np.random.Generator, float], Episode]


class Planted(NamedTuple):
    """An episode of a set with planted faults."""

    episode: Episode
    fault: str | None  # a key of FAULTS; None where the episode is clean


def frozen(episode: Episode, rng: np.random.Generator, severity: float = 1.0) -> Episode:
    """Hold one joint's sensor while the joint moves, for a quarter of the episode."""
    state = episode.signals[STATE].copy()
    n = round(0.25 * severity * len(state))
    joint = int(rng.choice(np.argsort(np.abs(np.diff(state, axis=0)).sum(axis=0))[-3:]))
    moves = np.convolve(np.abs(np.diff(state[:, joint])), np.ones(n), "valid")  # path of the joint in each stretch
    start = int(rng.choice(np.argsort(moves)[-max(1, len(moves) // 4) :]))
    state[start : start + n, joint] = state[start, joint]
    return _with(episode, {STATE: state})


def spike(episode: Episode, rng: np.random.Generator, severity: float = 1.0) -> Episode:
    """Throw single samples of joints off by 0.3 rad, three times."""
    state = episode.signals[STATE].copy()
    for _ in range(3):
        at, joint = rng.integers(5, len(state) - 5), rng.integers(state.shape[1])
        state[at, joint] += 0.3 * severity * rng.choice((-1.0, 1.0))
    return _with(episode, {STATE: state})


def dropped(episode: Episode, rng: np.random.Generator, severity: float = 1.0) -> Episode:
    """Lose frames: 3 gaps of 0.3 s, which the stamps show."""
    lost = np.zeros(len(episode), bool)
    for start in rng.integers(10, len(episode) - 40, size=3):
        lost[start : start + max(1, round(0.3 * severity * FPS))] = True
    return _taken(episode, np.flatnonzero(~lost))


def dropped_silently(episode: Episode, rng: np.random.Generator, severity: float = 1.0) -> Episode:
    """Lose frames as `dropped` does; stamps are counted on, so that only the path jumps."""
    rest = dropped(episode, rng, severity)
    return replace(rest, times=episode.times[: len(rest)])


def repeated(episode: Episode, rng: np.random.Generator, severity: float = 1.0) -> Episode:
    """Store some frames twice, with the stamp of the first."""
    twice = rng.choice(len(episode), max(1, round(0.02 * severity * len(episode))), replace=False)
    return _taken(episode, np.sort(np.append(np.arange(len(episode)), twice)))


def wrong_fps(episode: Episode, rng: np.random.Generator, severity: float = 1.0) -> Episode:
    """Record at a fifth less than the declared rate; the stamps tell it."""
    return replace(episode, times=episode.times * (1.0 + 0.25 * severity))


def wrong_fps_silently(episode: Episode, rng: np.random.Generator, severity: float = 1.0) -> Episode:
    """Store every other frame as if it were the next: all is twice as fast, and half as long, with regular stamps."""
    half = _taken(episode, np.arange(0, len(episode), 2))
    return replace(half, times=episode.times[: len(half)])


def jerk(episode: Episode, rng: np.random.Generator, severity: float = 1.0) -> Episode:
    """Shake leader and follower: jolts of the hand, 0.02 rad rms of 2 to 8 Hz, in a third of the episode."""
    from scipy.signal import butter, sosfiltfilt

    n, d = episode.signals[STATE].shape
    shaken = sosfiltfilt(butter(2, (2.0, 8.0), "bandpass", fs=FPS, output="sos"), rng.normal(size=(n, d)), axis=0)
    length = max(25, n // 3)
    start = int(rng.integers(0, n - length + 1))
    envelope = np.zeros((n, 1))
    envelope[start : start + length, 0] = np.hanning(length)
    jolts = 0.02 * severity * envelope * shaken / shaken.std(axis=0)
    return _with(episode, {key: episode.signals[key] + jolts for key in (STATE, ACTION)})


def idle(episode: Episode, rng: np.random.Generator, severity: float = 1.0) -> Episode:
    """Rest for 8 s, at the beginning, between, or at the end."""
    n, frames = len(episode), round(8.0 * severity * FPS)
    at = int(rng.choice((0, n - 1, int(rng.integers(n)))))
    index = np.concatenate((np.arange(at), np.full(frames, at), np.arange(at, n)))
    still = _taken(episode, index)
    noise = {key: still.signals[key].copy() for key in (STATE, ACTION)}
    for values in noise.values():  # sensors flicker by a step
        values[at : at + frames] += 0.0015 * rng.choice((-1, 0, 0, 0, 1), size=(frames, values.shape[1]))
    return replace(_with(still, noise), times=np.arange(len(index)) / FPS)


def offset(episode: Episode, rng: np.random.Generator, severity: float = 1.0) -> Episode:
    """Shift one joint of the follower by 0.15 rad: leader and follower disagree all the time."""
    state = episode.signals[STATE].copy()
    state[:, rng.integers(state.shape[1])] += 0.15 * severity * rng.choice((-1.0, 1.0))
    return _with(episode, {STATE: state})


def lag(episode: Episode, rng: np.random.Generator, severity: float = 1.0) -> Episode:
    """Let the follower come 0.2 s later than it does elsewhere."""
    frames = max(1, round(0.2 * severity * FPS))
    late = {key: values[np.maximum(np.arange(len(episode)) - frames, 0)] for key, values in episode.signals.items()}
    return _with(episode, {**late, ACTION: episode.signals[ACTION]})


def unlike(episode: Episode, rng: np.random.Generator, severity: float = 1.0) -> Episode:
    """Do another task than the episode says."""
    arms = episode.signals[STATE].shape[1] // 7
    others = [task for task in TASKS if task != episode.task]
    other = str(rng.choice(others))
    work = next(iter(work_episodes(1, int(rng.integers(1 << 30)), (int(rng.integers(4)),), arms, (other,))))
    return replace(work.episode, number=episode.number, task=episode.task)


def truncated(episode: Episode, rng: np.random.Generator, severity: float = 1.0) -> Episode:
    """Break off: the last three quarters are missing."""
    return _taken(episode, np.arange(round((1.0 - 0.75 * severity) * len(episode))))


def swapped(episode: Episode, rng: np.random.Generator, severity: float = 1.0) -> Episode:
    """Exchange two joints of the follower that lie apart."""
    state = episode.signals[STATE].copy()
    first, second = rng.choice(6, 2, replace=False)
    state[:, [first, second]] = state[:, [second, first]]
    return _with(episode, {STATE: state})


#: Name -> fault.
FAULTS: Mapping[str, Fault] = {
    fault.__name__: fault
    for fault in (
        frozen, spike, dropped, dropped_silently, repeated, wrong_fps, wrong_fps_silently,
        jerk, idle, offset, lag, unlike, truncated, swapped,
    )
}  # fmt: skip


def plant(
    works: Sequence[Work], share: float, seed: int, faults: Sequence[str] = tuple(FAULTS), severity: float = 1.0
) -> Iterator[Planted]:
    """Yield the episodes of a set, a share of them with one fault each, the faults in turn."""
    drawn = np.random.default_rng([79, seed]).permutation(len(works))[: round(share * len(works))]
    chosen = {int(k): faults[i % len(faults)] for i, k in enumerate(drawn)}
    for k, work in enumerate(works):
        name = chosen.get(k)
        own = np.random.default_rng([80, seed, k])
        yield Planted(work.episode if name is None else FAULTS[name](work.episode, own, severity), name)


def _with(episode: Episode, signals: Mapping[str, Array]) -> Episode:
    return replace(episode, signals={**episode.signals, **signals})


def _taken(episode: Episode, frames: Array) -> Episode:
    """Return some frames of all signals, with their stamps."""
    signals = {key: values[frames] for key, values in episode.signals.items()}
    return replace(episode, signals=signals, times=episode.times[frames])
