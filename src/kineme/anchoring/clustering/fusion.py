"""One similarity from distances in several representations, each at its local scale: neighbors of neighbors count.

Source: B. Wang et al., "Similarity network fusion for aggregating data types on a genomic scale", Nature Methods 11,
2014. A person's movements of one class are close to each other, and those of two people far apart; what connects them
are chains of neighbors, in one representation or another.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from kineme.validation import Array

#: Neighbors in the graph of each representation; the fused similarities of both are added up.
NEIGHBORS = (7, 15)
_WIDTH = 0.5  # mu of the source, Eq. (2)
_ROUNDS = 5  # of fusion; it has converged
_ISOLATED = 5.0  # times as far from its neighbors as these are from theirs
_NONE = 1e-6  # largest distance, as a share of the typical one, of movements that do not differ
_LEAST = 1e-30  # similarity, above 0


def fuse(squares: Array) -> Array:
    """Similarities W (n, n) of movements: symmetric, at least 0, and 0 on the diagonal.

    In representation r, ``A_r(i, j) = exp(-d_r^2 / (mu e_ij^2))`` with e_ij the mean of d_r(i, j) and of the typical
    distances of i and of j to their neighbors: a dense class and a loose one are treated alike. Of each A_r a full
    P_r and a sparse S_r, of the nearest neighbors alone, have rows that sum to 1. Five times, every
    ``P_r <- S_r (mean of the other P) S_r^T``: pairs are similar whose neighbors are similar in the other
    representations. W is the mean of the P_r, added up over 7 and 15 neighbors: few for classes of a few movements, and
    many so that the movements of several people connect.

    Parameters
    ----------
    squares : ndarray of shape (R, n, n)
        Squared distances, for at least three movements. Representations in which no two differ are left out.
    """
    differ = [one for one in squares if one.max() > 0] or [squares[0]]
    return np.asarray(sum(_fused(differ, neighbors) for neighbors in NEIGHBORS))


def isolated(squares: Array, min_members: int) -> NDArray[np.bool_]:
    """Whether each movement is far from all others, (n,).

    s_r(i) is the distance of movement i to its k-th nearest neighbor in representation r, k one less than
    `min_members`. A movement is isolated if s_r(i) is five times as large as the smallest s_r of these neighbors and as
    the median of all, in the geometric mean over representations. Within classes of people's movements, and of drawn
    ones, the ratio stays below 3.2; movements of no class have 8 and more.
    """
    k = min(min_members, squares.shape[1]) - 1
    logs = []
    for one in squares:
        distances = np.sqrt(np.maximum(one, 0.0))
        np.fill_diagonal(distances, -1.0)
        nearest = np.argpartition(distances, k, axis=1)[:, : k + 1]
        own = np.take_along_axis(distances, nearest, axis=1).max(axis=1)
        usual = np.maximum(own[nearest].min(axis=1), np.median(own))
        if np.median(own) > 0:
            logs.append(np.log(np.maximum(own, np.finfo(float).tiny) / usual))
    return np.asarray(np.mean(logs, axis=0) > np.log(_ISOLATED)) if logs else np.zeros(squares.shape[1], dtype=bool)


def _fused(squares: list[Array], neighbors: int) -> Array:
    """The mean of the P_r after all rounds."""
    n = len(squares[0])
    k = max(2, min(neighbors, n // 2 - 1))
    graphs = [_graphs(one, min(k, n - 1)) for one in squares]
    full, sparse = [one[0] for one in graphs], [one[1] for one in graphs]
    total = sum(full)
    for _ in range(_ROUNDS if len(full) > 1 else 0):
        full = [_diffused(S, (total - P) / (len(full) - 1)) for P, S in zip(full, sparse, strict=True)]
        total = sum(full)
    if len(full) == 1:
        total = _diffused(sparse[0], full[0])
    fused = np.asarray(total) / len(full)
    np.fill_diagonal(fused, 0.0)
    return fused


def _graphs(squares: Array, k: int) -> tuple[Array, csr_array]:
    """P_r (n, n) with half of each row on the diagonal, and S_r (n, n) with k neighbors and the movement itself."""
    n = len(squares)
    distances = np.sqrt(np.maximum(squares, 0.0))
    np.fill_diagonal(distances, 0.0)
    typical = np.partition(distances, k, axis=1)[:, : k + 1].sum(axis=1) / k
    scale = (typical[:, None] + typical + distances) / 3.0
    scale = np.maximum(scale, _NONE * float(np.median(distances)) + np.finfo(float).tiny)
    similar = np.maximum(np.exp(-((distances / scale) ** 2) / _WIDTH), _LEAST)
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


def _diffused(sparse: csr_array, full: Array) -> Array:
    """``S P S^T`` with 1 added on the diagonal, its rows summing to about 1, symmetric."""
    moved = sparse @ (sparse @ full).T
    moved = 0.5 * (moved + moved.T)
    np.einsum("ii->i", moved)[:] += 1.0
    moved /= moved.sum(axis=1, keepdims=True)
    return np.asarray(0.5 * (moved + moved.T))
