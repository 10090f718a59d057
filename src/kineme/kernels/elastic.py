"""Elastic and turning distances of two movements by their segments: the plain definition.

For movements a and b and a rotation R that brings b onto a, two segments p, q cost

    c(p, q) = |t_p - R t_q|^2 + w_x |x_p - R x_q|^2 + w_theta (theta_p - theta_q)^2

with tangents t, midpoints x and turning angles theta (divided by pi). The squared elastic distance is the least sum of
costs over warping paths from (0, 0) to (K - 1, K - 1) with steps (1, 0), (0, 1), (1, 1) and ``|p - q| <= band``
(H. Sakoe and S. Chiba, "Dynamic programming algorithm optimization for spoken word recognition", IEEE TASSP 26(1),
1978), divided by the number K of segments. The squared turning distance is the same with the last term alone, so it
needs no rotation and is never larger. A warping path visits every segment of b, so that the costs of some of them, each
with whichever segment of a within the band costs least, bound both from below. Both are symmetric, with the transposed
rotation, non-negative, and zero for equal movements; neither satisfies the triangle inequality.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kineme.kernels.shapes import Floats, Shapes
from kineme.validation import Array

Indices = NDArray[np.intp]


def elastic_squares(A: Shapes, B: Shapes, first: Indices, second: Indices, rotations: Array | None) -> Array:
    """Squared elastic and turning distances (2, k) of k pairs: A's movement ``first[i]`` and B's ``second[i]``.

    Parameters
    ----------
    A, B : Shapes
    first, second : arrays (k,) of indices
    rotations : array (k, d, d), or None for none
    """
    sums = [_warped(costs, A.elastic.band) for costs in _costs(A, B, first, second, rotations)]
    return np.stack(sums) / A.elastic.n_segments


def elastic_bounds(A: Shapes, B: Shapes, first: Indices, second: Indices, rotations: Array | None, every: int) -> Array:
    """Lower bounds (2, k) of the same: the costs of each `every`-th segment of b with the one of a that costs least."""
    n = A.elastic.n_segments
    far = np.abs(np.subtract.outer(np.arange(n), np.arange(n))) > A.elastic.band
    some = slice(every // 2, None, every)
    costs = (np.where(far, np.inf, each)[:, :, some] for each in _costs(A, B, first, second, rotations))
    return np.stack([each.min(axis=1).sum(axis=1) for each in costs]) / n


def _costs(A: Shapes, B: Shapes, first: Indices, second: Indices, rotations: Array | None) -> tuple[Array, Array]:
    """Costs (k, n, n) of segments with segments: all of c, and its last term."""
    angles = A.turning[first, :, None].astype(np.float64) - B.turning[second, None, :]
    turning: Array = A.elastic.turning_weight * angles**2
    costs = turning.copy()
    for weight, name in ((1.0, "tangents"), (A.elastic.position_weight, "midpoints")):
        a, b = getattr(A, name)[first].astype(float), rotated(getattr(B, name)[second], rotations)
        for k in range(A.n_dims):
            costs += weight * (a[:, :, None, k] - b[:, None, :, k]) ** 2
    return costs, turning


def rotated(vectors: Floats, rotations: Array | None) -> Array:
    """Vectors (k, n, d), each pair's by its own rotation (k, d, d)."""
    double = vectors.astype(np.float64)
    return double if rotations is None else np.asarray(double @ rotations.transpose(0, 2, 1))


def _warped(costs: Array, band: int) -> Array:
    """Least sums (k,) over warping paths through costs (k, n, n)."""
    n = costs.shape[1]
    table = np.full((n + 1, n + 1, len(costs)), np.inf)
    table[0, 0] = 0
    for p in range(n):
        for q in range(max(0, p - band), min(n, p + band + 1)):
            before = np.minimum(np.minimum(table[p, q + 1], table[p + 1, q]), table[p, q])
            table[p + 1, q + 1] = costs[:, p, q] + before
    return table[n, n]
