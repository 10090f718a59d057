"""Check a trajectory before it is written."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import TrajectoryError
from kineme.robots.checks.along import Along, along, between_samples
from kineme.robots.checks.check import Check, Preflight, unit_of
from kineme.robots.checks.tracking import tracking
from kineme.robots.execution.between import between, dense_times
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.execution.timing import STANDS, knows_masses
from kineme.robots.kinematics.task_path import TaskPath
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_STANDING = 0.02  # of the fastest instant as generated, or of the limits of velocity

_SINGULAR = 0.02  # the smallest singular value of the Jacobian below which an arm is said to be singular
_JUMP = 0.05  # a joint may deviate so far between two samples from what its velocities say [rad, m]
_SLACK = 1 + 1e-6


def preflight(
    robot: Robot, trajectory: JointTrajectory, path: TaskPath | None = None, follow: str = "full"
) -> Preflight:
    """Every check of a trajectory.

    Parameters
    ----------
    robot : Robot
    trajectory : JointTrajectory
    path : TaskPath, optional
        What the tip was asked to follow, at times of the trajectory; before its first one lies the approach.
    follow : {"full", "axis", "free"}, default "full"
        How much of the orientation was to be followed; see `InverseKinematics`.

    Returns
    -------
    Preflight
        Limits of position, velocity, acceleration and torque for each joint; the same between samples, where a
        controller interpolates; jumps, standing at both ends, tracking, singularity and self-collision for the arm.

    Raises
    ------
    TrajectoryError
        A trajectory of other joints, of numbers that are not finite, or whose times do not increase.
    """
    _check_numbers(robot, trajectory)
    times = dense_times(robot, trajectory)
    dense = trajectory if len(times) == len(trajectory) else between(trajectory, times)
    state = along(robot, dense)
    checks = [*_positions(robot, trajectory), *_rates(robot, trajectory), *_torques(robot, dense, state)]
    checks += between_samples(robot, trajectory)
    checks += [_jumps(robot, trajectory), _stands(robot, trajectory)]
    checks += [_singularity(dense, state), _collision(dense, state), *_below(robot, dense, state)]
    if path is not None:
        checks += tracking(robot, trajectory, path, follow, (times, state))
    return Preflight(tuple(checks), tuple(_unchecked(robot)))


def _check_numbers(robot: Robot, trajectory: JointTrajectory) -> None:
    shape = (max(2, len(trajectory)), robot.n_joints)
    arrays = {name: getattr(trajectory, name) for name in ("positions", "velocities", "accelerations")}
    for name, values in arrays.items():
        if values.shape != shape:
            raise TrajectoryError(f"expected {name} of shape {shape}, samples and joints, got {values.shape}")
    finite = all(np.isfinite(values).all() for values in (trajectory.times, *arrays.values()))
    if not finite or not np.all(np.diff(trajectory.times) > 0):
        raise TrajectoryError("expected a trajectory of finite numbers, whose times increase")


def _positions(robot: Robot, trajectory: JointTrajectory) -> Iterator[Check]:
    beyond = np.maximum(trajectory.positions - robot.upper, robot.lower - trajectory.positions)
    for j, name in enumerate(robot.joints):
        t = int(np.argmax(beyond[:, j]))
        worst = float(trajectory.positions[t, j])
        limit = robot.upper[j] if worst > (robot.upper[j] + robot.lower[j]) / 2 else robot.lower[j]
        passed, unit = bool(beyond[t, j] <= 1e-6), unit_of(robot, j)
        slower = 1.0 if passed else math.inf
        yield Check("position", name, _at(trajectory, t), worst, float(limit), unit, passed, slower)


def _rates(robot: Robot, trajectory: JointTrajectory) -> Iterator[Check]:
    velocities = ("velocity", trajectory.velocities, robot.velocity)
    accelerations = ("acceleration", trajectory.accelerations, robot.acceleration)
    for order, (what, values, limits) in enumerate((velocities, accelerations), 1):
        for j, name in enumerate(robot.joints):
            t = int(np.argmax(np.abs(values[:, j])))
            worst, limit = abs(float(values[t, j])), float(limits[j])
            passed, slower = worst <= limit * _SLACK, (worst / limit) ** (1 / order)
            yield Check(what, name, _at(trajectory, t), worst, limit, unit_of(robot, j, order), passed, slower)


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
            "N" if robot.units[j] == "m" else "Nm",
            passed,
            _slower_for(holding, moving, limit),
        )


def _slower_for(holding: Array, moving: Array, limit: float) -> float:
    room = limit - holding * np.sign(moving)  # what is left in the direction in which the movement pushes
    if np.any((np.abs(holding) > limit) | (room <= 0)):
        return math.inf
    return float(np.sqrt(np.max(np.abs(moving) / room)))


def _jumps(robot: Robot, trajectory: JointTrajectory) -> Check:
    gaps = np.diff(trajectory.times)[:, None]
    expected = (trajectory.velocities[1:] + trajectory.velocities[:-1]) / 2 * gaps
    off = np.abs(np.diff(trajectory.positions, axis=0) - expected)
    t, j = np.unravel_index(int(np.argmax(off)), off.shape)
    worst, unit = float(off[t, j]), unit_of(robot, int(j))
    slower = max(1.0, math.sqrt(worst / _JUMP))
    return Check("jump", robot.joints[j], _at(trajectory, int(t)), worst, _JUMP, unit, worst <= _JUMP, slower)


def _stands(robot: Robot, trajectory: JointTrajectory) -> Check:
    shares = np.abs(trajectory.velocities[[0, -1]]) / robot.velocity
    end, j = np.unravel_index(int(np.argmax(shares)), shares.shape)
    worst, unit = float(shares[end, j]), "of the velocity limit"
    passed = worst <= STANDS
    slower = 1.0 if passed else math.inf
    return Check(
        "standing at the ends", robot.joints[j], _at(trajectory, -int(end)), worst, STANDS, unit, passed, slower
    )


def _singularity(trajectory: JointTrajectory, state: Along) -> Check:
    t = int(np.argmin(state.smallest_singular_values))
    worst = float(state.smallest_singular_values[t])
    return Check("singularity", "tip", _at(trajectory, t), worst, math.nan, f"(singular below {_SINGULAR:g})", True)


def _below(robot: Robot, trajectory: JointTrajectory, state: Along) -> list[Check]:
    """How far a joint or the tip goes below the base, where a table may be; whether one is there, nobody says."""
    t, j = np.unravel_index(int(np.argmin(state.heights)), state.heights.shape)
    lowest = float(state.heights[t, j])
    where = (*robot.joints, "tip")[j]
    unit = "m (the base stands at 0)"
    return [Check("lowest point", where, _at(trajectory, int(t)), lowest, math.nan, unit, True)] if lowest < 0 else []


def _collision(trajectory: JointTrajectory, state: Along) -> Check:
    if not state.contacts:
        return Check("self-collision", "none", 0.0, 0, 0, "contacts", True)
    t, first, second = min(state.contacts)
    n, links = len(state.contacts), f"{first} and {second}"
    return Check("self-collision", links, _at(trajectory, t), n, 0, "contacts", False, math.inf)


def _unchecked(robot: Robot) -> Iterator[str]:
    if not knows_masses(robot):
        yield "torques: the model has no masses"
    elif np.isnan(robot.effort).any():
        named = ", ".join(np.array(robot.joints)[np.isnan(robot.effort)])
        yield f"torques of {named}: the model does not say the largest"
    weightless = [
        name for name, body in zip(robot.joints, list(robot.model.inertias)[1:], strict=True) if body.mass <= 0
    ]
    if knows_masses(robot) and weightless:
        yield f"the weight of what {', '.join(weightless)} move: the model has no masses there"
    if robot.geometry.ngeoms == 0:
        yield "self-collision: the model has no shapes"


def _at(trajectory: JointTrajectory, t: int) -> float:
    return float(trajectory.times[t])


class Steps(NamedTuple):
    """A discrete channel as it was generated, T samples."""

    name: str
    values: Array  # (T,)
    velocities: Array  # (T, n), of the joints


def steps_kept(robot: Robot, trajectory: JointTrajectory, generated: Steps) -> Check:
    """Every value of the channel is there, in the same order, and what changed while the arm stood does so still.

    Too few samples lose a short pulse; the fastest timing leaves out the time in which an arm stands and waits for its
    gripper. What changes in motion as it was generated passes; the fastest of these is said, without a limit.
    """
    name, sent = generated.name, trajectory.steps[generated.name]
    before, now = _changes(generated.values), _changes(sent)
    if not np.array_equal(_order(generated.values, before), _order(sent, now)):
        return Check("steps", name, 0.0, len(now), len(before), "changes", False, math.inf)
    if len(now) == 0:
        return Check("steps", name, 0.0, 0, 0, "changes", True)
    speeds = np.abs(generated.velocities).max(axis=1)
    stood = speeds[before] <= _STANDING * speeds.max()
    shares = (np.abs(trajectory.velocities[now]) / robot.velocity).max(axis=1)
    passed = not np.any(stood & (shares > _STANDING))
    moving = passed and not stood.all()
    worst = int(np.argmax(np.where(stood, 0.0, shares) if moving else np.where(stood, shares, 0.0)))
    limit, unit = (math.nan, "of the velocity limit, moving") if moving else (_STANDING, "of the velocity limit")
    at, slower = float(trajectory.times[now[worst]]), 1.0 if passed else math.inf
    return Check("steps", name, at, float(shares[worst]), limit, unit, passed, slower)


def _changes(values: Array) -> NDArray[np.intp]:
    """Indices of the samples from which another value holds."""
    return np.flatnonzero(np.diff(values)) + 1


def _order(values: Array, changes: NDArray[np.intp]) -> Array:
    return values[np.concatenate(([0], changes))]
