"""How well candidate windows fit the known classes, given the tempo and the size of the whole recording."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.comparison.comparison import Comparison
from kineme.comparison.describe import describe
from kineme.comparison.references import References
from kineme.comparison.scores import nearest, score
from kineme.movements.segmentation.bouts import Rows
from kineme.movements.segmentation.motion import Motion
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.recognition.candidate_windows import N_POINTS, Surroundings, resampled
from kineme.recognition.conformal import Calibration
from kineme.validation import Array

_TILE = 4096  # windows described at a time
_NEAR = 1.0  # share of windows, those nearest by their positions, that are compared in every representation
_FAR = -1e3  # log similarity of the others
_REACH = 1.115  # nonconformity at which a window counts as far, in that which members exceed at the error rate
_TEMPO, _SIZE = 0.36, 0.14  # cost of a duration, or a size, e times what is expected
_DEAD = 0.1  # logarithm of a ratio of durations that costs nothing while the tempo of the recording is unknown
_EDGE, _FAR_FROM_REST, _AT_REST, _SPANNED = 0.1, 0.05, 0.5, 0.02  # costs of what surrounds a window
_PER_MOVEMENT = 0.18  # cost of one more movement, in typical durations


class Expected(NamedTuple):
    """Logarithms of the typical durations and sizes of C classes, (C,); None where no time stamps were given."""

    log_durations: Array | None
    log_sizes: Array


@dataclass(frozen=True)
class Manner:
    """How a recording differs from the demonstrations as a whole: logarithms of ratios; None while unknown."""

    tempo: float | None = None
    size: float | None = None


@dataclass(frozen=True, eq=False)
class Compared:
    """n windows, compared with C classes: similarities (n, C), durations [s], sizes, and what surrounds them."""

    similarities: Array
    log_durations: Array
    log_sizes: Array
    around: Surroundings


class Scored(NamedTuple):
    """Best class of each window and its score, (n,); above 0 where it counts as known."""

    best: NDArray[np.intp]
    score: Array


def durations_of(references: References) -> Array | None:
    """Durations of the references; None where their arrays came without time stamps, so that none is known."""
    demos = references.all_movements()
    return None if demos.movements.times is None else demos.durations


def expected(references: References) -> Expected:
    """Medians over the references of each class."""
    demos = references.all_movements()
    sizes = np.log(np.maximum([np.sqrt(one.positions.var(axis=0).sum()) for one in demos], np.finfo(float).tiny))
    lasting = durations_of(references)
    known = None if lasting is None else np.log(lasting)

    def medians(values: Array) -> Array:
        return np.array([np.median(values[one]) for one in references.slices()])

    return Expected(None if known is None else medians(known), medians(sizes))


def compare_windows(
    comparison: Comparison, references: References, motion: Motion, rows: Rows, around: Surroundings
) -> Compared:
    """Compare the windows from sample rows[:, 0] to rows[:, 1] with the references, tile by tile."""
    start, end = motion.times[rows].T
    similarities = np.empty((len(rows), len(references.classes)))
    sizes = np.empty(len(rows))
    for first in range(0, len(rows), _TILE):
        tile = slice(first, first + _TILE)
        demos = Demonstrations.of_movements(resampled(motion, start[tile], end[tile]))
        points = demos.positions.reshape(len(demos), N_POINTS, -1)
        sizes[tile] = np.sqrt(points.var(axis=1).sum(axis=1))
        similarities[tile] = _similarities(comparison, references, demos)
    logs = np.log(np.maximum(sizes, np.finfo(float).tiny))
    return Compared(similarities, np.log(end - start), logs, around)


def _similarities(comparison: Comparison, references: References, demos: Demonstrations) -> Array:
    """Log similarities (n, C) to the nearest reference of each class; of those that are far by their positions, low."""
    described = describe(demos, comparison)
    stored = references.described
    if described.pairs is None or stored.pairs is None or _NEAR >= 1:
        return score(comparison, references, described, nearest)[0]
    away = comparison.procrustes.squared_distances(described.pairs.positions, stored.pairs.positions).min(axis=1)
    near = np.flatnonzero(away <= np.quantile(away, _NEAR))
    found = np.full((len(described), len(references.classes)), _FAR)
    (found[near],) = score(comparison, references, described.take(near), nearest)
    return found


def score_windows(
    compared: Compared, calibration: Calibration, typical: Expected, manner: Manner, error_rate: float
) -> Scored:
    """Scores of windows, such that a chain of windows is better the larger its sum.

    The cost of a window is its nonconformity to the class, in that at which a window counts as far, plus squared
    logarithms of the ratios of its duration and size to those expected, plus costs of ends in motion and of rests
    inside. The score is ``(1 - cost) * duration / typical duration`` where positive, less a cost per movement: so that
    a whole movement is preferred to its parts, and no part of it is a movement by chance.
    """
    reach = _REACH * math.sqrt(-4.0 / math.pi * math.log(error_rate))
    costs = calibration.scores(compared.similarities) / reach
    lasting = compared.log_durations
    usual = float(np.median(lasting)) if typical.log_durations is None else float(np.median(typical.log_durations))
    if typical.log_durations is not None:
        ratio = lasting[:, None] - typical.log_durations
        if manner.tempo is None:
            costs += 0.5 * _TEMPO * np.maximum(np.abs(ratio) - _DEAD, 0.0) ** 2
        else:
            costs += _TEMPO * (ratio - manner.tempo) ** 2
            usual += manner.tempo
    if manner.size is not None:
        costs += _SIZE * (compared.log_sizes[:, None] - typical.log_sizes - manner.size) ** 2
    best = costs.argmin(axis=1)
    around = compared.around
    closeness = 1.0 - costs[np.arange(len(best)), best]
    closeness -= _EDGE * around.edge_speeds + _FAR_FROM_REST * around.far_from_rest
    closeness -= _AT_REST * around.at_rest + _SPANNED * around.rests_inside
    return Scored(best, np.maximum(closeness, 0.0) * np.exp(lasting - usual) - _PER_MOVEMENT)


def manner_of(compared: Compared, typical: Expected, chosen: list[int], best: NDArray[np.intp]) -> Manner:
    """Tempo and size of a recording by the windows that are chosen; the tempo is shrunk towards that demonstrated."""
    if not chosen:
        return Manner()
    classes = best[chosen]
    manner = Manner(size=float(np.median(compared.log_sizes[chosen] - typical.log_sizes[classes])))
    if typical.log_durations is None:
        return manner
    ratio = float(np.median(compared.log_durations[chosen] - typical.log_durations[classes]))
    return replace(manner, tempo=ratio * len(chosen) / (len(chosen) + 1.0))
