"""Described movements compared with the references: similarities and scores, computed once and only if needed.

The most similar of many movements, without the distances of pairs that cannot change which one it is.

The arithmetic mean ``K = sum_r w_r exp(-d_r^2 / 2 sigma_r^2)`` is largest for one movement. The distances of rows are
known for all. For the movement that is most similar by them the others are computed too, and its K is a bar that the
answer reaches. Lower bounds of the elastic and turning distances, and the distances of point clouds, bound K from
above; only pairs whose bound reaches the bar are compared completely. Where only similarities above a given bar count,
no more than that is needed either.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from operator import attrgetter
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from kineme.kernels.pair_distances import listed_distances, pair_bounds
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.runtime.parallel import for_tiles
from kineme.similarity.comparison import Comparison, References
from kineme.similarity.describe import Described, Pairs, fill_by_rows, for_described, measure_pairs
from kineme.similarity.similarity import AveragedSimilarity
from kineme.similarity.specification import LOG_MEANS, PAIR_QUANTITIES, SHARES
from kineme.validation import Array

Single = NDArray[np.float32]
Indices = NDArray[np.intp]

_LEAST_ASKED, _LEAST_PAIRS = 16, 500  # with fewer it is faster to compare all
_ROUNDING, _SMALLEST = 1e-3, 1e-30  # of a bar: bounds are computed in single precision
_MANY, _MOST = 0.4, 0.8  # shares of pairs in doubt from which it is faster to bound them, and to compare all

_TILE_PAIRS = 1_000_000  # similarities at a time: memory stays linear in the stored movements


@dataclass(frozen=True, eq=False)
class Compared:
    """n described movements, compared with m references of C classes."""

    comparison: Comparison
    references: References
    described: Described

    def __len__(self) -> int:
        return len(self.described)

    def with_squares(self, squares: Array) -> Compared:
        """Return the same with `squares` that were computed before."""
        same = replace(self)
        vars(same)["squares"] = squares
        return same

    @cached_property
    def squares(self) -> Array:
        """Squared distances in each representation, (R, n, m)."""
        return self.comparison.similarity.squared_distances(self.described, self.references.described)

    @cached_property
    def logs(self) -> Array:
        """Logarithms of each representation's kernel times R times its weight, (R, n, m)."""
        return self.comparison.similarity.logs_at(self.squares)

    @cached_property
    def log_average(self) -> Array:
        """Logarithms of the averaged kernel, (n, m)."""
        return LOG_MEANS[self.comparison.mean](self.logs)

    @cached_property
    def nearest(self) -> Array:
        """Log similarity to the nearest reference of each class, (n, C)."""
        return nearest_of(self.log_average, self.references)

    @cached_property
    def nearest_each(self) -> Array:
        """Log similarity to each class, in each representation to its own nearest reference of the class, (n, C)."""
        each = np.maximum.reduceat(self.logs, self.references.first, axis=2)
        return LOG_MEANS[self.comparison.mean](each)

    def shares(self, chosen: NDArray[np.intp]) -> Array:
        """Return the share of each representation in the similarity to one chosen (n,) reference each, (R, n)."""
        return SHARES[self.comparison.mean](self.logs[:, np.arange(len(self)), chosen])


class Classifier(Protocol):
    """A fitted classifier: scores of each class, and by which similarity a movement is known."""

    def scores(self, compared: Compared) -> Array:
        """Return a score per class, shape (n, C): larger is more like it."""
        ...

    def best(self, compared: Compared) -> NDArray[np.intp]:
        """Return the index (n,) of the class with the largest score."""
        return self.scores(compared).argmax(axis=1)

    def nearest_logs(self, compared: Compared) -> Array:
        """Return log similarity (n, C) to the nearest reference of each class, by which a movement is known."""
        return compared.nearest

    def logs_among(self, logs: Array, chosen: Indices) -> Array:
        """Return such similarities of chosen references to all, (k, m); `logs` are those of the averaged kernel."""
        return logs


