"""The best rotation in space by at most a given angle: the true optimum, not the best free rotation turned back.

A rotation by an angle ``phi`` about a unit axis u is the unit quaternion ``(w, v) = (cos(phi/2), sin(phi/2) u)``, and
for a covariance C the inner product ``tr(R^T C)`` is

    w^2 tr C + 2 w z'v + v'S v,   S = C + C' - tr(C) I,   z = (C_32 - C_23, C_13 - C_31, C_21 - C_12)

(B. K. P. Horn, "Closed-form solution of absolute orientation using unit quaternions", JOSA A 4(4), 1987). Wanted is its
maximum over unit quaternions with ``w >= c``, ``c = cos(max_angle/2)``, ``s = sin(max_angle/2)``. With eigenvalues
``m_1 >= m_2 >= m_3`` of S and z in its eigenvectors, every number ``l`` above both m_1 and the top eigenvalue of Horn's
4 x 4 matrix bounds it by

    F(l) = c^2 tr C + s^2 l + c^2 sum_i z_i^2 / (l - m_i),

and the least of these bounds is the maximum: duality holds without a gap. Either ``F'(l) = 0``, and the best rotation
is at the limit, or l is that top eigenvalue, the root of ``l - tr C = sum_i z_i^2 / (l - m_i)``, and the best rotation
is within. Both roots are those of increasing concave functions, so Newton steps from the left never pass them (J. J.
More and D. C. Sorensen, "Computing a trust region step", SIAM J. Sci. Stat. Comput. 4(3), 1983). F is flat where it is
least, so an error of l counts twice as many digits less; and it needs no axis, which a straight movement does not have.

The best rotation under a prior: large rotations cost similarity, and none is forbidden.

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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.validation import Array, check_number

NEWTON_STEPS = 40  # of Newton's, at most; five to eight in practice
CONVERGED = 1e-12  # relative step after which there are no more
ROUNDING = 1e-15  # of |M|^4: the quartic is no more exact, and where two roots meet its slope is none at all
TIE = 1e-5  # of the cube of the norm: smaller divisors have lost digits, since two rotations are about equally good
#: Of the norm, added to the diagonal where rotations are equally good, so that one of them is better.
TIE_BREAK = (3e-3, 2e-3, 1e-3)

#: Dimensions -> k. ``python -m bench --only defaults`` tells what hangs on it.
CONCENTRATION = {2: 0.03, 3: 0.1}

LEAST_STEP = 1e-14  # of the covariance's largest entry: l - m_1 at least, so that divisions are safe
STEPS = 60  # at most; two to six in practice
CLOSE = 1e-10  # relative step after which quadratic convergence has reached rounding errors
_LEAST_SINE = 1e-50  # below it, a limit of the angle is zero in double precision
_TIE = 1e-9  # of the largest entry: rotations closer than this count as equally good, and the smallest is taken
_STRAIGHT = 1e-4  # second singular value as a share of the first: a movement within 0.3 % of its length of a line
_STRAIGHT_TIE = 1e-3  # more than such a movement gains by rotating about its axis; changes its angle by 0.03 degrees


class _Form(NamedTuple):
    """n quadratic forms of quaternions in the eigenvectors of S, for covariances with a largest entry of 1."""

    C: Array  # (n, 3, 3)
    scale: Array  # (n,), the largest entry taken out
    trace: Array  # (n,)
    top: Array  # (n,), m_1
    gaps: Array  # (3, n), m_1 - m_i
    z: Array  # (3, n)
    axes: Array  # (n, 3, 3), eigenvectors in columns


def best_products(C: Array, max_angle: float) -> Array:
    """Largest ``tr(R^T C)`` (n,) over rotations by at most `max_angle`, for C (n, 3, 3); NaN where C is not finite."""
    form = _form(C)
    c, s = half_angle(max_angle)
    step, inside = _solve(form, form.trace, c, s)
    level = form.top + step
    at_limit = c * c * form.trace + s * s * level + c * c * (form.z**2 / (step + form.gaps)).sum(axis=0)
    return np.asarray(np.where(inside, level, at_limit) * form.scale)


def best_rotations(C: Array, max_angle: float) -> Array:
    """Rotations R (n, 3, 3) by at most `max_angle` that make ``tr(R^T C)`` largest; of equal ones the smallest.

    The rotation of a straight movement about its own axis is determined by noise alone, so it is left out. That lowers
    ``tr(R^T C)`` by less than 4e-4 of it, and not at all for other movements.
    """
    form = _form(C)
    c, s = half_angle(max_angle)
    tie = np.where(_straight(form.C), _STRAIGHT_TIE, _TIE)
    step, inside = _solve(form, form.trace + tie, c, s)
    v = form.z / (step + form.gaps)
    within = np.vstack((np.ones(len(C)), v)) / np.sqrt(1.0 + (v * v).sum(axis=0))
    axis = (c / s) * v
    # In the hard case the component along the first eigenvector follows from the length of the axis alone.
    left = np.sqrt(np.maximum(1.0 - axis[1] ** 2 - axis[2] ** 2, 0.0))
    axis[0] = np.where(np.abs(axis[0]) < left, np.copysign(left, axis[0]), axis[0])
    axis *= s / np.sqrt((axis * axis).sum(axis=0))
    quaternions = np.where(inside, within, np.vstack((np.full(len(C), c), axis)))
    return _matrices(quaternions[0], np.einsum("nij,jn->in", form.axes, quaternions[1:]))


def half_angle(max_angle: float) -> tuple[float, float]:
    """Cosine and sine of half the limit; the cosine is 0 at pi, and the sine large enough to divide by its square."""
    if max_angle >= math.pi:
        return 0.0, 1.0
    return math.cos(max_angle / 2), max(math.sin(max_angle / 2), _LEAST_SINE)


def _form(C: Array) -> _Form:
    C = np.asarray(C, dtype=np.float64)
    scale = np.abs(C).max(axis=(1, 2))
    usable = np.isfinite(scale) & (scale > 0)
    C = np.where(usable[:, None, None], C, 0.0) / np.where(usable, scale, 1.0)[:, None, None]
    trace = C[:, 0, 0] + C[:, 1, 1] + C[:, 2, 2]
    turned = C.transpose(0, 2, 1)
    values, axes = np.linalg.eigh(C + turned - trace[:, None, None] * np.eye(3))
    values, axes = values.T[::-1], axes[:, :, ::-1]
    z = np.stack((C[:, 2, 1] - C[:, 1, 2], C[:, 0, 2] - C[:, 2, 0], C[:, 1, 0] - C[:, 0, 1]))
    return _Form(C, scale, trace, values[0], values[0] - values, np.einsum("nij,in->jn", axes, z), axes)


def _straight(C: Array) -> NDArray[np.bool_]:
    """Tell whether the second singular value is below a share of the first: ``|adj C|`` is about their product."""
    cofactors = np.cross(C[:, [1, 2, 0]], C[:, [2, 0, 1]])
    return np.asarray((cofactors**2).sum(axis=(1, 2)) <= (_STRAIGHT * (C**2).sum(axis=(1, 2))) ** 2)


def _solve(form: _Form, trace: Array, c: float, s: float) -> tuple[Array, NDArray[np.bool_]]:
    """``l - m_1`` (n,) where F is least, and whether the best rotation is within the limit."""
    squares = form.z**2
    at_limit = _root_at_limit(squares, form.gaps, c, s)
    below = form.top - trace
    inside = below + at_limit < (squares / (at_limit + form.gaps)).sum(axis=0)
    step = at_limit.copy()
    if inside.any():
        parts = (squares[:, inside], form.gaps[:, inside], below[inside])
        step[inside] = _root_within(*parts, at_limit[inside])
    return step, inside


def _root_at_limit(squares: Array, gaps: Array, c: float, s: float) -> Array:
    """Root x >= 0 of ``sum_i c^2 z_i^2 / (x + gap_i)^2 = s^2``, or 0: Newton steps on ``1 / sqrt`` of both sides."""
    ratio = c / s
    x = np.maximum((ratio * np.sqrt(squares) - gaps).max(axis=0), ratio * np.sqrt(squares.sum(axis=0)) - gaps[2])
    x = np.maximum(x, LEAST_STEP)
    moving = np.ones(len(x), dtype=bool)
    for _ in range(STEPS):
        inverse = 1.0 / (x + gaps)
        terms = ratio * ratio * squares * inverse * inverse
        size, slope = terms.sum(axis=0), (terms * inverse).sum(axis=0)
        step = np.where(slope > 0, (np.sqrt(size) - 1.0) * size / np.where(slope > 0, slope, 1.0), 0.0)
        x = np.where(moving, np.maximum(x + step, LEAST_STEP), x)
        moving &= np.abs(step) > CLOSE * x
        if not moving.any():
            break
    return x


def _root_within(squares: Array, gaps: Array, below: Array, x: Array) -> Array:
    """Root of ``below + x = sum_i z_i^2 / (x + gap_i)`` right of x, by Newton steps.

    They begin at the largest eigenvalue of the 2 x 2 matrices that tr C and one m_i make with z_i.
    """
    half = 0.5 * (gaps - below)  # (tr C - m_i) / 2
    x = np.maximum(x, (half + np.sqrt(half * half + squares) - gaps).max(axis=0))
    moving = np.ones(len(x), dtype=bool)
    for _ in range(STEPS):
        inverse = 1.0 / (x + gaps)
        terms = squares * inverse
        step = (terms.sum(axis=0) - below - x) / (1.0 + (terms * inverse).sum(axis=0))
        x = np.where(moving, np.maximum(x + step, LEAST_STEP), x)
        moving &= np.abs(step) > CLOSE * x
        if not moving.any():
            break
    return x


def _matrices(w: Array, v: Array) -> Array:
    """Rotation matrices (n, 3, 3) of unit quaternions w (n,), v (3, n)."""
    x, y, z = v
    rows = (
        (w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z),
    )
    return np.moveaxis(np.array(rows), 2, 0)


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
        check_number("concentration", self.concentration, least=0.0, optional=True)
        check_number("tilt", self.tilt, least=0.0)
        if self.vertical is not None:
            object.__setattr__(self, "vertical", _direction(self.vertical))

    def matrix(self, n_dims: int) -> Array:
        """F, (n_dims, n_dims). Raises `SpecificationError`: a vertical for movements that are not in space."""
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
    for _ in range(NEWTON_STEPS):
        over = x * x - square
        slope = 4.0 * x * over - 8.0 * determinant
        value = over * over - 8.0 * x * determinant - last
        moving = (value > ROUNDING * square * square) & (slope > 0)
        step = np.where(moving, value / np.where(moving, slope, 1.0), 0.0)
        x = x - step
        if not (step > CONVERGED * x).any():
            break
    return np.asarray(x)


def blocks(R: Array, n_points: int) -> Array:
    """Return matrices (m, J d, J d) with matrices (m, d, d) J times along the diagonal."""
    if n_points == 1:
        return R
    m, d, _ = R.shape
    result = np.zeros((m, n_points, d, n_points, d), R.dtype)
    result[:, np.arange(n_points), :, np.arange(n_points)] = R
    return result.reshape(m, n_points * d, n_points * d)
