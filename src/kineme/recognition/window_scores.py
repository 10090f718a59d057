"""How well candidate windows fit the known classes, given the tempo and the size of the whole recording."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.comparison.comparison import Comparison
from kineme.comparison.references import References
from kineme.comparison.scores import nearest, score
from kineme.movements.preparation.resample import relative_rows
from kineme.movements.segmentation.bouts import Rows
from kineme.movements.segmentation.motion import Motion
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.recognition.candidate_windows import N_POINTS, Surroundings, resampled
from kineme.recognition.conformal import Calibration
from kineme.recognition.left_out import LEAST
from kineme.validation import Array

_TILE = 4096  # windows described at a time
_REACH = 0.975  # nonconformity at which a window counts as far, in that which members exceed at the error rate
_TEMPO, _SIZE = 0.4, 0.2  # cost of a duration, or a size, e times what is expected
_DEAD = 0.1  # logarithm of a ratio of durations that costs nothing while the tempo of the recording is unknown
_EDGE, _FAR_FROM_REST, _SPANNED = 0.14, 0.03, 0.02  # costs of what surrounds a window
_REST_INSIDE = 1.2  # cost of a share of rest beyond the demonstrated one
_SLOW = 0.2  # share of the mean speed of a window below which it rests
_PER_MOVEMENT = 0.165  # cost of one more movement, in typical durations
_COMMON = 0.2  # share of the windows of a recording whose distance to a class, or less, is common
_RARITY = 0.3  # power with which distances count in common ones
_ALIKE = 0.9  # intersection over union from which two windows are about one movement
_MANNER = 0.25  # share of the costs of duration and size that counts when the class is chosen

Progress = Callable[[float], object]  # takes the share that is done


class Templates(NamedTuple):
    """What windows are compared with."""

    comparison: Comparison
    references: References
    calibration: Calibration


class Expected(NamedTuple):
    """Typical movements of C classes, each of shape (C,).

    Attributes
    ----------
    log_durations : ndarray or None
        None where no time stamps were given.
    log_sizes : ndarray
    slowness : ndarray
        Share of the duration that is slow.
    """

    log_durations: Array | None
    log_sizes: Array
    slowness: Array


@dataclass(frozen=True)
class Manner:
    """How a recording differs from the demonstrations as a whole: logarithms of ratios; None while unknown."""

    tempo: float | None = None
    size: float | None = None


@dataclass(frozen=True, eq=False)
class ComparedWindows:
    """n windows, compared with C classes.

    Attributes
    ----------
    rows : ndarray of shape (n, 2)
        First and last sample.
    scores : ndarray of shape (n, C)
        Nonconformity to each class.
    log_durations, log_sizes, slowness : ndarray of shape (n,)
        Slowness is the share of the duration that is slow.
    """

    rows: Rows
    scores: Array
    log_durations: Array
    log_sizes: Array
    slowness: Array


class ScoredWindows(NamedTuple):
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
    sizes, slowness = _size_and_slowness(relative_rows(demos, 0, len(demos), N_POINTS))
    lasting = durations_of(references)
    known = None if lasting is None else np.log(lasting)

    def medians(values: Array) -> Array:
        return np.array([np.median(values[one]) for one in references.slices()])

    return Expected(None if known is None else medians(known), medians(sizes), medians(slowness))


def _size_and_slowness(paths: Array) -> tuple[Array, Array]:
    """Logarithm of the size of each path (n, d, T), and the share of its steps that are far below the mean step."""
    size = np.sqrt(paths.var(axis=2).sum(axis=1))
    steps = np.linalg.norm(np.diff(paths, axis=2), axis=1)
    slow = (steps <= _SLOW * steps.mean(axis=1, keepdims=True)).mean(axis=1)
    return np.log(np.maximum(size, np.finfo(float).tiny)), slow


def compare_windows(known: Templates, motion: Motion, rows: Rows, progress: Progress | None = None) -> ComparedWindows:
    """Compare the windows from sample rows[:, 0] to rows[:, 1] with the references, tile by tile."""
    start, end = motion.times[rows].T
    scores = np.empty((len(rows), len(known.references.classes)))
    sizes, slowness = np.empty((2, len(rows)))
    for first in range(0, len(rows), _TILE):
        tile = slice(first, first + _TILE)
        demos = Demonstrations.of_movements(resampled(motion, start[tile], end[tile]))
        paths = demos.positions.reshape(len(demos), N_POINTS, -1).transpose(0, 2, 1)
        sizes[tile], slowness[tile] = _size_and_slowness(paths)
        scores[tile] = known.calibration.scores(score(known.comparison, known.references, demos, nearest)[0])
        if progress is not None:
            progress(min(1.0, (first + len(demos)) / len(rows)))
    return ComparedWindows(rows, scores, np.log(end - start), sizes, slowness)


def weighted_by_rarity(compared: ComparedWindows, distances: Array) -> ComparedWindows:
    """Scores of windows, larger for classes that much of the recording is near to.

    Simple shapes are part of many movements: of a sphere drawn in space, a half is a circle. Scores of class c are
    divided by ``m_c^0.3``, with m_c the distance that a fifth of the windows is within, over the geometric mean of all
    classes.
    """
    common = np.log(np.maximum(np.quantile(distances, _COMMON, axis=0), LEAST))
    return replace(compared, scores=compared.scores * np.exp(_RARITY * (common.mean() - common)))


def closest_classes(
    compared: ComparedWindows,
    distances: Array,
    typical: Expected,
    manner: Manner,
    spans: Array,
    chosen: list[int],
) -> NDArray[np.intp]:
    """Class of each chosen window: the closest to it, or to a window that has nine tenths of the union with it.

    Which window is chosen depends on its duration, its size, and what surrounds it; these differ between people. The
    class is that of the nearest demonstration, wherever exactly the movement starts and ends: the distance, not over
    the scale of the class, and a quarter of the costs of duration and size.

    Parameters
    ----------
    compared : ComparedWindows
        n windows, sorted by starts.
    distances : ndarray of shape (n, C)
        To the nearest demonstration of each class, in that at which a window counts as far.
    typical : Expected
    manner : Manner
    spans : ndarray of shape (n, 2)
        Start and end of each window [s].
    chosen : list of int
        Windows.
    """
    costs = distances + _MANNER * _manner_costs(compared, typical, manner)
    found = np.empty(len(chosen), dtype=np.intp)
    for k, i in enumerate(chosen):
        start, end = spans[i]
        reach = (1.0 / _ALIKE - 1.0) * (end - start)
        near = slice(*np.searchsorted(spans[:, 0], (start - reach, start + reach), side="right"))
        shared = np.minimum(spans[near, 1], end) - np.maximum(spans[near, 0], start)
        union = np.maximum(spans[near, 1], end) - np.minimum(spans[near, 0], start)
        found[k] = costs[near][shared >= _ALIKE * union].min(axis=0).argmin()
    return found


def far(error_rate: float) -> float:
    """Nonconformity at which a window counts as far."""
    return _REACH * math.sqrt(-4.0 / math.pi * math.log(error_rate))


def _manner_costs(compared: ComparedWindows, typical: Expected, manner: Manner) -> Array:
    """Costs (n, C) of another duration, and another size, than those of the class in this recording."""
    costs = np.zeros(compared.scores.shape)
    if typical.log_durations is not None:
        ratio = compared.log_durations[:, None] - typical.log_durations
        if manner.tempo is None:
            costs += 0.5 * _TEMPO * np.maximum(np.abs(ratio) - _DEAD, 0.0) ** 2
        else:
            costs += _TEMPO * (ratio - manner.tempo) ** 2
    if manner.size is not None:
        costs += _SIZE * (compared.log_sizes[:, None] - typical.log_sizes - manner.size) ** 2
    return costs


def score_windows(
    compared: ComparedWindows, typical: Expected, around: Surroundings, manner: Manner, error_rate: float
) -> ScoredWindows:
    """Scores of windows, such that a chain of windows is better the larger its sum.

    The cost of a window is its nonconformity to the class, in that at which a window counts as far, plus squared
    logarithms of the ratios of its duration and size to those expected, plus costs of ends in motion and of rests
    inside. The score is ``(1 - cost) * duration / typical duration`` where positive, less a cost per movement: so that
    a whole movement is preferred to its parts, and no part of it is a movement by chance.
    """
    costs = compared.scores / far(error_rate) + _manner_costs(compared, typical, manner)
    lasting = compared.log_durations
    usual = float(np.median(lasting)) if typical.log_durations is None else float(np.median(typical.log_durations))
    usual += manner.tempo or 0.0
    costs += _REST_INSIDE * np.maximum(compared.slowness[:, None] - typical.slowness, 0.0)
    best = costs.argmin(axis=1)
    closeness = 1.0 - costs[np.arange(len(best)), best]
    closeness -= _EDGE * around.edge_speeds + _FAR_FROM_REST * around.far_from_rest
    closeness -= _SPANNED * around.rests_inside
    return ScoredWindows(best, np.maximum(closeness, 0.0) * np.exp(lasting - usual) - _PER_MOVEMENT)


def manner_of(compared: ComparedWindows, typical: Expected, chosen: list[int], best: NDArray[np.intp]) -> Manner:
    """The manner of a recording by the windows that are chosen; its tempo is shrunk towards that demonstrated."""
    if not chosen:
        return Manner()
    classes = best[chosen]
    manner = Manner(size=float(np.median(compared.log_sizes[chosen] - typical.log_sizes[classes])))
    if typical.log_durations is None:
        return manner
    ratio = float(np.median(compared.log_durations[chosen] - typical.log_durations[classes]))
    return replace(manner, tempo=ratio * len(chosen) / (len(chosen) + 1.0))
