"""Unit quaternions (x, y, z, w) in rows, as ROS orders them: products, turned points, interpolation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kineme.validation import Array

#: A quaternion whose norm differs from 1 by more than this is no rotation: zeros, or another quantity.
TOLERANCE = 0.1


def are_rotations(q: Array) -> NDArray[np.bool_]:
    """Whether each quaternion (n, 4) has the norm 1, up to `TOLERANCE`, shape (n,)."""
    return np.asarray(np.abs(np.linalg.norm(q, axis=1) - 1.0) <= TOLERANCE)


def unit(q: Array) -> Array:
    """Quaternions (n, 4) of norm 1."""
    return np.asarray(q / np.linalg.norm(q, axis=1, keepdims=True))


def product(p: Array, q: Array) -> Array:
    """Products p q, shape (n, 4): the rotation q, then p."""
    u, a, v, b = p[:, :3], p[:, 3:], q[:, :3], q[:, 3:]
    return np.hstack((a * v + b * u + np.cross(u, v), a * b - np.sum(u * v, axis=1, keepdims=True)))


def conjugate(q: Array) -> Array:
    """Inverse rotations, shape (n, 4)."""
    return q * np.array([-1.0, -1.0, -1.0, 1.0])


def turned(q: Array, x: Array) -> Array:
    """Points x (n, 3) turned by rotations q (n, 4)."""
    u, w = q[:, :3], q[:, 3:]
    across = 2.0 * np.cross(u, x)
    return np.asarray(x + w * across + np.cross(u, across))


def continuous(q: Array) -> Array:
    """The same rotations with signs chosen such that each quaternion is near the one before."""
    flips = np.sum(q[1:] * q[:-1], axis=1) < 0
    signs = np.concatenate(([1.0], np.where(np.cumsum(flips) % 2 == 1, -1.0, 1.0)))
    return np.asarray(q * signs[:, None])


def interpolated(at: Array, times: Array, q: Array) -> Array:
    """Rotations at other times (m,), by spherical linear interpolation between rows of q (n, 4) at times (n,).

    Before the first time and after the last one the rotation stays.
    """
    if len(times) == 1:
        return np.repeat(unit(q), len(at), axis=0)
    rotations = continuous(unit(q))
    k = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    share = np.clip((at - times[k]) / (times[k + 1] - times[k]), 0.0, 1.0)[:, None]
    first, second = rotations[k], rotations[k + 1]
    angle = np.arccos(np.clip(np.sum(first * second, axis=1, keepdims=True), -1.0, 1.0))
    small = angle < 1e-6
    sine = np.where(small, 1.0, np.sin(angle))
    left = np.where(small, 1.0 - share, np.sin((1.0 - share) * angle) / sine)
    right = np.where(small, share, np.sin(share * angle) / sine)
    return unit(left * first + right * second)
