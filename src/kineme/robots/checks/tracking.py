"""Whether the tip follows its path."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from kineme.robots.checks.along import Along
from kineme.robots.checks.check import Check
from kineme.robots.execution.between import between
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.kinematics.descent import kinematics
from kineme.robots.kinematics.inverse import is_partial
from kineme.robots.kinematics.task_path import TaskPath
from kineme.robots.models.robot import Robot
from kineme.validation import Array

TRACKED = 1e-3  # the tip may be this far from the path [m]
TURNED = 1.0  # and turned by so many degrees from it, where the orientation is followed


def tracking(
    robot: Robot, trajectory: JointTrajectory, path: TaskPath, follow: str, known: tuple[Array, Along]
) -> Iterator[Check]:
    """How far the tip is from its path, and how far turned from it.

    Arms of fewer than six joints follow an orientation only as far as the position allows: of theirs, and of what is
    not followed at all, the angle has no limit.

    Parameters
    ----------
    path : TaskPath
        At times of the trajectory.
    follow : {"full", "axis", "free"}
    known : times (m,) and what the arm does then
        Where those times end with the path's, nothing is computed again.
    """
    positions, rotations = _tips(robot, trajectory, path.times, *known)
    off = np.linalg.norm(positions - path.positions, axis=1)
    turned = np.degrees(_angles(rotations, path.rotations, follow))
    t, r = int(np.argmax(off)), int(np.argmax(turned))
    worst, angle = float(off[t]), float(turned[r])
    passed = worst <= TRACKED
    slower = 1.0 if passed else math.inf
    yield Check("tracking", "tip", float(path.times[t]), 1e3 * worst, 1e3 * TRACKED, "mm", passed, slower)
    limit = math.nan if follow == "free" or is_partial(robot) else TURNED
    passed = not angle > limit
    slower = 1.0 if passed else math.inf
    yield Check("turned away", "tip", float(path.times[r]), angle, limit, "deg", passed, slower)


def _tips(robot: Robot, trajectory: JointTrajectory, times: Array, known: Array, state: Along) -> tuple[Array, Array]:
    """Positions (T, 3) and rotations (T, 3, 3) of the tip at those times."""
    if np.array_equal(known[-len(times) :], times):
        return state.tip_positions[-len(times) :], state.tip_rotations[-len(times) :]
    return kinematics(robot, between(trajectory, times).positions)[:2]


def _angles(rotations: Array, wanted: Array, follow: str) -> Array:
    """Angles (T,) between orientations; with "axis", between the z axes of the tip."""
    if follow == "axis":
        cosines = np.einsum("ti,ti->t", rotations[:, :, 2], wanted[:, :, 2])
    else:
        cosines = (np.einsum("tji,tji->t", rotations, wanted) - 1) / 2
    return np.asarray(np.arccos(np.clip(cosines, -1, 1)))