def nearest_of(logs: Array, references: References) -> Array:
    """Return the largest (n, C) of log similarities (n, m) to the references of each class."""
    return np.asarray(np.maximum.reduceat(logs, references.first, axis=1))


Score = Callable[[Compared], Array]


nearest: Score = attrgetter("nearest")
nearest_each: Score = attrgetter("nearest_each")


def score(
    comparison: Comparison, references: References, movements: Demonstrations | Described, *scores: Score
) -> tuple[Array, ...]:
    """Return scores (n, C), one array for each of the functions, of movements that are described once, tile by tile."""
    arrays = tuple(np.empty((len(movements), len(references.classes))) for _ in scores)

    def fill(rows: slice, compared: Compared) -> None:
        for array, by in zip(arrays, scores, strict=True):
            array[rows] = by(compared)

    if isinstance(movements, Described):
        described = movements
        for_tiles(
            lambda a, b: fill(slice(a, b), Compared(comparison, references, described.take(slice(a, b)))),
            len(described),
            tile_rows(references),
        )
    else:
        for_compared(comparison, references, movements, fill)
    return arrays


def for_compared(
    comparison: Comparison, references: References, demos: Demonstrations, work: Callable[[slice, Compared], None]
) -> None:
    """Describe movements tile by tile, in threads, and hand each tile on with its comparison."""
    for_described(
        demos,
        comparison,
        comparison.procrustes,
        lambda rows, described: work(rows, Compared(comparison, references, described)),
        tile_rows(references),
    )


