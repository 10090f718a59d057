"""Reach of an arm: poses of a movement that it does not reach, and by how far."""

from __future__ import annotations

import numpy as np

from kineme.errors import TrajectoryError
from kineme.robots.kinematics.descent import kinematics, postures
from kineme.robots.kinematics.task_path import TaskPath
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_REACHED = 1e-3  # farther from its pose than this, a posture does not reach it [m]
_SEEDS = 48  # starts from which a posture is sought before a pose is said to be out of reach
_MOST_CHECKED = 8  # poses whose distance is sought, of those that are missed
_FAR = 3.0  # from an arm [m]: farther than that, it is rather the unit that is wrong
_REMEDY = (
    "choose another place (--at), free the orientation (follow=, --follow axis), or make the movement smaller (--scale)"
)


class OutOfReachError(TrajectoryError):
    """A pose that no posture of an arm reaches."""


def reaching_postures(robot: Robot, position: Array, rotation: Array, turn_costs: Array, what: str) -> Array:
    """Postures (m, n) whose tips reach a pose; `what` says which pose it is.

    Raises OutOfReachError: there is none: where, and by how far.
    """
    reached = postures(robot, position, rotation, turn_costs)
    if reached.errors[0] > _REACHED:
        reached = postures(robot, position, rotation, turn_costs, _SEEDS)
    if reached.errors[0] > _REACHED:
        raise OutOfReachError(_unreachable(robot, what, float(reached.errors[0])))
    return reached.joints


def check_reached(robot: Robot, path: TaskPath, joints: Array, turn_costs: Array, tolerance: float) -> None:
    """Refuse joints (T, n) whose tip stays farther from the poses of the path than `tolerance` [m].

    Raises OutOfReachError: the pose that is farthest out of reach: at which time, where and by how far;
    TrajectoryError: every pose is within reach, but the tip does not keep up: from when to when.
    """
    errors = np.linalg.norm(kinematics(robot, joints)[0] - path.positions, axis=1)
    missed = np.flatnonzero(~(errors <= tolerance))
    if len(missed) == 0:
        return
    checked = missed[np.unique(np.linspace(0, len(missed) - 1, _MOST_CHECKED).astype(int))]
    nearest = [postures(robot, path.positions[t], path.rotations[t], turn_costs, _SEEDS).errors[0] for t in checked]
    worst = int(np.argmax(nearest))
    if nearest[worst] > tolerance:
        raise OutOfReachError(_unreachable(robot, pose_in_words(path, int(checked[worst])), float(nearest[worst])))
    raise TrajectoryError(
        f"{robot.name} reaches every pose of this movement, but not one after the other: from "
        f"{path.times[missed[0]]:.2f} to {path.times[missed[-1]]:.2f} s its tip stays up to {errors.max():.3f} m away, "
        f"where joints come to a stop or would have to jump; {_REMEDY}"
    )


def pose_in_words(path: TaskPath, t: int) -> str:
    """Position and time of sample t of a path."""
    return f"{point_in_words(path.positions[t])} m at {path.times[t]:.2f} s"


def point_in_words(position: Array) -> str:
    """A position [m], to the millimeter."""
    return f"({', '.join(f'{x:.3f}' for x in position)})"


def _unreachable(robot: Robot, what: str, distance: float) -> str:
    remedy = "is the movement in millimeters? --scale 0.001 makes it meters" if distance > _FAR else _REMEDY
    return f"{robot.name} does not reach {what}: its tip stays {distance:.3f} m away; {remedy}"
