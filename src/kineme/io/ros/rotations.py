"""Unit quaternions in rows as ROS orders them, (x, y, z, w); `kineme.movements.rotations` has w first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kineme.movements.rotations.quaternions import continuous
from kineme.movements.rotations.rotation_vectors import slerp
from kineme.validation import Array

#: A quaternion whose norm differs from 1 by more than this is no rotation: zeros, or another quantity.
TOLERANCE = 0.1


def are_rotations(q: Array) -> NDArray[np.bool_]:
    """Whether each quaternion (n, 4), of any order, has the norm 1, up to `TOLERANCE`, shape (n,)."""
    return np.asarray(np.abs(np.linalg.norm(q, axis=1) - 1.0) <= TOLERANCE)


def from_ros(q: Array) -> Array:
    """Quaternions (n, 4) with w last as ones of norm 1 with w first."""
    return np.asarray(np.roll(q, 1, axis=1) / np.linalg.norm(q, axis=1, keepdims=True))


def to_ros(q: Array) -> Array:
    """Quaternions (n, 4) with w first as ones of norm 1 with w last."""
    return np.asarray(np.roll(q, -1, axis=1) / np.linalg.norm(q, axis=1, keepdims=True))


def interpolated(at: Array, times: Array, q: Array) -> Array:
    """Rotations (m, 4) at other times (m,), by spherical linear interpolation between rows of q (n, 4) at times (n,).

    Before the first time and after the last one the rotation stays.
    """
    rotations = continuous(from_ros(q))
    if len(times) == 1:
        return np.repeat(to_ros(rotations), len(at), axis=0)
    k = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    share = np.clip((at - times[k]) / (times[k + 1] - times[k]), 0.0, 1.0)
    return to_ros(slerp(rotations[k], rotations[k + 1], share))
