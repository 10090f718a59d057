"""Unit quaternions (w, x, y, z) as arrays of any leading shape, rotation vectors and rotation matrices.

A quaternion q turns a vector given in the tool frame into the world frame, so ``product(c, q)`` turns the world and
``product(q, c)`` turns the tool. q and -q are the same orientation. ROS and SciPy write (x, y, z, w) by default:
``q[..., [3, 0, 1, 2]]`` converts.

A rotation vector p is the axis times the angle in radians, as `scipy.spatial.transform.Rotation.as_rotvec` has it. The
quaternion logarithm of the papers is half of it: ``p = 2 log(q)``.

`exp_one` and its kin do to one rotation in Python's floats what `exp`, `log` and `nearest` do to arrays, for steps of
live control: NumPy needs a microsecond for each operation, ten times what these functions take altogether.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import TrajectoryError
from kineme.validation import Array, as_numbers

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

_TURN = 2.0 * np.pi
#: Vector parts of quaternions below this length have lost their direction to rounding.
TINY = 1e-7

#: Deviation from norm 1 that is put down to rounding in a recording (three decimals give up to 0.001).
NORM_TOLERANCE = 0.01


def as_quaternions(q: ArrayLike) -> Array:
    """Quaternions (..., 4) of any norm as float64."""
    q = as_numbers(q, "quaternions")
    if q.ndim == 0 or q.shape[-1] != 4:
        raise TrajectoryError(f"expected quaternions (w, x, y, z) of shape (..., 4), got shape {q.shape}")
    return q


def product(a: ArrayLike, b: ArrayLike) -> Array:
    """Quaternion product ``a b``: first b, then a; shapes (..., 4) broadcast."""
    a, b = as_quaternions(a), as_quaternions(b)
    return np.stack(product_components(np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)), axis=-1)


def product_components(a: Iterable[Any], b: Iterable[Any]) -> tuple[Any, Any, Any, Any]:
    """`product` in components w, x, y, z: arrays of one shape, or floats."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def conjugate(q: ArrayLike) -> Array:
    """``(w, -x, -y, -z)``, for unit quaternions the inverse; shape (..., 4)."""
    return as_quaternions(q) * np.array([1.0, -1.0, -1.0, -1.0])


def rotated(q: ArrayLike, x: ArrayLike) -> Array:
    """Vectors x (..., 3) rotated by unit quaternions q (..., 4): ``q x conj(q)``."""
    q, x = as_quaternions(q), np.asarray(x)
    w, v = q[..., :1], q[..., 1:]
    across = 2.0 * np.cross(v, x)
    return np.asarray(x + w * across + np.cross(v, across))


def normalized(q: ArrayLike) -> Array:
    """Unit quaternions (..., 4), as a copy.

    Raises `TrajectoryError`: not of shape (..., 4), or a norm that differs from 1 by more than `NORM_TOLERANCE`.
    """
    q = as_quaternions(q)
    shape = q.shape[:-1]

    def where(row: int) -> str:
        index = ", ".join(str(int(i)) for i in np.unravel_index(row, shape)) if shape else ""
        return f"quaternion at index [{index}]" if shape else "quaternion"

    return normalized_rows(q.reshape(-1, 4), where).reshape(q.shape)


def normalized_rows(q: Array, where: Callable[[int], str]) -> Array:
    """Divide rows (total, 4) by their norms; `where` names a row that is not a unit quaternion."""
    norms = np.linalg.norm(q, axis=1)
    good = np.abs(norms - 1.0) <= NORM_TOLERANCE  # false for NaN
    if not good.all():
        row = int(np.argmin(good))
        raise TrajectoryError(
            f"{where(row)}: expected a unit quaternion (w, x, y, z), got norm {norms[row]:.6g} from {q[row].tolist()}; "
            "check the order of the columns, or divide the quaternions by their norms"
        )
    return q / norms[:, None]


def continuous(q: ArrayLike) -> Array:
    """Choose between q and -q along time so that neighbors lie in one hemisphere.

    Parameters
    ----------
    q : array_like of shape (..., T, 4)
        Unit quaternions along time.

    Returns
    -------
    ndarray of shape (..., T, 4)
        The first of each movement unchanged; ``sum(q[t] * q[t - 1]) >= 0`` afterwards.

    Raises
    ------
    TrajectoryError
        One quaternion alone, or an array of another shape.
    """
    q = as_quaternions(q)
    if q.ndim < 2:
        raise TrajectoryError(f"expected quaternions along time, of shape (..., T, 4), got shape {q.shape}")
    return np.where(odd_flips(q)[..., None], -q, q)


def odd_flips(vectors: Array) -> NDArray[np.bool_]:
    """Tell whether vectors (..., T, k) turned to the opposite side an odd number of times, until each: (..., T)."""
    odd = np.zeros(vectors.shape[:-1], dtype=bool)
    flips = (vectors[..., 1:, :] * vectors[..., :-1, :]).sum(axis=-1) < 0
    np.logical_xor.accumulate(flips, axis=-1, out=odd[..., 1:])
    return odd


