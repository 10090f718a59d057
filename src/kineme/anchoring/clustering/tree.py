"""The tree of merges by average linkage, and its cuts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import squareform

from kineme.validation import Array


def average_linkage(distances: Array) -> Array:
    """Merges (n - 1, 4) of the two clusters whose mean distance is smallest, as SciPy's `linkage` gives them.

    scikit-learn's ``AgglomerativeClustering(metric="precomputed", linkage="average")`` finds the same clusters; the
    tree itself is cut at many places here.
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
