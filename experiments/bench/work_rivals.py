"""Rules of other audits of robot data, written anew from their descriptions: fixed thresholds, no error rate.

The programs themselves were run once on a set with planted faults; what they said is told in `bench.motion_layer`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.work_sets import ACTION, STATE, Array
from kineme.movements.episodes import Episode
from kineme.sampling import runs


class Verdicts(NamedTuple):
    """What a rule says of the episodes of a set."""

    scores: Array  # (n,), the larger the worse
    flagged: NDArray[np.bool_]  # (n,)


def jerk_and_fences(episodes: Sequence[Episode]) -> Verdicts:
    """Flag mean jerk beyond three standard deviations, or durations beyond Tukey's fences of 1.5 interquartile ranges.

    What threads about RDT-1B and lingbot-vla-v2 describe, and what `is_time_outlier` of score_lerobot_episodes does.
    """
    jerks = np.log([np.abs(np.diff(episode.signals[STATE], 3, axis=0)).mean() * episode.fps**3 for episode in episodes])
    seconds = np.array([episode.times[-1] - episode.times[0] for episode in episodes])
    z = np.abs(jerks - jerks.mean()) / jerks.std()
    low, high = np.quantile(seconds, (0.25, 0.75))
    beyond = np.maximum(low - seconds, seconds - high) / (high - low)
    return Verdicts(np.maximum(z / 3.0, beyond / 1.5), (z > 3.0) | (beyond > 1.5))


def score_lerobot_episodes(episodes: Sequence[Episode]) -> Verdicts:
    """Average smoothness, efficiency, collisions, stillness at the end and duration; below 0.5 is bad.

    The criteria of https://github.com/RoboticsData/score_lerobot_episodes that need no camera and no language model:
    exp(-rms acceleration / 1000); straight line over path; share of frames whose acceleration is below 15 medians;
    exp(-standard deviation in the last 2 s / 0.05); 1 within Tukey's fences of the duration, else 0.
    """
    seconds = np.array([episode.times[-1] - episode.times[0] for episode in episodes])
    low, high = np.quantile(seconds, (0.25, 0.75))
    beyond = np.maximum(low - seconds, seconds - high) > 1.5 * (high - low)
    scores = []
    for episode, late in zip(episodes, beyond.tolist(), strict=True):
        q, t = episode.signals[STATE], episode.times
        steps = np.maximum(np.diff(t), 1e-3)
        acceleration = np.abs(np.diff(q, 2, axis=0)) / steps[:-1, None] ** 2
        collided = (acceleration > 15.0 * np.median(acceleration, axis=0)).any(axis=1).mean()
        path = np.linalg.norm(np.diff(q, axis=0), axis=1).sum()
        still = np.std(q[t >= t[-1] - 2.0], axis=0).mean()
        smooth, straight = np.exp(-np.sqrt((acceleration**2).mean()) / 1000.0), np.linalg.norm(q[-1] - q[0]) / path
        scores.append(np.mean((smooth, straight, 1.0 - collided, np.exp(-still / 0.05), 1.0 - late)))
    return Verdicts(-np.array(scores), np.array(scores) < 0.5)


def lerobot_doctor(episodes: Sequence[Episode]) -> Verdicts:
    """Flag short episodes, stamps out of order, gaps of 2.5 steps, actions that stand still or jump; or a low score.

    The checks of each episode and the score of lerobot-doctor 0.2.0. Bad is what it lists, or scores below 30 of 100
    or two standard deviations under the mean.
    """
    steps = [np.diff(episode.signals[ACTION], axis=0) for episode in episodes]
    spread = np.concatenate(steps).std(axis=0)
    spread[spread == 0.0] = 1.0
    means = np.array([episode.signals[ACTION].mean(axis=0) for episode in episodes])
    usual = np.median([len(episode) for episode in episodes])
    z = np.abs((means - means.mean(axis=0)) / np.maximum(means.std(axis=0), 1e-6)).mean(axis=1)
    listed, scores = [], []
    for episode, step, away in zip(episodes, steps, z.tolist(), strict=True):
        gaps = np.diff(episode.times)
        still = _longest((step == 0.0).all(axis=1)) / len(episode)
        jumps = (np.abs(step / spread).mean(axis=1) > 8.0).sum()
        wrong = (
            len(episode) < episode.fps,
            (gaps <= 0).any(),
            (gaps > 2.5 / episode.fps).any(),
            still >= 0.05,
            jumps > 0,
        )
        listed.append(sum(map(bool, wrong)))
        ratio = len(episode) / usual
        fit = 100.0 * ratio if ratio < 0.3 else 100.0 / ratio if ratio > 3.0 else 50.0 + 50.0 * min(ratio, 1.0 / ratio)
        smooth = 100.0 * np.exp(-30.0 * np.abs(np.diff(step, axis=0)).mean())
        coverage = min(200.0 * episode.signals[ACTION].std(axis=0).mean(), 100.0)
        scores.append(0.3 * smooth + 0.25 * coverage + 0.25 * 100.0 * np.exp(-away) + 0.2 * fit)
    quality, faults = np.array(scores), np.array(listed)
    low = (quality < 30.0) | (quality < quality.mean() - 2.0 * quality.std())
    return Verdicts(faults - quality / 100.0, (faults > 0) | low)


def robot_data_audit(episodes: Sequence[Episode]) -> Verdicts:
    """Flag gaps of 2.5 steps, missing values, stamps that go back, and episodes that stand still.

    What leads to EXCLUDE in robot-data-audit 0.11.0, as far as no camera and no limits of joints are needed. Episodes
    are ranked by that and by its count of jumps of the action: second differences beyond five median deviations.
    """
    wrong, jumps = [], []
    for episode in episodes:
        gaps, action = np.diff(episode.times), episode.signals[ACTION]
        second = np.abs(np.diff(action, 2, axis=0))
        spread = 1.4826 * np.median(np.abs(second - np.median(second, axis=0)), axis=0)
        missing = any(not np.isfinite(values).all() for values in episode.signals.values())
        still = (np.abs(np.diff(action, axis=0)).max(axis=1) > 1e-6).mean() < 0.02
        wrong.append(missing or still or bool((gaps < 0).any() or (gaps > 2.5 * np.median(gaps)).any()))
        jumps.append((second > np.median(second, axis=0) + 5.0 * np.maximum(spread, 1e-6)).mean())
    return Verdicts(np.array(wrong) + np.array(jumps), np.array(wrong))


#: Name -> rule.
RIVALS: Mapping[str, Callable[[Sequence[Episode]], Verdicts]] = {
    "jerk and interquartile fences": jerk_and_fences,
    "score_lerobot_episodes' criteria": score_lerobot_episodes,
    "lerobot-doctor's rules": lerobot_doctor,
    "robot-data-audit's rules": robot_data_audit,
}


def _longest(true: NDArray[np.bool_]) -> int:
    """Length of the longest run."""
    return int(np.diff(runs(true), axis=1).max(initial=0))
