"""Long recordings of many movements one after the other, with the truth about where each one is."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from kineme.experiments.evaluation.measures import Stretch
from kineme.movements.trajectories.demonstrations import Demonstrations, require_labels
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.validation import Array

_MOST = 20  # movements of one recording
_NOISE = 1e-3  # standard deviation of the positions at rest, as a share of the extent
_SHORTEST = 0.2  # transit [s]


class Concatenated(NamedTuple):
    """A recording, and the movements in it."""

    recording: Trajectory
    stretches: list[Stretch]


def concatenated(demonstrations: Demonstrations, rest: float, seed: list[int]) -> list[Concatenated]:
    """Movements in random order, up to twenty in each recording.

    Between two of them, the hand rests for `rest` seconds, half of it at either place, and goes straight from one to
    the other at the mean speed of the movement before, with a smooth start and end if it rests.

    Parameters
    ----------
    demonstrations : Demonstrations
        Labeled, each at the position where it was recorded.
    rest : float
        In seconds.
    seed : list of int
    """
    random = np.random.default_rng([2, *seed])
    order = random.permutation(len(demonstrations))
    return [
        _merged(demonstrations[order[start : start + _MOST]], rest, random) for start in range(0, len(order), _MOST)
    ]


def _merged(movements: Demonstrations, rest: float, random: np.random.Generator) -> Concatenated:
    step = float(np.median(movements.durations / (movements.lengths - 1)))
    extent = float(np.ptp(movements.positions, axis=0).max())
    times: list[Any] = []
    positions: list[Array] = []
    stretches: list[Stretch] = []
    now = 0.0
    for one, label in zip(movements, require_labels(movements), strict=True):
        if positions:
            between = _between(positions[-1], times[-1], one.positions[0], (rest, step))
            moved = between + random.normal(0.0, _NOISE * extent, between.shape)
            times.append(now + step * np.arange(1, len(moved) + 1))
            positions.append(moved)
            now = float(times[-1][-1]) + step
        own = now + one.times - one.times[0]
        times.append(own)
        positions.append(one.positions)
        now = float(own[-1])
        stretches.append(Stretch(float(own[0]), now, label))
    return Concatenated(Trajectory(np.concatenate(times), np.concatenate(positions)), stretches)


def _between(before: Array, stamps: Array, goal: Array, pace: tuple[float, float]) -> Array:
    """Positions from the end of a movement to the start of the next, without both."""
    rest, step = pace
    start = before[-1]
    length = np.linalg.norm(np.diff(before, axis=0), axis=1).sum()
    speed = length / (stamps[-1] - stamps[0])
    seconds = max(_SHORTEST, float(np.linalg.norm(goal - start)) / speed if speed > 0 else 0.0)
    s = np.arange(1, max(2, round(seconds / step))) / max(2, round(seconds / step))
    if rest:
        s = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    still = round(0.5 * rest / step)
    path = start + s[:, None] * (goal - start)
    return np.concatenate((np.repeat(start[None], still, axis=0), path, np.repeat(goal[None], still, axis=0)))
