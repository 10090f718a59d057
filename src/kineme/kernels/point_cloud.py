"""Point-cloud distance of two movements: the plain definition.

$P+ (R.-D. Vatavu, "Improving gesture recognition accuracy on touch screens for users with low vision", CHI 2017)
compares points by position and turning angle, whatever their order. Here they have also the line of their tangent,
without its direction, and the second movement is rotated first:

    D(p, q)^2 = |x_p - R x_q|^2 + w_theta (theta_p - theta_q)^2 + w_l ((|t_p|^2 + |t_q|^2) / 2 - (t_p . R t_q)^2)

The last term is the squared sine of the angle between two tangents; a point without a tangent, t = 0, differs from one
with a tangent by a half and not at all from another without. Each point of one movement is matched with the nearest of
the other, the first of equally near ones, and then each point of the other that nobody matched with its nearest. The
distance is the sum of D over these pairs divided by the number of points, in the direction in which it is smaller. It
is symmetric, with the transposed rotation, non-negative, and zero for equal movements; it does not satisfy the
triangle inequality.
"""

from __future__ import annotations

import numpy as np

from kineme.kernels.elastic import Indices, rotated
from kineme.kernels.shapes import Shapes
from kineme.validation import Array


def cloud_squares(A: Shapes, B: Shapes, first: Indices, second: Indices, rotations: Array | None) -> Array:
    """Squared distances (k,) of k pairs: A's movement ``first[i]`` and B's ``second[i]``.

    Parameters
    ----------
    A, B : Shapes
    first, second : arrays (k,) of indices
    rotations : array (k, d, d), or None for none
    """
    x, y = A.points[first].astype(float), rotated(B.points[second], rotations)
    t, u = A.point_tangents[first].astype(float), rotated(B.point_tangents[second], rotations)
    angles = A.point_turning[first, :, None].astype(float) - B.point_turning[second, None, :]
    halves = 0.5 * ((t * t).sum(axis=2)[:, :, None] + (u * u).sum(axis=2)[:, None, :])
    squares = A.cloud.turning_weight * angles**2
    squares += A.cloud.line_weight * (halves - (t @ u.transpose(0, 2, 1)) ** 2)
    for k in range(A.n_dims):
        squares += (x[:, :, None, k] - y[:, None, :, k]) ** 2
    return np.asarray((matched_sums(np.sqrt(np.maximum(squares, 0))) / A.cloud.n_points) ** 2)


def matched_sums(D: Array) -> Array:
    """Sums (k,) of the distances of matched points, of distances (k, n, n): those of the better direction."""
    return np.minimum(_directed(D), _directed(D.transpose(0, 2, 1)))


def _directed(D: Array) -> Array:
    """Sums (k,) of distances (k, n, n) to the nearest, by rows, and by columns where no row's nearest is."""
    matched = np.zeros(D.shape[::2], dtype=bool)
    np.put_along_axis(matched, D.argmin(axis=2), True, axis=1)
    return np.asarray(D.min(axis=2).sum(axis=1) + np.where(matched, 0, D.min(axis=1)).sum(axis=1))
