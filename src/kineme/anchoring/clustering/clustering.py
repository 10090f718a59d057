"""From distances to clusters: the methods by name, and the tree that average linkage makes."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import squareform

from kineme.validation import Array

Clusters = NDArray[np.intp]


def agglomerative(distances: Array, n_clusters: int, min_members: int) -> Clusters:
    """Average linkage cut into `n_clusters`; clusters of fewer than `min_members` are none, -1."""
    clusters = cuts(average_linkage(distances), [min(n_clusters, len(distances))])[0]
    return without_small(clusters, min_members)


def hdbscan(distances: Array, n_clusters: int | None, min_members: int) -> Clusters:
    """Clusters of density that persist longest, none (-1) in between; their number is found.

    Density needs a metric: that of the kernel's space, ``sqrt(2 - 2 K)``, from ``1 - K``.

    Sources: R. Campello, D. Moulavi, J. Sander, "Density-based clustering based on hierarchical density estimates",
    PAKDD 2013; the implementation is scikit-learn's.
    """
    from sklearn.cluster import HDBSCAN

    size = min(min_members, len(distances))
    model = HDBSCAN(min_cluster_size=max(2, size), min_samples=max(1, size - 1), metric="precomputed", copy=True)
    return np.asarray(model.fit_predict(np.sqrt(2.0 * np.maximum(distances, 0.0))), dtype=np.intp)


#: Name -> from distances (n, n), a number of clusters and of members to the cluster of each movement, -1 for none.
METHODS: dict[str, Callable[[Array, int, int], Clusters]] = {"agglomerative": agglomerative, "hdbscan": hdbscan}


def without_small(clusters: Clusters, min_members: int) -> Clusters:
    """The same with clusters of fewer members dissolved, and the others counted from 0 again."""
    sizes = np.bincount(clusters)
    kept = np.full(len(sizes), -1, dtype=np.intp)
    large = np.flatnonzero(sizes >= min_members)
    kept[large] = np.arange(len(large))
    return np.asarray(kept[clusters])


def average_linkage(distances: Array) -> Array:
    """Merges (n - 1, 4) of the two clusters whose mean distance is smallest, as SciPy's `linkage` gives them.

    scikit-learn's ``AgglomerativeClustering(metric="precomputed", linkage="average")`` finds the same clusters, but a
    tree can be cut many times.
    """
    return np.asarray(linkage(squareform(distances, checks=False), "average"))


def cuts(tree: Array, counts: Sequence[int]) -> list[NDArray[np.intp]]:
    """Clusters 0, 1, ... of each movement for each number of clusters: the first n - c merges are made."""
    rank = np.arange(len(tree), dtype=np.float64)  # of the merges: heights may be equal, ranks are not
    ends = [len(tree) - count for count in counts]
    return [np.asarray(fcluster(tree, end, "monocrit", monocrit=rank), dtype=np.intp) - 1 for end in ends]


def cut_at(tree: Array, height: float) -> NDArray[np.intp]:
    """Clusters of movements whose mean distance does not exceed `height`."""
    return np.asarray(np.unique(fcluster(tree, height, "distance"), return_inverse=True)[1], dtype=np.intp)
