"""One rotation in Python's floats, for steps of live control: what `exp`, `log` and `nearest` do to arrays.

NumPy needs a microsecond for each operation however small, which is ten times what these functions take altogether.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from kineme.movements.rotations.quaternions import NORM_TOLERANCE
from kineme.movements.rotations.rotation_vectors import TINY

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

_TURN = 2.0 * math.pi


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
    """Of the rotation vectors of one quaternion that nearest to `near` [rad]; None unless its norm is about 1.

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
