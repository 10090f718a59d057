"""Whether clusters come again when some of the movements are left out.

Sources: A. Ben-Hur, A. Elisseeff, I. Guyon, "A stability based method for discovering structure in clustered data",
Pacific Symposium on Biocomputing 7, 2002 (agreement of clusterings of subsets, as a function of their number); C.
Hennig, "Cluster-wise assessment of cluster stability", Computational Statistics & Data Analysis 52, 2007 (the Jaccard
coefficient of one cluster with the most similar one found in each subset).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from kineme.anchoring.clustering.clustering import Clusters
from kineme.validation import Array

_SHARE = 0.8  # of the movements in each subset


def subsets(n: int, repeats: int, seed: int) -> Iterator[NDArray[np.intp]]:
    """Random subsets of four fifths of n movements, in rising order."""
    random = np.random.default_rng(seed)
    size = max(2, round(_SHARE * n))
    for _ in range(repeats):
        yield np.sort(random.choice(n, size, replace=False))


def stabilities(
    distances: Array, clusters: Clusters, again: Callable[[Array], Clusters], repeats: int, seed: int = 0
) -> Array:
    """Mean, over subsets, of each cluster's largest Jaccard coefficient with a cluster found there.

    Parameters
    ----------
    distances : ndarray of shape (n, n)
    clusters : ndarray of shape (n,)
        0, 1, ...; -1 is none.
    again : callable
        From distances (m, m) of a subset to its clusters.
    repeats : int
    seed : int

    Returns
    -------
    ndarray of shape (c,)
        From 0 to 1; Hennig takes 0.75 for a valid, stable cluster, and below 0.5 for none.
    """
    c = int(clusters.max(initial=-1)) + 1
    coefficients = np.full((repeats, c), np.nan)
    for b, chosen in enumerate(subsets(len(distances), repeats, seed)):
        own, other = clusters[chosen], again(distances[np.ix_(chosen, chosen)])
        table = overlaps(own, other, c)
        sizes = np.bincount(own[own >= 0], minlength=c)
        union = sizes[:, None] + np.bincount(other[other >= 0], minlength=table.shape[1]) - table
        there = sizes > 0
        coefficients[b, there] = (table[there] / np.maximum(union[there], 1)).max(axis=1, initial=0.0)
    known = np.isfinite(coefficients)
    return np.asarray(np.where(known, coefficients, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1))


def overlaps(a: Clusters, b: Clusters, n_rows: int) -> NDArray[np.intp]:
    """Movements in each cluster of a and each of b, shape (n_rows, clusters of b); -1 is in none."""
    both = (a >= 0) & (b >= 0)
    table = np.zeros((n_rows, int(b.max(initial=-1)) + 1), dtype=np.intp)
    np.add.at(table, (a[both], b[both]), 1)
    return table
