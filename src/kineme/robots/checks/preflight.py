"""Check a trajectory before it is written."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from kineme.robots.checks.along import Along, along
from kineme.robots.checks.check import Check, Preflight
from kineme.robots.checks.torques import knows_masses
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.execution.timing import STANDS
from kineme.robots.kinematics.task_path import TaskPath
from kineme.robots.models.robot import Robot
from kineme.validation import Array

TRACKED = 1e-3  # the tip may be this far from the path [m]
_SINGULAR = 0.02  # the smallest singular value of the Jacobian below which an arm is said to be singular
_JUMP = 0.05  # a joint may deviate so far between two samples from what its velocities say [rad, m]
_SLACK = 1 + 1e-6


def preflight(
    robot: Robot, trajectory: JointTrajectory, path: TaskPath | None = None, begins: float = 0.0
) -> Preflight:
    """Every check of a trajectory.

    Parameters
    ----------
    robot : Robot
    trajectory : JointTrajectory
    path : TaskPath, optional
        What the tip was asked to follow; the tracking error is that at its samples.
    begins : float, default 0
        When the path begins in the trajectory [s]; before it lies the approach.

    Returns
    -------
    Preflight
        Limits of position, velocity, acceleration and torque for each joint; jumps, standing at both ends, tracking,
        singularity and self-collision for the arm.
    """
    state = along(robot, trajectory)
    checks = [check for limit in _OF_JOINTS for check in limit(robot, trajectory, state)]
    checks += [check(robot, trajectory, state) for check in _OF_THE_ARM]
    if path is not None:
        checks += _tracking(robot, trajectory, state, path, begins)
    return Preflight(tuple(checks), tuple(_unchecked(robot)))


def _positions(robot: Robot, trajectory: JointTrajectory, state: Along) -> Iterator[Check]:
    beyond = np.maximum(trajectory.positions - robot.upper, robot.lower - trajectory.positions)
    for j, name in enumerate(robot.joints):
        t = int(np.argmax(beyond[:, j]))
        worst = float(trajectory.positions[t, j])
        limit = robot.upper[j] if worst > (robot.upper[j] + robot.lower[j]) / 2 else robot.lower[j]
        passed = bool(beyond[t, j] <= 1e-6)
        yield Check(
            "position", name, _at(trajectory, t), worst, float(limit), "rad", passed, 1.0 if passed else math.inf
        )


def _rates(what: str, order: int) -> Callable[[Robot, JointTrajectory, Along], Iterator[Check]]:
    unit = f"rad/s{'^2' if order == 2 else ''}"

    def check(robot: Robot, trajectory: JointTrajectory, state: Along) -> Iterator[Check]:
        values = np.abs(trajectory.velocities if order == 1 else trajectory.accelerations)
        limits = robot.velocity if order == 1 else robot.acceleration
        for j, name in enumerate(robot.joints):
            t = int(np.argmax(values[:, j]))
            worst, limit = float(values[t, j]), float(limits[j])
            yield Check(
                what,
                name,
                _at(trajectory, t),
                worst,
                limit,
                unit,
                worst <= limit * _SLACK,
                (worst / limit) ** (1 / order),
            )

    return check


def _torques(robot: Robot, trajectory: JointTrajectory, state: Along) -> Iterator[Check]:
    """Of a movement k times as long the torque is ``holding + moving / k^2``."""
    if not knows_masses(robot):
        return
    for j in np.flatnonzero(~np.isnan(robot.effort)):
        holding, moving, limit = state.holding_torques[:, j], state.moving_torques[:, j], float(robot.effort[j])
        total = np.abs(holding + moving)
        t = int(np.argmax(total))
        passed = bool(total[t] <= limit * _SLACK)
        yield Check(
            "torque",
            robot.joints[j],
            _at(trajectory, t),
            float(total[t]),
            limit,
            "Nm",
            passed,
            1.0 if passed else _slower_for(holding, moving, limit),
        )


def _slower_for(holding: Array, moving: Array, limit: float) -> float:
    room = limit - holding * np.sign(moving)  # what is left in the direction in which the movement pushes
    if np.any((np.abs(holding) > limit) | (room <= 0)):
        return math.inf
    return float(np.sqrt(np.max(np.abs(moving) / room)))


def _jumps(robot: Robot, trajectory: JointTrajectory, state: Along) -> Check:
    gaps = np.diff(trajectory.times)[:, None]
    expected = (trajectory.velocities[1:] + trajectory.velocities[:-1]) / 2 * gaps
    off = np.abs(np.diff(trajectory.positions, axis=0) - expected)
    t, j = np.unravel_index(int(np.argmax(off)), off.shape)
    worst = float(off[t, j])
    return Check(
        "jump",
        robot.joints[j],
        _at(trajectory, int(t)),
        worst,
        _JUMP,
        "rad",
        worst <= _JUMP,
        1.0 if worst <= _JUMP else math.inf,
    )


def _stands(robot: Robot, trajectory: JointTrajectory, state: Along) -> Check:
    shares = np.abs(trajectory.velocities[[0, -1]]) / robot.velocity
    end, j = np.unravel_index(int(np.argmax(shares)), shares.shape)
    worst = float(shares[end, j])
    return Check(
        "standing at the ends",
        robot.joints[j],
        _at(trajectory, -int(end)),
        worst,
        STANDS,
        "of the velocity limit",
        worst <= STANDS,
        worst / STANDS,
    )


def _singularity(robot: Robot, trajectory: JointTrajectory, state: Along) -> Check:
    t = int(np.argmin(state.smallest_singular_values))
    worst = float(state.smallest_singular_values[t])
    return Check("singularity", "tip", _at(trajectory, t), worst, math.nan, f"(singular below {_SINGULAR:g})", True)


def _collision(robot: Robot, trajectory: JointTrajectory, state: Along) -> Check:
    if not state.contacts:
        return Check("self-collision", "none", 0.0, 0, 0, "contacts", True)
    t, first, second = min(state.contacts)
    return Check(
        "self-collision",
        f"{first} and {second}",
        _at(trajectory, t),
        len(state.contacts),
        0,
        "contacts",
        False,
        math.inf,
    )


def _tracking(robot: Robot, trajectory: JointTrajectory, state: Along, path: TaskPath, begins: float) -> list[Check]:
    first = int(np.searchsorted(trajectory.times, begins - 1e-9))
    off = np.linalg.norm(state.tip_positions[first:] - path.positions, axis=1)
    relative = np.einsum("tji,tjk->tik", state.tip_rotations[first:], path.rotations)
    cosine = np.clip((np.trace(relative, axis1=1, axis2=2) - 1) / 2, -1, 1)
    turned = np.degrees(np.arccos(cosine))
    t, r = int(np.argmax(off)), int(np.argmax(turned))
    worst = float(off[t])
    return [
        Check(
            "tracking",
            "tip",
            _at(trajectory, first + t),
            1e3 * worst,
            1e3 * TRACKED,
            "mm",
            worst <= TRACKED,
            1.0 if worst <= TRACKED else math.inf,
        ),
        Check("turned away", "tip", _at(trajectory, first + r), float(turned[r]), math.nan, "deg", True),
    ]


def _unchecked(robot: Robot) -> Iterator[str]:
    if not knows_masses(robot):
        yield "torques: the model has no masses"
    elif np.isnan(robot.effort).any():
        named = ", ".join(np.array(robot.joints)[np.isnan(robot.effort)])
        yield f"torques of {named}: the model does not say the largest"
    if robot.geometry.ngeoms == 0:
        yield "self-collision: the model has no shapes"


def _at(trajectory: JointTrajectory, t: int) -> float:
    return float(trajectory.times[t])


_OF_JOINTS = (_positions, _rates("velocity", 1), _rates("acceleration", 2), _torques)
_OF_THE_ARM = (_jumps, _stands, _singularity, _collision)
