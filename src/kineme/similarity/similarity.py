"""The kernel averaged over representations: the similarity of movements."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError
from kineme.kernels.procrustes import Procrustes
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.similarity.describe import describe
from kineme.similarity.described import Described, squared_distances
from kineme.similarity.specification import LOG_MEANS, Compares
from kineme.similarity.widths import gap_widths
from kineme.validation import Array

_TILE_PAIRS = 500_000  # at a time: each representation's kernel is held beside the average


@dataclass(frozen=True, eq=False)
class AveragedSimilarity:
    """An A-average of one RBF kernel per representation, each on its own distance, see `squared_distances`.

    ``k_r(a, b) = exp(-d_r(a, b)^2 / (2 sigma_r^2))`` and ``K = mean_r k_r``, or ``sum_r w_r k_r``. Each kernel is
    narrow and bounded: a representation in which two movements are far contributes nothing, while in a sum of distances
    it would dominate the others. Logarithms keep the order of movements that are far in every representation, where
    each k_r underflows.

    The arithmetic mean is positive semi-definite where each k_r is: with ``max_angle = 0`` and representations that are
    compared sample by sample. Procrustes distances and those of pairs are not Euclidean, and no claim is made for them.
    """

    procrustes: Procrustes
    widths: Array  # (R,), the sigma_r
    mean: str = "arithmetic"
    weights: Array | None = None  # (R,) or None, at least 0, summing to 1; equal if None

    def squared_distances(self, A: Described, B: Described) -> Array:
        """Return squared distances in each representation, shape (R, n, m)."""
        return squared_distances(A, B)

    def logs_at(self, squares: Array) -> Array:
        """Return logarithms of each kernel times R times its weight, of squared distances (R, n, m)."""
        logs = np.asarray(squares / (-2.0 * self.widths**2)[:, None, None])
        if self.weights is not None and (self.weights != self.weights[0]).any():
            logs += self.log_weights()[:, None, None]
        return logs

    def logs(self, A: Described, B: Described) -> Array:
        """Return the logarithms of each representation's kernel times R times its weight, shape (R, n, m)."""
        return self.logs_at(self.squared_distances(A, B))

    def log_average(self, A: Described, B: Described) -> Array:
        """Return the logarithms of the averaged kernel, shape (n, m)."""
        return LOG_MEANS[self.mean](self.logs(A, B))

    def by_rows(self, n: int) -> AveragedSimilarity:
        """Return the average over the first n representations alone; of equal weights where theirs are all 0."""
        if n == len(self.widths):
            return self
        weights = None if self.weights is None or not self.weights[:n].any() else self.weights[:n]
        weights = None if weights is None else weights / weights.sum()
        return replace(self, widths=self.widths[:n], weights=weights)

    def log_weights(self) -> Array:
        """Return logarithms of R times the weights, (R,): -inf for positions of weight 0, which give the rotation."""
        if self.weights is None:
            return np.zeros(len(self.widths))
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(len(self.weights) * self.weights))

    def widened(self, factor: float) -> AveragedSimilarity:
        """Return the same average of kernels `factor` times as wide."""
        return replace(self, widths=factor * self.widths)


def similarities(
    movements: Described | MovementsLike, like: Compares | None = None, widths: ArrayLike | None = None
) -> Array:
    """Return the averaged kernel ``K(a, b)`` between all movements, shape (n, n), from 0 to 1 and 1 on the diagonal.

    Parameters
    ----------
    movements : Described, or movements as `Demonstrations.of` accepts them
    like : Recognizer, Comparison or ComparisonSpecification, optional
        Whose representations, invariances and mean to take; it need not be fitted, and its labels are not used.
    widths : array_like of shape (R,), optional
        Of each representation; by default `gap_widths`.
    """
    described = describe(movements, like)
    K = compare(averaged(described, widths), described, described)
    K = 0.5 * (K + K.T)
    np.fill_diagonal(K, 1.0)
    return np.asarray(K)


def averaged(described: Described, widths: ArrayLike | None = None) -> AveragedSimilarity:
    """Return the averaged kernel at the widths given, or at those that the movements suggest, see `gap_widths`.

    Raises
    ------
    SpecificationError
        Not one positive width for each representation.
    """
    sigma = gap_widths(described) if widths is None else np.asarray(widths, dtype=np.float64)
    n = described.n_representations
    if sigma.shape != (n,) or not (sigma > 0).all():
        raise SpecificationError(
            f"expected widths to be {n} numbers above 0, one for each representation, got {widths!r}"
        )
    return AveragedSimilarity(described.procrustes, sigma, described.mean)


def compare(similarity: AveragedSimilarity, A: Described, B: Described) -> Array:
    """Return the averaged kernel between movements, shape (n, m)."""
    K = np.empty((len(A), len(B)))
    step = max(1, _TILE_PAIRS // max(1, len(B)))
    for start in range(0, len(A), step):
        rows = slice(start, start + step)
        K[rows] = np.exp(similarity.log_average(A.take(rows), B))
    return K