def tile_rows(references: References) -> int:
    """Return movements to compare at a time."""
    return max(1, _TILE_PAIRS // len(references))


def most_similar(similarity: AveragedSimilarity, A: Described, B: Described) -> Indices:
    """Return the index (n,) of the movement of B that each of A is most similar to; of several the first."""
    if not _can_skip(similarity, A, B):
        return np.asarray(similarity.log_average(A, B).argmax(axis=1))
    search, kernels = _by_rows(similarity, A, B)
    each, first = np.arange(len(A)), kernels.argmax(axis=1)
    logs = np.full(kernels.shape, -np.inf)
    logs[each, first] = search.log_averages(each, first)
    bars = _rounded(np.exp(logs[each, first]))
    bounds = kernels + search.upper_bounds()
    bounds[each, first] = -1.0  # compared already
    i, j = np.divmod(np.flatnonzero(bounds >= bars[:, None]), len(B))
    logs[i, j] = search.log_averages(i, j)
    return np.asarray(logs.argmax(axis=1))


def nearest_above(similarity: AveragedSimilarity, A: Described, B: Described, first: Indices, bars: Array) -> Array:
    """Return log similarity (n, C) of movements A to the nearest of each class, where it reaches the bar of the class.

    Elsewhere it is an upper bound, which does not reach the bar either.

    `A`: n movements; `B`: m movements of C classes, ordered by class; `first` (C,): index of the first movement of each
    class; `bars` (C,), or (n, C) for each movement its own: averaged kernels K, from 0 to 1; infinite ones are never
    reached.
    """
    if not _can_skip(similarity, A, B):
        return _nearest(similarity, A, B, first)
    assert B.pairs is not None
    # Bars are higher here: elastic and turning bounds decide most pairs at a quarter of the price of those with clouds.
    clouds = np.array(B.pairs.measures) % len(PAIR_QUANTITIES) == PAIR_QUANTITIES.index("cloud")
    low = bars <= float(_shares(similarity)[len(B.blocks) :][clouds].sum())
    if low.all():  # no K below it can be ruled out
        return _nearest(similarity, A, B, first)
    search, kernels = _by_rows(similarity, A, B)
    classes = np.repeat(np.arange(len(first)), np.diff(first, append=len(B)))
    least = _rounded(bars).astype(np.float32)[..., classes]
    bounds = kernels + search.others
    doubtful = bounds >= least
    if (doubtful & ~low[..., classes]).mean() > _MANY:
        bounds = kernels + search.upper_bounds(clouds=False)
        doubtful = bounds >= least
    if doubtful.mean() > _MOST:
        return _nearest(similarity, A, B, first)
    i, j = np.divmod(np.flatnonzero(doubtful), len(B))
    bounds[i, j] = 0.0
    bounds = np.maximum.reduceat(bounds, first, axis=1)
    logs: Array = np.log(np.maximum(bounds, _SMALLEST), dtype=np.float64)
    if len(i):
        np.maximum.at(logs, (i, classes[j]), search.log_averages(i, j))
    return logs


def _nearest(similarity: AveragedSimilarity, A: Described, B: Described, first: Indices) -> Array:
    """Compare all."""
    return np.asarray(np.maximum.reduceat(similarity.log_average(A, B), first, axis=1))


def _shares(similarity: AveragedSimilarity) -> Single:
    """Return weights (R,) of the kernels, which add up to 1."""
    return (np.exp(similarity.log_weights()) / len(similarity.widths)).astype(np.float32)


def _rounded(bars: Array) -> Array:
    """Return bars that bounds reach in spite of rounding, 0 for those that are too small for single precision."""
    return np.where(bars > _SMALLEST, (1 - _ROUNDING) * bars, 0.0)


def _by_rows(similarity: AveragedSimilarity, A: Described, B: Described) -> tuple[_Search, Single]:
    """Compare rows of all pairs; return the search, and the weighted sum (n, m) of their kernels."""
    assert A.pairs is not None
    assert B.pairs is not None
    squares = np.empty((len(A.blocks), len(A), len(B)))
    search = _Search(similarity, A.pairs, B.pairs, squares, fill_by_rows(A, B, squares))
    return search, search.kernels(squares, 0)


def _can_skip(similarity: AveragedSimilarity, A: Described, B: Described) -> bool:
    """Tell whether there are bounds, and enough pairs that they pay."""
    elastic = A.pairs is not None and PAIR_QUANTITIES.index("elastic") in A.pairs.measures
    enough = len(A) >= _LEAST_ASKED and len(A) * len(B) >= _LEAST_PAIRS
    return elastic and similarity.mean == "arithmetic" and enough


class _Search:
    """Search among all pairs (n, m) by squared distances of rows (R', n, m) and rotations."""

    def __init__(
        self, similarity: AveragedSimilarity, a: Pairs, b: Pairs, squares: Array, rotations: Single | None
    ) -> None:
        self._similarity, self._a, self._b = similarity, a, b
        self._squares, self._rotations = squares, rotations
        self._shares = _shares(similarity)

    def kernels(self, squares: NDArray[np.floating], first: int) -> Single:
        """Return the weighted sum (n, m) of the kernels of some representations, from number `first` on."""
        total = np.zeros(squares.shape[1:], np.float32)
        for r, block in enumerate(squares, first):
            width = self._similarity.widths[r]
            kernel = np.asarray(block * np.float32(-0.5 / width**2), dtype=np.float32)
            total += self._shares[r] * np.exp(kernel, out=kernel)
        return total

    @property
    def others(self) -> np.float32:
        """Weighted sum of the kernels of the other representations at distance 0."""
        return np.float32(self._shares[len(self._squares) :].sum())

    def upper_bounds(self, *, clouds: bool = True) -> Single:
        """Return upper bounds (n, m) of the weighted sum of the others; without `clouds` these count in full."""
        bounds = measure_pairs(self._a, self._b, self._rotations, partial(pair_bounds, clouds=clouds))
        return self.kernels(bounds, len(self._squares))

    def log_averages(self, i: Indices, j: Indices) -> Array:
        """Return the logarithms (k,) of the averaged kernels of some pairs."""
        rotations = None if self._rotations is None else self._rotations[i, j]
        measured = measure_pairs(self._a, self._b, rotations, listed_distances, i, j)
        squares: Array = np.concatenate((self._squares[:, i, j], measured))
        return np.asarray(LOG_MEANS["arithmetic"](self._similarity.logs_at(squares[:, None]))[0])
