"""Median widths of the kernels from the training rows of each leave-one-out split, all splits at once."""

from __future__ import annotations

import numpy as np

from kineme.kernels import RBF, TruncatedEuclidean
from kineme.kernels.base import Kernel
from kineme.validation import Array


def fit_by_split(kernel: RBF | TruncatedEuclidean, X: Array) -> list[Kernel]:
    """``[kernel.fit(X without row i) for i in range(n)]``: widths from the training rows of each split.

    The differences of all pairs of rows are computed and sorted once. For up to about a hundred rows, for which `fit`
    uses every pair too.
    """
    first, second = np.triu_indices(len(X), 1)
    differences = np.abs(X[first] - X[second])
    if isinstance(kernel, RBF):
        distances = np.sqrt((differences**2).sum(axis=1, keepdims=True))
        return [RBF(sigma) for sigma in medians_without_each(distances, len(X))]
    return [TruncatedEuclidean(m, kernel.sigma) for m in medians_without_each(differences, len(X))]


def medians_without_each(values: Array, n: int) -> list[float]:
    """For each of n rows, the median of the positive values of all pairs without that row.

    Parameters
    ----------
    values : ndarray of shape (n (n - 1) / 2, p)
        Values of the pairs ``np.triu_indices(n, 1)``.
    """
    rank = np.full(values.size, -1)  # rank of each positive value among all of them
    order = np.argsort(values, axis=None, kind="stable")
    order = order[np.count_nonzero(values <= 0) :]
    rank[order] = np.arange(len(order))
    by_pair = rank.reshape(values.shape)
    ascending = values.reshape(-1)[order]
    first, second = np.triu_indices(n, 1)
    medians = []
    for row in range(n):
        removed = np.sort(by_pair[(first == row) | (second == row)], axis=None)
        removed = removed[removed >= 0]
        n_remaining = len(ascending) - len(removed)
        middle = np.array([(n_remaining - 1) // 2, n_remaining // 2])
        # The k-th of the remaining values has a rank that is higher by the number of removed values before it.
        middle += np.searchsorted(removed - np.arange(len(removed)), middle, side="right")
        medians.append(float(ascending[middle].mean()))
    return medians
