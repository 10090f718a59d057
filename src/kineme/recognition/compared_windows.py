"""Candidate windows of one recording, compared with the demonstrations as far as it can matter.

Nearly all windows of a long recording are far from every class. How far does not matter, except for how common a
distance is: that is estimated from some windows, which are compared completely.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.movements.segmentation.motion import Motion, Rows
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.recognition.candidate_windows import N_POINTS, resampled
from kineme.recognition.conformal import Calibration
from kineme.recognition.left_out import LEAST
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.runtime.parallel import for_tiles
from kineme.sampling import evenly_spaced
from kineme.similarity.comparison import Comparison
from kineme.similarity.most_similar import nearest_above
from kineme.similarity.references import References
from kineme.similarity.scores import Compared, Score, nearest, score
from kineme.validation import Array

_TILE, _AT_ONCE = 4096, 256  # windows between two calls of `progress`, and those that a thread describes at a time
_COMPLETELY = 65_536  # windows that are compared completely, evenly spaced: all those of a few minutes
_SLOW = 0.2  # share of the mean speed of a window below which it rests
_COMMON = 0.2  # share of the windows of a recording whose distance to a class, or less, is common
_OPERATIONS_PER_SAMPLE = 8  # of the size of a path
_RARITY = 0.3  # power with which distances count in common ones

Progress = Callable[[float], object]  # takes the share that is done


class Templates(NamedTuple):
    """What windows are compared with."""

    comparison: Comparison
    references: References
    calibration: Calibration


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

    def take(self, chosen: Any) -> ComparedWindows:
        """The chosen windows: a mask or indices."""
        return ComparedWindows(*(getattr(self, one.name)[chosen] for one in fields(self)))


class Candidates(NamedTuple):
    """n windows, compared as far as it can matter.

    Attributes
    ----------
    compared : ComparedWindows
    weights : ndarray of shape (C,)
        What the scores of each class are to be multiplied by, see `rarity_weights`.
    completely : ndarray of bool, shape (n,)
        Whether all scores of a window are known. Those of the others that exceed the reach, once weighted, are lower
        bounds that exceed it too.
    """

    compared: ComparedWindows
    weights: Array
    completely: NDArray[np.bool_]

    def weighted(self) -> ComparedWindows:
        """With weighted scores."""
        rows, scores, *others = (getattr(self.compared, one.name) for one in fields(self.compared))
        return ComparedWindows(rows, scores * self.weights, *others)


def compare_candidates(
    known: Templates, motion: Motion, rows: Rows, reach: float, progress: Progress | None = None
) -> Candidates:
    """Compare the windows from sample rows[:, 0] to rows[:, 1] with the references.

    Parameters
    ----------
    known : Templates
    motion : Motion
    rows : ndarray of shape (n, 2)
    reach : float
        Weighted nonconformity beyond which a window counts as far, however far it is.
    progress : callable, optional
        Called now and then with the share of the windows that is compared.
    """
    completely = np.zeros(len(rows), dtype=bool)
    completely[evenly_spaced(len(rows), _COMPLETELY)] = True
    share = completely.mean()
    some = compare_windows(known, motion, rows[completely], progress=_part(progress, 0.0, share))
    weights = rarity_weights(some.scores * known.calibration.scales)
    if completely.all():
        return Candidates(some, weights, completely)
    others = compare_windows(known, motion, rows[~completely], reach / weights, _part(progress, share, 1.0 - share))
    order = np.argsort(np.concatenate((np.flatnonzero(completely), np.flatnonzero(~completely))))
    both = (np.concatenate((getattr(some, one.name), getattr(others, one.name))) for one in fields(some))
    return Candidates(ComparedWindows(*both).take(order), weights, completely)


def _part(progress: Progress | None, begin: float, share: float) -> Progress | None:
    """Progress of a part of the work."""
    return None if progress is None else lambda done: progress(min(1.0, begin + done * share))


def compare_windows(
    known: Templates, motion: Motion, rows: Rows, within: Array | None = None, progress: Progress | None = None
) -> ComparedWindows:
    """Compare windows with the references, tile by tile, in threads.

    With `within` (C,), scores above that of the class may be lower bounds, which exceed it too.
    """
    start, end = motion.times[rows].T
    scores = np.empty((len(rows), len(known.references.classes)))
    sizes, slowness = np.empty((2, len(rows)))
    by = nearest if within is None else _nearest_within(known, within)

    def fill(begin: int, first: int, last: int) -> None:
        tile = slice(begin + first, begin + last)
        demos = Demonstrations.of_movements(resampled(motion, start[tile], end[tile]))
        paths = demos.positions.reshape(len(demos), N_POINTS, -1).transpose(0, 2, 1)
        sizes[tile], slowness[tile] = size_and_slowness(paths)
        scores[tile] = known.calibration.scores(score(known.comparison, known.references, demos, by)[0])

    for begin in range(0, len(rows), _TILE):
        n = min(_TILE, len(rows) - begin)
        for_tiles(partial(fill, begin), n, _AT_ONCE)
        if progress is not None:
            progress((begin + n) / len(rows))
    return ComparedWindows(rows, scores, np.log(end - start), sizes, slowness)


def _nearest_within(known: Templates, within: Array) -> Score:
    """Log similarity to the nearest reference of each class, exact where the nonconformity is within a bar (C,)."""
    bars = np.exp(-0.5 * (within * known.calibration.scales) ** 2)
    similarity, references = known.comparison.similarity, known.references

    def by(compared: Compared) -> Array:
        return nearest_above(similarity, compared.described, references.described, references.first, bars)

    return by


def size_and_slowness(paths: Array) -> tuple[Array, Array]:
    """Logarithm of the size of each path (n, d, T), and the share of its steps that are far below the mean step."""
    if use_compiled(_OPERATIONS_PER_SAMPLE * paths.size):
        size, slow = np.empty((2, len(paths)))
        samples = np.ascontiguousarray(paths.transpose(0, 2, 1))
        compiled_module("kineme.recognition._windows").fill_size_and_slowness(samples, _SLOW, size, slow)
        return np.log(np.maximum(size, np.finfo(float).tiny)), slow
    size = np.sqrt(paths.var(axis=2).sum(axis=1))
    steps = np.linalg.norm(np.diff(paths, axis=2), axis=1)
    slow = (steps <= _SLOW * steps.mean(axis=1, keepdims=True)).mean(axis=1)
    return np.log(np.maximum(size, np.finfo(float).tiny)), slow


def rarity_weights(distances: Array) -> Array:
    """Weights (C,) of scores, larger for classes that much of the recording is near to.

    Simple shapes are part of many movements: of a sphere drawn in space, a half is a circle. Scores of class c are
    divided by ``m_c^0.3``, with m_c the distance that a fifth of the windows is within, over the geometric mean of all
    classes.

    Parameters
    ----------
    distances : ndarray of shape (n, C)
        Of windows to the nearest demonstration of each class.
    """
    common = np.log(np.maximum(np.quantile(distances, _COMMON, axis=0), LEAST))
    return np.asarray(np.exp(_RARITY * (common.mean() - common)))
