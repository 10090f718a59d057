"""One similarity from distances in several representations, each at its local scale: neighbors of neighbors count.

Source: B. Wang et al., "Similarity network fusion for aggregating data types on a genomic scale", Nature Methods 11,
2014. A person's movements of one class are close to each other, and those of two people far apart; what connects them
are chains of neighbors, in one representation or another.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from kineme.validation import Array

#: Neighbors in the graph of each representation; the fused similarities of both are added up.
NEIGHBORS = (7, 15)
_WIDTH = 0.4  # mu of the source, Eq. (2), which recommends 0.3 to 0.8; wider ones merge classes of a few movements
_ROUNDS = 5  # of fusion; it has converged
_FAR = 5.0  # times the usual distance to a neighbor
_APART = 1e-3  # of their similarity is left to movements of components apart
_NONE = 1e-6  # largest distance, as a share of the typical one, of movements that do not differ
_LEAST = 1e-30  # similarity, above 0


def fuse(squares: Array, weights: ArrayLike | None = None) -> Array:
    """Similarities W (n, n) of movements: symmetric, at least 0, and 0 on the diagonal.

    In representation r, ``A_r(i, j) = exp(-d_r^2 / (mu e_ij^2))`` with e_ij the mean of d_r(i, j) and of the typical
    distances of i and of j to their neighbors: a dense class and a loose one are treated alike. Of each A_r a full
    P_r and a sparse S_r, of the nearest neighbors alone, have rows that sum to 1. Five times, every
    ``P_r <- S_r (mean of the other P) S_r^T``: pairs are similar whose neighbors are similar in the other
    representations. W is the mean of the P_r, added up over 7 and 15 neighbors: few for classes of a few movements, and
    many so that the movements of several people connect. Means are weighted.

    Parameters
    ----------
    squares : ndarray of shape (R, n, n)
        Squared distances, for at least three movements. Representations in which no two differ are left out.
    weights : array_like of shape (R,), optional
        Of the representations in each mean, above 0; equal by default.
    """
    differ, weights = _differing(squares, weights)
    return np.asarray(sum(_fused(differ, weights, neighbors) for neighbors in NEIGHBORS))


def local_similarities(squares: Array, weights: ArrayLike | None = None) -> Array:
    """The mean of the A_r of `fuse` with 7 neighbors, (n, n): at the local scale, and not yet fused."""
    differ, weights = _differing(squares, weights)
    k = min(*NEIGHBORS, squares.shape[1] - 1)
    return np.asarray(sum(w * _similar(one, k) for w, one in zip(weights, differ, strict=True)) / weights.sum())


def components(squares: Array) -> NDArray[np.intp]:
    """Index of the component of each movement, (n,): far from all other components, in chains of neighbors.

    s_r(i) is the distance of movement i to its second nearest neighbor in representation r, and u_r(i) the smallest
    s_r of these neighbors, but at least the median of all. Two movements i and j are linked if d_r(i, j) is less than
    five times the larger of u_r(i) and u_r(j), in the geometric mean over representations; components are what
    links connect. Movements of one class have 3.2 to their second neighbors at most, among people's and drawn ones;
    movements of no class have 8 and more.
    """
    logs = []
    for one in squares:
        distances = np.sqrt(np.maximum(one, 0.0))
        np.fill_diagonal(distances, -1.0)
        nearest = np.argpartition(distances, 2, axis=1)[:, :3]
        own = np.take_along_axis(distances, nearest, axis=1).max(axis=1)
        if (typical := float(np.median(own))) > 0:
            usual = np.maximum(own[nearest].min(axis=1), typical)
            logs.append(np.log(np.maximum(distances, _NONE * typical) / np.maximum(usual[:, None], usual)))
    if not logs:
        return np.zeros(squares.shape[1], dtype=np.intp)
    return np.asarray(connected_components(np.mean(logs, axis=0) < np.log(_FAR))[1], dtype=np.intp)


def set_apart(similar: Array, component: NDArray[np.intp]) -> Array:
    """Similarities in which small components, of fewer movements than a neighborhood has, are nearly alone.

    The neighbors of such a movement are not all of its component, so that fusion connects it with whatever comes next.
    """
    few = np.bincount(component)[component] <= min(NEIGHBORS)
    apart = (component[:, None] != component) & (few[:, None] | few)
    return np.where(apart, _APART * similar, similar)


def _differing(squares: Array, weights: ArrayLike | None) -> tuple[list[Array], Array]:
    """Representations in which movements differ, one at least, and their weights."""
    given = np.ones(len(squares)) if weights is None else np.asarray(weights, dtype=np.float64)
    kept = [r for r, one in enumerate(squares) if one.max() > 0] or [0]
    return [squares[r] for r in kept], given[kept]


def _fused(squares: list[Array], weights: Array, neighbors: int) -> Array:
    """The mean of the P_r after all rounds."""
    n = len(squares[0])
    k = max(2, min(neighbors, n // 2 - 1))
    graphs = [_graphs(one, min(k, n - 1)) for one in squares]
    full, sparse = [one[0] for one in graphs], [one[1] for one in graphs]
    if len(full) == 1:
        full = [_diffused(sparse[0], full[0])]
    else:
        for _ in range(_ROUNDS):
            total = sum(w * P for w, P in zip(weights, full, strict=True))
            others = [(total - w * P) / (weights.sum() - w) for w, P in zip(weights, full, strict=True)]
            full = [_diffused(S, P) for S, P in zip(sparse, others, strict=True)]
    fused = np.asarray(sum(w * P for w, P in zip(weights, full, strict=True)) / weights.sum())
    np.fill_diagonal(fused, 0.0)
    return fused


def _graphs(squares: Array, k: int) -> tuple[Array, csr_array]:
    """P_r (n, n) with half of each row on the diagonal, and S_r (n, n) with k neighbors and the movement itself."""
    n, similar = len(squares), _similar(squares, k)
    np.fill_diagonal(similar, 2.0)  # itself first
    nearest = np.argpartition(-similar, k, axis=1)[:, : k + 1]
    np.fill_diagonal(similar, 1.0)
    values = np.take_along_axis(similar, nearest, axis=1)
    values /= values.sum(axis=1, keepdims=True)
    starts = np.arange(0, n * (k + 1) + 1, k + 1)
    sparse = csr_array((values.ravel(), nearest.ravel(), starts), shape=(n, n))
    np.fill_diagonal(similar, 0.0)
    full = 0.5 * similar / similar.sum(axis=1, keepdims=True)
    np.fill_diagonal(full, 0.5)
    return full, sparse


def _similar(squares: Array, k: int) -> Array:
    """A_r (n, n), at the scale of k neighbors."""
    distances = np.sqrt(np.maximum(squares, 0.0))
    np.fill_diagonal(distances, 0.0)
    typical = np.partition(distances, k, axis=1)[:, : k + 1].sum(axis=1) / k
    scale = (typical[:, None] + typical + distances) / 3.0
    scale = np.maximum(scale, _NONE * float(np.median(distances)) + np.finfo(float).tiny)
    return np.asarray(np.maximum(np.exp(-((distances / scale) ** 2) / _WIDTH), _LEAST))


def _diffused(sparse: csr_array, full: Array) -> Array:
    """``S P S^T`` with 1 added on the diagonal, its rows summing to about 1, symmetric."""
    moved = sparse @ (sparse @ full).T
    moved = 0.5 * (moved + moved.T)
    np.einsum("ii->i", moved)[:] += 1.0
    moved /= moved.sum(axis=1, keepdims=True)
    return np.asarray(0.5 * (moved + moved.T))
