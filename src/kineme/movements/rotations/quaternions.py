"""Unit quaternions (w, x, y, z) as arrays of any leading shape: product, conjugate, rotation of vectors, norms, signs.

A quaternion q turns a vector given in the tool frame into the world frame, so ``product(c, q)`` turns the world and
``product(q, c)`` turns the tool. q and -q are the same orientation. ROS and SciPy write (x, y, z, w) by default:
``q[..., [3, 0, 1, 2]]`` converts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import TrajectoryError
from kineme.validation import Array, as_numbers

#: Deviation from norm 1 that is put down to rounding in a recording (three decimals give up to 0.001).
NORM_TOLERANCE = 0.01


def as_quaternions(q: ArrayLike) -> Array:
    """Quaternions (..., 4) of any norm as float64.

    Raises
    ------
    TrajectoryError
        Not real numbers, or of another shape.
    """
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

    Raises
    ------
    TrajectoryError
        Not of shape (..., 4), or a norm that differs from 1 by more than `NORM_TOLERANCE`.
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
    flips = (q[..., 1:, :] * q[..., :-1, :]).sum(axis=-1) < 0
    odd = np.zeros(q.shape[:-1], dtype=bool)
    np.logical_xor.accumulate(flips, axis=-1, out=odd[..., 1:])
    return np.where(odd[..., None], -q, q)


def angle_between(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    """Angle of the rotation from a to b [rad], from 0 to pi; shapes (..., 4) broadcast, result (...)."""
    d = product(b, conjugate(a))
    return 2.0 * np.arctan2(np.linalg.norm(d[..., 1:], axis=-1), np.abs(d[..., 0]))
