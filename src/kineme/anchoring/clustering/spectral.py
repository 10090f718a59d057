"""Spectral clustering: what random walks along similarities seldom leave is a cluster.

Sources: A. Ng, M. Jordan, Y. Weiss, "On spectral clustering: analysis and an algorithm", NIPS 14, 2001; U. von Luxburg,
"A tutorial on spectral clustering", Statistics and Computing 17, 2007 (section 8.3: the eigengap).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh

from kineme.anchoring.clustering.clustering import Clusters, average_linkage, cuts, without_small
from kineme.validation import Array


def count_by_eigengap(similar: Array) -> int:
    """The number of clusters c, from 2 to n / 2, with the largest gap between the c-th and the next eigenvalue.

    Of the normalized similarities ``D^-1/2 W D^-1/2``. With c clusters that nothing connects, c eigenvalues are 1.

    Parameters
    ----------
    similar : ndarray of shape (n, n)
        Symmetric similarities W of at least three movements, at least 0, and 0 on the diagonal.
    """
    n = len(similar)
    values = eigh(_normalized(similar), eigvals_only=True)[::-1]
    most = min(max(2, n // 2), n - 1)
    return int((values[1:most] - values[2 : most + 1]).argmax()) + 2


def spectral(similar: Array, n_clusters: int, min_members: int = 1) -> Clusters:
    """Exactly `n_clusters` clusters of at least `min_members`, if there are enough movements; -1 is none.

    Each movement becomes the direction of its entries in the first eigenvectors, as many as there are clusters. Average
    linkage of the cosines of these directions is cut into so many clusters, and where some have fewer members, farther
    until there are enough of the others; what is too small then is left over.
    """
    n = len(similar)
    wanted = min(n_clusters, n)
    rows = _directions(similar, wanted)
    distances = np.maximum(1.0 - rows @ rows.T, 0.0)
    np.fill_diagonal(distances, 0.0)
    tree = average_linkage(0.5 * (distances + distances.T))
    found = without_small(cuts(tree, [wanted])[0], min_members)
    best = found
    for count in range(wanted + 1, n + 1):
        if best.max(initial=-1) + 1 >= wanted or wanted * min_members > n:
            break
        found = without_small(cuts(tree, [count])[0], min_members)
        best = found if found.max(initial=-1) > best.max(initial=-1) else best
    return best


def _directions(similar: Array, k: int) -> Array:
    """Rows (n, k) of norm 1."""
    n = len(similar)
    vectors = eigh(_normalized(similar), subset_by_index=(n - k, n - 1))[1]
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), np.finfo(float).tiny))


def _normalized(similar: Array) -> Array:
    roots = np.sqrt(np.maximum(similar.sum(axis=1), np.finfo(float).tiny))
    return np.asarray(similar / roots[:, None] / roots)
