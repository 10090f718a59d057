"""The best rotation under a prior: large rotations cost similarity, and none is forbidden.

Of movements a and b with covariance ``C = A B^T`` and norms |a|, |b|, the best rotation of b is that of largest
``<a, R b> + |a| |b| (tr(R^T F) - tr F)``. The second part is the logarithm of the matrix Fisher density of R with
parameter F (T. D. Downs, "Orientation statistics", Biometrika 59(3), 1972), 0 at no rotation; that of a rotation by an
angle t with ``F = k I`` is ``-2 k (1 - cos t)``. With ``M = C + |a| |b| F`` it is the rotation of largest tr(R^T M).

In space the maximum is the largest root l of ``(l^2 - |M|^2)^2 - 8 l det M - 4 |adj M|^2``, right of which the quartic
is convex, so that Newton steps from above stay above (after D. L. Theobald, Acta Crystallographica A61, 2005). The
rotation follows without a decomposition,

    R = ((k + |M|^2) M + l adj(M)^T - M M^T M) / (k l - det M),   k = (l^2 - |M|^2) / 2

(F. L. Markley, "Attitude determination using vector observations: a fast optimal matrix algorithm", Journal of the
Astronautical Sciences 41(2), 1993, Eq. (17)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.validation import Array, check_number

STEPS = 40  # of Newton's, at most; five to eight in practice
CLOSE = 1e-12  # relative step after which there are no more
ROUNDING = 1e-15  # of |M|^4: the quartic is no more exact, and where two roots meet its slope is none at all
TIE = 1e-5  # of the cube of the norm: smaller divisors have lost digits, since two rotations are about equally good
#: Of the norm, added to the diagonal where rotations are equally good, so that one of them is better.
TIE_BREAK = (3e-3, 2e-3, 1e-3)


#: Dimensions -> k. ``python -m bench --only defaults`` tells what hangs on it.
CONCENTRATION = {2: 0.03, 3: 0.1}


@dataclass(frozen=True)
class RotationPrior:
    """Prior of rotations between movements of one class.

    Parameters
    ----------
    concentration : float, optional
        k of ``F = k I``: a rotation by t costs ``2 k (1 - cos t)`` of |a| |b|. By default 0.03 in the plane and 0.1 in
        space, where a movement can be rotated in three ways onto one of another class; with a vertical 0.03, since one
        of the three is left. 0 takes all rotations as equally likely.
    vertical : tuple of 3 floats, optional
        The direction of gravity, either way, for movements in space that are turned about it more often than tilted.
    tilt : float, default 0.5
        s of ``F = k I + s u u^T``, u the unit vector along `vertical`: tilting by t costs ``s (1 - cos t)`` more.

    Raises
    ------
    SpecificationError
        A negative number, or a vertical that is not a direction in space.
    """

    concentration: float | None = None
    vertical: tuple[float, float, float] | None = None
    tilt: float = 0.5

    def __post_init__(self) -> None:
        if self.concentration is not None:
            check_number("concentration", self.concentration, least=0.0)
        check_number("tilt", self.tilt, least=0.0)
        if self.vertical is not None:
            object.__setattr__(self, "vertical", _direction(self.vertical))

    def matrix(self, n_dims: int) -> Array:
        """F, (n_dims, n_dims).

        Raises
        ------
        SpecificationError
            A vertical for movements that are not in space.
        """
        free = n_dims if self.vertical is None else 2  # about a vertical, movements are rotated as in the plane
        k = CONCENTRATION.get(free, 0.0) if self.concentration is None else self.concentration
        F = k * np.eye(n_dims)
        if self.vertical is not None:
            if n_dims != 3:
                raise SpecificationError(
                    f"expected movements of 3 dimensions with vertical={self.vertical}, got {n_dims}; leave it out"
                )
            u = np.asarray(self.vertical) / np.linalg.norm(self.vertical)
            F += self.tilt * np.outer(u, u)
        return F


def _direction(vertical: Any) -> tuple[float, float, float]:
    try:
        x, y, z = map(float, vertical)
    except (TypeError, ValueError, OverflowError):
        x = y = z = 0.0
    if not (any((x, y, z)) and math.isfinite(x + y + z)):
        raise SpecificationError(f"expected vertical to be a direction in space, such as (0, 0, 1), got {vertical!r}")
    return x, y, z


def soft_products_in_plane(re: Array, im: Array, weight: Array) -> tuple[Array, Array, Array]:
    """Largest value, cosine and sine of its angle, of complex products and ``weight = |a| |b| tr F``."""
    re = re + weight
    size = np.hypot(re, im)
    safe = np.where(size > 0, size, 1.0)
    return size - weight, np.where(size > 0, re / safe, 1.0), im / safe


def soft_products(M: Array) -> Array:
    """Largest ``tr(R^T M)`` (n,) over all rotations, of matrices M (n, 3, 3); NaN where one is not finite."""
    return _largest_root(*_invariants(M)[:3])


def soft_rotations(M: Array) -> Array:
    """The rotations R (n, 3, 3) of largest ``tr(R^T M)``; the identity where M is 0."""
    M = np.asarray(M, dtype=np.float64)
    size = np.sqrt(np.einsum("nij,nij->n", M, M))
    M = M / np.where(size > 0, size, 1.0)[:, None, None]
    M[~(size > 0)] = np.eye(3)
    R, divisor = _rotations(M)
    tied = np.abs(divisor) < TIE
    if tied.any():
        R[tied] = _rotations(M[tied] + np.diag(TIE_BREAK))[0]
    return R


def limited(R: NDArray[np.floating], max_angle: float) -> NDArray[np.float32]:
    """Rotations R (..., 3, 3), those by more than `max_angle` turned back to it about their axes."""
    R = np.asarray(R, dtype=np.float32).copy()
    cosine = 0.5 * (np.trace(R, axis1=-2, axis2=-1) - 1.0)
    beyond = cosine < np.cos(max_angle)
    if beyond.any():
        far = R[beyond].astype(np.float64)
        c = cosine[beyond, None, None]
        # (R + R^T) / 2 - cos I = (1 - cos) u u^T: its longest column lies along the axis, up to the sign.
        along = 0.5 * (far + far.transpose(0, 2, 1)) - c * np.eye(3)
        longest = np.einsum("nij,nij->nj", along, along).argmax(axis=1)
        u = along[np.arange(len(far)), :, longest]
        u /= np.linalg.norm(u, axis=1, keepdims=True)
        skew = np.stack((far[:, 2, 1] - far[:, 1, 2], far[:, 0, 2] - far[:, 2, 0], far[:, 1, 0] - far[:, 0, 1]), -1)
        u *= np.where(np.einsum("ni,ni->n", u, skew) < 0, -1.0, 1.0)[:, None]
        K = np.cross(np.eye(3), u[:, None, :])  # K v = u x v
        R[beyond] = np.eye(3) + np.sin(max_angle) * K + (1.0 - np.cos(max_angle)) * K @ K
    return R


def _rotations(M: Array) -> tuple[Array, Array]:
    """R and the divisor in it."""
    square, determinant, last, cofactors = _invariants(M)
    top = _largest_root(square, determinant, last)
    k = 0.5 * (top * top - square)
    divisor = k * top - determinant
    numerator = (k + square)[:, None, None] * M + top[:, None, None] * cofactors - M @ M.transpose(0, 2, 1) @ M
    return numerator / np.where(divisor != 0, divisor, 1.0)[:, None, None], divisor


def _invariants(M: Array) -> tuple[Array, Array, Array, Array]:
    """|M|^2, det M, 4 |adj M|^2 and the cofactors."""
    M = np.asarray(M, dtype=np.float64)
    cofactors = np.cross(M[:, [1, 2, 0]], M[:, [2, 0, 1]])
    determinant = np.einsum("nj,nj->n", M[:, 0], cofactors[:, 0])
    squares = (np.einsum("nij,nij->n", matrices, matrices) for matrices in (M, cofactors))
    return next(squares), determinant, 4.0 * next(squares), cofactors


def _largest_root(square: Array, determinant: Array, last: Array) -> Array:
    """Of ``(x^2 - square)^2 - 8 x determinant - last``, by Newton steps from above."""
    x = np.sqrt(square + np.sqrt(3.0 * last))  # with y = s1 s2 + s1 s3 + s2 s3: x^2 <= square + 2 y, y <= sqrt(3) |adj|
    for _ in range(STEPS):
        over = x * x - square
        slope = 4.0 * x * over - 8.0 * determinant
        value = over * over - 8.0 * x * determinant - last
        moving = (value > ROUNDING * square * square) & (slope > 0)
        step = np.where(moving, value / np.where(moving, slope, 1.0), 0.0)
        x = x - step
        if not (step > CLOSE * x).any():
            break
    return np.asarray(x)


def turned(C: NDArray[np.floating], weight: Array, F: Array) -> Array:
    """``C + |a| |b| F`` for covariances C (n, 3, 3)."""
    return np.asarray(C + weight[:, None, None] * F)