def angle_between(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    """Angle of the rotation from a to b [rad], from 0 to pi; shapes (..., 4) broadcast, result (...)."""
    d = product(b, conjugate(a))
    return 2.0 * np.arctan2(np.linalg.norm(d[..., 1:], axis=-1), np.abs(d[..., 0]))


def as_vectors(p: ArrayLike) -> Array:
    """Rotation vectors, or their rates (..., 3), as float64."""
    p = as_numbers(p, "rotation vectors")
    if p.ndim == 0 or p.shape[-1] != 3:
        raise TrajectoryError(f"expected vectors of shape (..., 3), got shape {p.shape}")
    return p


def log(q: ArrayLike) -> Array:
    """Rotation vectors (..., 3) [rad] of unit quaternions (..., 4), of length 0 to pi.

    ``p = 2 atan2(|v|, w) v / |v|`` with the sign of ``q = (w, v)`` for which ``w >= 0``; q and -q give the same, except
    at exactly pi, where the two ends of the axis are the same rotation.
    """
    q = as_quaternions(q)
    w, v = np.abs(q[..., :1]), np.where(q[..., :1] < 0, -q[..., 1:], q[..., 1:])
    return logarithm_factor(w, np.linalg.norm(v, axis=-1, keepdims=True)) * v


def logarithm_factor(w: Array, length: Array) -> Array:
    """``2 atan2(|v|, w) / |v|``, near |v| = 0 by its Taylor expansion ``2 / w (1 - |v|^2 / (3 w^2))``."""
    small = (length < TINY) & (w > 0)
    safe_w, safe_length = np.where(small, w, 1.0), np.where(length == 0, 1.0, length)
    taylor = 2.0 / safe_w * (1.0 - (length / safe_w) ** 2 / 3.0)
    return np.where(small, taylor, 2.0 * np.arctan2(length, w) / safe_length)


def exp(p: ArrayLike) -> Array:
    """Unit quaternions (..., 4) of rotation vectors (..., 3) [rad] of any length: the inverse of `log`."""
    p = as_vectors(p)
    half = 0.5 * np.linalg.norm(p, axis=-1, keepdims=True)
    return np.concatenate((np.cos(half), 0.5 * np.sinc(half / np.pi) * p), axis=-1)


def nearest(p: ArrayLike, target: ArrayLike) -> Array:
    """The rotation vector of the same rotation as p that lies nearest to `target`; shapes (..., 3) broadcast.

    The candidates are ``(|p| + 2 pi k) p / |p|``. Where p is no rotation, its axis is that of `target`.
    """
    p, target = np.broadcast_arrays(as_vectors(p), as_vectors(target))
    angle, reach = (np.linalg.norm(a, axis=-1, keepdims=True) for a in (p, target))
    still = angle < TINY
    axis = np.where(still, target / np.where(reach == 0, 1.0, reach), p / np.where(still, 1.0, angle))
    turns = np.round(((axis * target).sum(axis=-1, keepdims=True) - angle) / _TURN)
    return p + turns * _TURN * axis


def slerp(start: ArrayLike, end: ArrayLike, share: ArrayLike) -> Array:
    """Turn from `start` to `end` (..., 4) the short way at constant angular velocity.

    ``exp(share log(end conj(start))) start``, Shoemake 1985; `share` is 0 at the start and 1 at the end, and its
    shape broadcasts with the leading shape of the quaternions.
    """
    turn = log(product(end, conjugate(start)))
    return product(exp(as_numbers(share, "the share of the turn")[..., None] * turn), start)


def matrices_of(q: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    from scipy.spatial.transform import Rotation  # reading files needs no SciPy

    q = normalized(q)
    rows = Rotation.from_quat(q.reshape(-1, 4), scalar_first=True).as_matrix()
    return np.asarray(rows.reshape(*q.shape[:-1], 3, 3))


def quaternion_of(R: Array) -> Array:
    """The unit quaternion (4,) of a rotation matrix (3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(np.array(R)).as_quat(scalar_first=True))  # SciPy 1.14: none read-only


def exp_one(vector: Sequence[float]) -> Quaternion:
    """The unit quaternion of one rotation vector [rad]."""
    x, y, z = vector
    half = 0.5 * math.sqrt(x * x + y * y + z * z)
    factor = 0.5 * math.sin(half) / half if half else 0.5
    return math.cos(half), factor * x, factor * y, factor * z


def matrix_one(quaternion: Sequence[float]) -> tuple[Vector, Vector, Vector]:
    """The rows of the rotation matrix of one unit quaternion."""
    w, x, y, z = quaternion
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


def log_one(quaternion: Sequence[float], near: Sequence[float]) -> Vector | None:
    """Return the rotation vector of a quaternion that is nearest to `near` [rad]; None unless its norm is about 1.

    ``(t + 2 pi k) axis``; where it is no rotation, its axis is that of `near`.
    """
    norm = math.hypot(*quaternion)
    if not abs(norm - 1.0) <= NORM_TOLERANCE:
        return None
    w, x, y, z = quaternion
    sine = math.hypot(x, y, z)
    angle = 2.0 * math.atan2(sine, abs(w))
    if angle < TINY:
        reach, sign = math.hypot(*near), 2.0 / math.copysign(norm, w)
        k = round(reach / _TURN) * _TURN / reach if reach > math.pi else 0.0
        a, b, c = near
        return sign * x + k * a, sign * y + k * b, sign * z + k * c
    scale = math.copysign(1.0, w) / sine
    x, y, z = scale * x, scale * y, scale * z
    along = x * near[0] + y * near[1] + z * near[2]
    angle += round((along - angle) / _TURN) * _TURN
    return angle * x, angle * y, angle * z
