"""How well clusterings of one tree fit, all of them from one table of sums.

Source: P. J. Rousseeuw, "Silhouettes: a graphical aid to the interpretation and validation of cluster analysis",
Journal of Computational and Applied Mathematics 20, 1987.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kineme.validation import Array


def mean_silhouettes(distances: Array, cuts: Sequence[NDArray[np.intp]]) -> Array:
    """Mean silhouette of each clustering; each must be coarser than the one before it.

    With a the mean distance of a movement to its own cluster and b that to the nearest other, ``(b - a) / max(a, b)``,
    and 0 for a movement alone. The sums of distances to a cluster's parts add up to those to the cluster, so the n^2
    distances are read once for all clusterings.
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
