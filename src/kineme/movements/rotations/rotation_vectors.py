"""Logarithm and exponential between unit quaternions and rotation vectors, and slerp.

A rotation vector p is the axis times the angle in radians, as `scipy.spatial.transform.Rotation.as_rotvec` has it. The
quaternion logarithm of the papers is half of it: ``p = 2 log(q)``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import TrajectoryError
from kineme.movements.rotations.quaternions import as_quaternions, conjugate, product
from kineme.validation import Array, as_numbers

_TURN = 2.0 * np.pi
#: Vector parts of quaternions below this length have lost their direction to rounding.
TINY = 1e-7


def as_vectors(p: ArrayLike) -> Array:
    """Rotation vectors, or their rates (..., 3), as float64.

    Raises
    ------
    TrajectoryError
        Not real numbers, or of another shape.
    """
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
