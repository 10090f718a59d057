"""How well candidate windows fit the known classes, given the tempo and the size of the whole recording."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.comparison.references import References
from kineme.movements.preparation.resample import relative_rows
from kineme.recognition.candidate_windows import N_POINTS, Surroundings
from kineme.recognition.compared_windows import ComparedWindows, size_and_slowness
from kineme.validation import Array

_REACH = 0.975  # nonconformity at which a window counts as far, in that which members exceed at the error rate
_TEMPO, _SIZE = 0.4, 0.2  # cost of a duration, or a size, e times what is expected
_DEAD = 0.1  # logarithm of a ratio of durations that costs nothing while the tempo of the recording is unknown
_EDGE, _FAR_FROM_REST, _SPANNED = 0.14, 0.03, 0.02  # costs of what surrounds a window
_REST_INSIDE = 1.2  # cost of a share of rest beyond the demonstrated one
_PER_MOVEMENT = 0.165  # cost of one more movement, in typical durations
_ALIKE = 0.9  # intersection over union from which two windows are about one movement
_MANNER = 0.25  # share of the costs of duration and size that counts when the class is chosen


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
    sizes, slowness = size_and_slowness(relative_rows(demos, 0, len(demos), N_POINTS))
    lasting = durations_of(references)
    known = None if lasting is None else np.log(lasting)

    def medians(values: Array) -> Array:
        return np.array([np.median(values[one]) for one in references.slices()])

    return Expected(None if known is None else medians(known), medians(sizes), medians(slowness))


def alike_windows(spans: Array, chosen: list[int]) -> list[NDArray[np.intp]]:
    """Of each chosen window, those that have nine tenths of the union with it, itself among them.

    `spans` (n, 2) are start and end of each [s], sorted by starts.
    """
    found = []
    for i in chosen:
        start, end = spans[i]
        reach = (1.0 / _ALIKE - 1.0) * (end - start)
        first, last = np.searchsorted(spans[:, 0], (start - reach, start + reach), side="right")
        near = spans[first:last]
        shared = np.minimum(near[:, 1], end) - np.maximum(near[:, 0], start)
        union = np.maximum(near[:, 1], end) - np.minimum(near[:, 0], start)
        found.append(first + np.flatnonzero(shared >= _ALIKE * union))
    return found


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
    return np.array([costs[near].min(axis=0).argmin() for near in alike_windows(spans, chosen)], dtype=np.intp)


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
