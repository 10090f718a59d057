"""The timing of a movement on an arm: as generated, slowed down until it passes its checks, or the fastest."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from kineme.robots.checks.check import Check
from kineme.robots.checks.preflight import preflight
from kineme.robots.checks.steps import Steps, steps_kept
from kineme.robots.execution.approach import approach
from kineme.robots.execution.between import dense_times
from kineme.robots.execution.joint_trajectory import JointTrajectory, joined
from kineme.robots.execution.retime import fastest
from kineme.robots.execution.timing import LONGEST, Timing, as_generated, n_samples, timed
from kineme.robots.kinematics.task_path import TaskPath
from kineme.robots.models.robot import Robot
from kineme.robots.planning.robot_movement import RobotMovement
from kineme.validation import Array

SLOWEST_RATE, FASTEST_RATE = 1.0, 10_000.0  # samples per second of what is sent
TIMINGS = ("generated", "slowed", "fastest")
_ROUNDS = 8  # of slowing down: torques do not fall as fast as velocities do
_A_LITTLE = 1 + 1e-6
_APPROACH = 1.01  # times slower than its torques at the samples demand


class Untimed(NamedTuple):
    """What is executed, whatever its timing."""

    robot: Robot
    joints: CubicSpline  # (n,) over the time of the movement
    path: TaskPath | None  # of the tip
    start: Array  # (n,), where the joints stand
    rate: float  # samples per second of what is sent
    step_times: Array  # (T,) [s], from which on each value of `steps` holds
    steps: Mapping[str, Array]  # discrete channels, (T,)
    follow: str  # how much of the orientation
    continuous: Mapping[str, Array] = MappingProxyType({})  # channels that move and are no joints, (T,)


def with_timing(untimed: Untimed, timing: str, most: int = LONGEST) -> RobotMovement:
    """The movement with that timing; "slowed" goes on until it passes, as long as that helps.

    Raises
    ------
    SpecificationError
        More than a million samples; slowed down, more than `most`.
    """
    robot, rate = untimed.robot, untimed.rate
    if timing == "fastest":
        joints, chosen = fastest(robot, untimed.joints, rate)
        return _checked(untimed, joints, chosen)
    joints, factor = untimed.joints, 1.0
    made = _checked(untimed, joints, as_generated(robot, joints, rate))
    for _ in range(_ROUNDS if timing == "slowed" else 0):
        if made.preflight.passed or not np.isfinite(made.preflight.slower):
            break
        factor *= min(made.preflight.slower, _least(robot, joints, factor)) * _A_LITTLE
        n_samples(factor * float(joints.x[-1]), rate, most)
        made = _checked(untimed, joints, as_generated(robot, joints, rate, factor))
    return made


def _least(robot: Robot, joints: CubicSpline, factor: float) -> float:
    """How many times slower than with `factor` velocities and accelerations must be; 2 at least, for torques.

    The accelerations of a cubic spline are largest at its knots. Few samples say too much.
    """
    velocities, accelerations = (np.abs(joints(joints.x, order)).max(axis=0) for order in (1, 2))
    needed = max((velocities / robot.velocity).max(), np.sqrt((accelerations / robot.acceleration).max()))
    return max(2.0, float(needed) / factor)


def _checked(untimed: Untimed, joints: CubicSpline, timing: Timing) -> RobotMovement:
    """The approach and the movement with that timing, and the checks of both; the approach slow enough for torques."""
    made = _assembled(untimed, joints, timing)
    slower = max((check.slower for check in made.preflight.failed if check.time < made.begins), default=1.0)
    return _assembled(untimed, joints, timing, slower * _APPROACH) if 1 < slower < np.inf else made


def _assembled(untimed: Untimed, joints: CubicSpline, timing: Timing, longer: float = 1.0) -> RobotMovement:
    robot = untimed.robot
    in_force = np.searchsorted(untimed.step_times, timing.generated + 1e-9, "right") - 1
    steps = {name: values[in_force] for name, values in untimed.steps.items()}
    along = {name: np.interp(timing.generated, untimed.step_times, x) for name, x in untimed.continuous.items()}
    movement = replace(timed(robot, joints, timing), steps=steps | along)
    first = approach(robot, untimed.start, movement.positions[0], untimed.rate, longer)
    whole = joined(first, movement)
    times = dense_times(robot, whole)
    times = times[np.searchsorted(times, first.duration - 1e-9) :]
    report = preflight(robot, whole, _wanted(untimed, timing, times, first.duration), untimed.follow)
    report = replace(report, checks=(*report.checks, *_steps(untimed, whole)))
    wanted = _wanted(untimed, timing, first.duration + timing.times, first.duration)
    return RobotMovement(robot, whole, wanted, report, first.duration, movement.duration / float(timing.generated[-1]))


def _steps(untimed: Untimed, trajectory: JointTrajectory) -> Iterator[Check]:
    velocities = untimed.joints(untimed.step_times, 1)
    for name, values in untimed.steps.items():
        yield steps_kept(untimed.robot, trajectory, Steps(name, values, velocities))


def _wanted(untimed: Untimed, timing: Timing, times: Array, begins: float) -> TaskPath | None:
    """The poses of the tip at times of the trajectory, in which the movement begins at `begins` [s]."""
    if untimed.path is None:
        return None
    generated = PchipInterpolator(timing.times, timing.generated)(times - begins)
    return untimed.path.at(np.clip(generated, 0.0, timing.generated[-1]))._replace(times=times)
