"""The movement as poses of the tip: what inverse kinematics follows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.rotations import matrices_of
from kineme.validation import Array, as_numbers

#: Planes in which a two-dimensional movement is executed: its axes in the frame of the robot.
PLANES = {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}


class TaskPath(NamedTuple):
    """Poses of the tip in the frame of the robot's base, T samples."""

    times: Array  # (T,) [s], from 0
    positions: Array  # (T, 3) [m]
    rotations: Array  # (T, 3, 3)

    def at(self, times: Array) -> TaskPath:
        """The poses at other times: cubic between positions and between orientations."""
        positions = CubicSpline(self.times, self.positions)(times)
        if np.ptp(self.rotations, axis=0).max() == 0:
            return TaskPath(times, positions, np.broadcast_to(self.rotations[0], (len(times), 3, 3)))
        rotations = Rotation.from_matrix(np.array(self.rotations))  # SciPy 1.14 takes no read-only array
        return TaskPath(times, positions, RotationSpline(self.times, rotations)(times).as_matrix())


def task_path(
    times: Array, positions: Array, orientation: ArrayLike, plane: str = "xy", through: ArrayLike | None = None
) -> TaskPath:
    """Positions of two or three dimensions, and orientations, as poses.

    - `times` (T,).
    - `positions` (T, 2) or (T, 3).
    - `orientation` (4,) or (T, 4): unit quaternion w, x, y, z of the tip, one for all samples or one for each.
    - `plane` ({"xy", "xz", "yz"}): where the two axes of a two-dimensional movement lie.
    - `through` (3,): a point of that plane; the origin if it is not given.

    Raises TrajectoryError: positions of another number of dimensions; an orientation of another shape, or not of norm
    1; SpecificationError: an unknown plane.
    """
    d = positions.shape[1]
    if d not in (2, 3):
        raise TrajectoryError(
            f"expected a movement of the tip, of 2 or 3 dimensions, got {d}; a movement of the joints has as many as "
            "the robot"
        )
    if plane not in PLANES:
        raise SpecificationError(f"expected plane as one of {', '.join(PLANES)}, got {plane!r}")
    points = np.tile(np.zeros(3) if through is None else as_numbers(through, "through"), (len(times), 1))
    points[:, list(PLANES[plane]) if d == 2 else [0, 1, 2]] = positions
    return TaskPath(times, points, np.broadcast_to(_rotations(orientation, len(times)), (len(times), 3, 3)))


def _rotations(orientation: ArrayLike, n_samples: int) -> Array:
    """Rotation matrices, (3, 3) or (T, 3, 3)."""
    q = as_numbers(orientation, "orientation")
    if q.shape not in {(4,), (n_samples, 4)}:
        raise TrajectoryError(
            f"expected orientation as one quaternion (w, x, y, z) or {n_samples} of them, got shape {q.shape}"
        )
    return matrices_of(q)
