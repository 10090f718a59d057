"""The timing of a movement on an arm: as generated, slowed down until it passes its checks, or the fastest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from kineme.errors import SpecificationError
from kineme.robots.checks.preflight import preflight
from kineme.robots.execution.approach import approach
from kineme.robots.execution.joint_trajectory import joined
from kineme.robots.execution.retime import fastest
from kineme.robots.execution.timing import Timing, as_generated, slowed, timed
from kineme.robots.kinematics.task_path import TaskPath
from kineme.robots.models.robot import Robot
from kineme.robots.planning.robot_movement import RobotMovement
from kineme.validation import Array

TIMINGS = ("generated", "slowed", "fastest")
_LONGEST = 1_000_000  # samples of one trajectory, at most
_ROUNDS = 4  # of slowing down: torques do not fall as fast as velocities do
_A_LITTLE = 1 + 1e-6


class Untimed(NamedTuple):
    """What is executed, whatever its timing."""

    robot: Robot
    joints: CubicSpline  # (n,) over the time of the movement, or over its length
    path: TaskPath | None  # of the tip
    start: Array  # (n,), where the joints stand
    rate: float  # samples per second of what is sent
    step_times: Array  # (T,) [s], from which on each value of `steps` holds
    steps: Mapping[str, Array]  # discrete channels, (T,)


def with_timing(untimed: Untimed, timing: str) -> RobotMovement:
    """The movement with that timing; "slowed" goes on until it passes, as long as that helps.

    Raises
    ------
    SpecificationError
        More than a million samples.
    """
    robot, rate = untimed.robot, untimed.rate
    _check_length(float(untimed.joints.x[-1]) * rate)
    if timing == "fastest":
        joints, chosen = fastest(robot, untimed.joints, rate)
        return _checked(untimed._replace(joints=joints), chosen)
    chosen = as_generated(robot, untimed.joints, rate)
    made = _checked(untimed, chosen)
    for _ in range(_ROUNDS if timing == "slowed" else 0):
        if made.preflight.passed or not np.isfinite(made.preflight.slower):
            break
        _check_length(made.trajectory.duration * made.preflight.slower * rate)
        chosen = slowed(chosen, made.preflight.slower * _A_LITTLE, rate)
        made = _checked(untimed, chosen)
    return made


def _check_length(n_samples: float) -> None:
    if not n_samples <= _LONGEST:
        raise SpecificationError(
            f"expected at most {_LONGEST:,} samples of one trajectory, got {n_samples:,.0f}; choose a lower rate or a "
            "shorter movement"
        )


def _checked(untimed: Untimed, timing: Timing) -> RobotMovement:
    """The approach and the movement with that timing, and the checks of both."""
    robot, path = untimed.robot, untimed.path
    in_force = np.searchsorted(untimed.step_times, timing.generated + 1e-9, "right") - 1
    steps = {name: values[in_force] for name, values in untimed.steps.items()}
    movement = replace(timed(robot, untimed.joints, timing), steps=steps)
    first = approach(robot, untimed.start, movement.positions[0], untimed.rate)
    whole = joined(first, movement)
    wanted = None if path is None else path.at(timing.generated)._replace(times=timing.times + first.duration)
    report = preflight(robot, whole, wanted, first.duration)
    return RobotMovement(robot, whole, wanted, report, first.duration, movement.duration / float(timing.generated[-1]))
