"""Spectral clustering: what random walks along similarities seldom leave is a cluster.

Sources: A. Ng, M. Jordan, Y. Weiss, "On spectral clustering: analysis and an algorithm", NIPS 14, 2001; U. von Luxburg,
"A tutorial on spectral clustering", Statistics and Computing 17, 2007 (section 8.3: the eigengap).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
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
    linkage of the cosines of these directions is cut into so many clusters. Where some have too few members, these are
    left over, and of the others the loosest is divided until there are enough.
    """
    wanted = max(1, min(n_clusters, len(similar) // min_members))
    rows = _directions(similar, wanted)
    distances = np.maximum(1.0 - rows @ rows.T, 0.0)
    distances = 0.5 * (distances + distances.T)
    np.fill_diagonal(distances, 0.0)
    found = without_small(cuts(average_linkage(distances), [wanted])[0], min_members)
    for new in range(int(found.max(initial=-1)) + 1, wanted):
        divisible = np.flatnonzero(np.bincount(found[found >= 0], minlength=1) >= 2 * min_members)
        if not len(divisible):
            break
        members = max(
            (np.flatnonzero(found == k) for k in divisible), key=lambda one: distances[np.ix_(one, one)].mean()
        )
        found[members[_half(distances[np.ix_(members, members)], min_members)]] = new
    return found


def _half(distances: Array, min_members: int) -> NDArray[np.bool_]:
    """Whether each of n movements is in the second of two parts, both of at least `min_members`.

    Average linkage is cut into so many clusters that two are large enough; each movement goes with the nearer of them.
    If none of its cuts is such, each goes with the nearer of the two that are farthest apart, in equal parts.
    """
    n = len(distances)
    tree = average_linkage(distances)
    for count in range(2, n):
        parts = without_small(cuts(tree, [count])[0], min_members)
        if parts.max(initial=-1) >= 1:
            first, second = (distances[:, parts == k].mean(axis=1) for k in (0, 1))
            nearer = np.where(parts == 0, False, np.where(parts == 1, True, second < first))
            return np.asarray(nearer, dtype=bool)
    i, j = np.unravel_index(distances.argmax(), distances.shape)
    nearer = np.zeros(n, dtype=bool)
    nearer[np.argsort(distances[:, j] - distances[:, i], kind="stable")[: n // 2]] = True
    return nearer


def _directions(similar: Array, k: int) -> Array:
    """Rows (n, k) of norm 1."""
    n = len(similar)
    vectors = eigh(_normalized(similar), subset_by_index=(n - k, n - 1))[1]
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), np.finfo(float).tiny))


def _normalized(similar: Array) -> Array:
    roots = np.sqrt(np.maximum(similar.sum(axis=1), np.finfo(float).tiny))
    return np.asarray(similar / roots[:, None] / roots)
