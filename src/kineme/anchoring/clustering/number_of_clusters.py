"""How many clusters there are: the best fit among the numbers of clusters that come again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kineme.anchoring.clustering.clustering import average_linkage, cuts
from kineme.anchoring.clustering.stability import subsets
from kineme.validation import Array

_SLACK = 0.05  # of the adjusted Rand index: a number of clusters this close to the most stable is as stable
_AT_ONCE = 60  # numbers of clusters tried at a time

Whole = NDArray[np.intp]


def count_clusters(distances: Array, repeats: int = 20, seed: int = 0) -> int:
    """The number of clusters c of an average-linkage tree.

    The stability of c is the mean adjusted Rand index between the c clusters of all movements and those of random
    subsets of four fifths of them (Ben-Hur, Elisseeff, Guyon 2002). Alone it prefers a few large clusters, which
    come again whatever they hold (von Luxburg 2010, section 3), so it only admits: of all c whose stability is
    within 0.05 of the largest, the one with the largest mean silhouette (Rousseeuw 1987) is taken. On bounded distances
    the silhouette is about the share of movements that are clearly nearer to their own cluster.

    Every c from 2 to n / 2 is tried, since a cluster is more than one movement; among many movements a geometric series
    of c first, then those around the best.

    References
    ----------
    U. von Luxburg, "Clustering stability: an overview", Foundations and Trends in Machine Learning 2, 2010.
    """
    n = len(distances)
    tree = average_linkage(distances)
    most = max(2, n // 2)
    tried = np.geomspace(2, most, _AT_ONCE) if most > _AT_ONCE else np.arange(2.0, most + 1)
    counts = np.unique(tried.round().astype(np.intp))
    best = _best(distances, tree, counts, repeats, seed)
    k = int(np.searchsorted(counts, best))
    low, high = counts[max(k - 1, 0)], counts[min(k + 1, len(counts) - 1)]
    if high - low <= 2:
        return best
    around = np.append(np.linspace(low, high, _AT_ONCE).round().astype(np.intp), best)
    return _best(distances, tree, np.unique(around), repeats, seed)


def _best(distances: Array, tree: Array, counts: Whole, repeats: int, seed: int) -> int:
    fine_first = counts[::-1].tolist()
    whole = cuts(tree, fine_first)
    fits = mean_silhouettes(distances, whole)
    parts = subsets(len(distances), repeats, seed)
    agreement = np.mean([_agreement(distances, whole, fine_first, chosen) for chosen in parts], axis=0)
    fits[agreement < agreement.max() - _SLACK] = -np.inf
    return int(fine_first[int(np.argmax(fits))])


def mean_silhouettes(distances: Array, cuts: Sequence[NDArray[np.intp]]) -> Array:
    """Mean silhouette of each clustering; each must be coarser than the one before it.

    With a the mean distance of a movement to its own cluster and b that to the nearest other, ``(b - a) / max(a, b)``,
    and 0 for a movement alone. The sums of distances to a cluster's parts add up to those to the cluster, so the n^2
    distances are read once for all clusterings.

    Source: P. J. Rousseeuw, "Silhouettes: a graphical aid to the interpretation and validation of cluster analysis",
    Journal of Computational and Applied Mathematics 20, 1987.
    """
    sums = _sums_by(distances, cuts[0])
    before, means = cuts[0], []
    for cut in cuts:
        into = np.zeros(sums.shape[1], dtype=np.intp)
        into[before] = cut
        sums, before = _sums_by(sums, into), cut
        means.append(_mean_silhouette(sums, cut))
    return np.array(means)


def _sums_by(columns: Array, into: NDArray[np.intp]) -> Array:
    """Columns (n, m) added up by where each goes, shape (n, c)."""
    order = np.argsort(into, kind="stable")
    starts = np.flatnonzero(np.diff(into[order], prepend=-1))
    return np.asarray(np.add.reduceat(columns[:, order], starts, axis=1))


def _mean_silhouette(sums: Array, cut: NDArray[np.intp]) -> float:
    counts, rows = np.bincount(cut), np.arange(len(cut))
    own = counts[cut]
    a = sums[rows, cut] / np.maximum(own - 1, 1)
    others = sums / counts
    others[rows, cut] = np.inf
    b = others.min(axis=1)
    larger = np.maximum(a, b)
    silhouette = np.where((own > 1) & (larger > 0), (b - a) / np.where(larger > 0, larger, 1.0), 0.0)
    return float(silhouette.mean())


def _agreement(distances: Array, whole: list[Whole], counts: list[int], chosen: Whole) -> Array:
    """Adjusted Rand index of each number of clusters between all movements and a chosen subset, (c,)."""
    tree = average_linkage(distances[np.ix_(chosen, chosen)])
    again = cuts(tree, [min(count, len(chosen)) for count in counts])
    return np.array([adjusted_rand(a[chosen], b) for a, b in zip(whole, again, strict=True)])


def adjusted_rand(a: Whole, b: Whole) -> float:
    """Agreement of two clusterings, 1 if the same and 0 on average by chance.

    Source: L. Hubert, P. Arabie, "Comparing partitions", Journal of Classification 2, 1985, Eq. (5). Called for every
    number of clusters and every subset, so it is counted here in one pass.
    """
    table = np.bincount(a * (int(b.max()) + 1) + b)
    both, in_a, in_b = (_pairs(counts) for counts in (table, np.bincount(a), np.bincount(b)))
    by_chance = in_a * in_b / _pairs(np.array([len(a)]))
    most = 0.5 * (in_a + in_b)
    return 1.0 if most == by_chance else (both - by_chance) / (most - by_chance)


def _pairs(counts: Whole) -> float:
    return float((counts * (counts - 1)).sum()) / 2.0
