"""Unit quaternions (w, x, y, z) as rotation matrices, and back."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from kineme.movements.rotations.quaternions import normalized
from kineme.validation import Array


def matrices_of(q: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4).

    Raises
    ------
    TrajectoryError
        Not of shape (..., 4), or not of norm 1; see `normalized`.
    """
    q = normalized(q)
    rows = Rotation.from_quat(q.reshape(-1, 4), scalar_first=True).as_matrix()
    return np.asarray(rows.reshape(*q.shape[:-1], 3, 3))


def quaternion_of(R: Array) -> Array:
    """The unit quaternion (4,) of a rotation matrix (3, 3)."""
    return np.asarray(Rotation.from_matrix(np.array(R)).as_quat(scalar_first=True))  # SciPy 1.14: none read-only
