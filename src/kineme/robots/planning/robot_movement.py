"""A movement on an arm: what is sent, what the tip follows, and the checks of both."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from kineme.robots.execution.joint_trajectory import JointTrajectory, dense_times, joined
from kineme.robots.execution.preflight import SAMPLING, Check, Preflight, Steps, preflight, steps_kept
from kineme.robots.execution.timing import LONGEST, Timed, approach, as_generated, fastest, n_samples, sampled
from kineme.robots.kinematics.task_path import TaskPath
from kineme.robots.models.robot import Robot
from kineme.validation import Array

SLOWEST_RATE, FASTEST_RATE = 1.0, 10_000.0  # samples per second of what is sent
TIMINGS = ("generated", "slowed", "fastest")
_ROUNDS = 16  # of slowing down, at most
_A_LITTLE = 1e-6  # slower at least, from one round to the next twice as much: samples lie elsewhere each time
_CLOSE = 1.005  # times as slow as what does not pass: no faster one is looked for
_OF_SPEED = ("velocity", "acceleration", "torque")
_APPROACH = 1.01  # times slower than its torques at the samples demand

_LEAST_CHANGE = 0.005  # of a change of the duration, which is said to three digits


@dataclass(frozen=True, eq=False, repr=False)
class RobotMovement:
    """What `move` made.

    Attributes
    ----------
    robot : Robot
    trajectory : JointTrajectory
        What is sent to the arm: the approach from the posture where it stands, then the movement.
    path : TaskPath or None
        What the tip follows, at the samples of the movement; None of a movement of the joints.
    preflight : Preflight
        All checks of `trajectory`.
    begins : float
        When the approach is over and the movement begins [s].
    factor : float
        How many times as long the movement takes as it was generated.
    """

    robot: Robot
    trajectory: JointTrajectory
    path: TaskPath | None
    preflight: Preflight
    begins: float
    factor: float

    @property
    def first(self) -> int:
        """Number of the sample of `trajectory` at which the movement begins."""
        return int(np.searchsorted(self.trajectory.times, self.begins - 1e-9))

    def __repr__(self) -> str:
        return f"RobotMovement({self.robot.name!r}, {duration_in_words(self)})"


def duration_in_words(made: RobotMovement) -> str:
    """How long it takes, with how much of that is approach, and how many times as long as generated, if it is."""
    slower = f", {made.factor:.3g} times as long as generated" if abs(made.factor - 1) > _LEAST_CHANGE else ""
    return f"{made.trajectory.duration:.2f} s, of which {made.begins:.2f} s of approach{slower}"


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
    """The movement with that timing; "slowed" and "fastest" as slow as it passes, if any speed does.

    Where the fastest timing along the path is slower than the movement itself, it is that.

    Raises SpecificationError: more than a million samples; slowed down, more than `most`; TrajectoryError: the fastest
    timing of a movement in which no joint moves.
    """
    robot, joints, rate = untimed.robot, untimed.joints, untimed.rate
    itself = partial(as_generated, robot, joints, rate)
    if timing == "generated":
        return _checked(untimed, itself(1.0))
    if timing == "slowed":
        return _slowed(untimed, itself, most)
    parameterization = fastest(robot, joints)
    if parameterization is None:
        return _slowed(untimed, itself, most)
    made = _slowed(untimed, partial(sampled, robot, parameterization, rate), most, follows=True)
    if made.factor <= 1 or not np.isfinite(made.preflight.slower):
        return made
    other = _slowed(untimed, itself, most)
    return min((made, other), key=lambda one: (not one.preflight.passed, one.trajectory.duration))


def _slowed(untimed: Untimed, course: Callable[[float], Timed], most: int, follows: bool = False) -> RobotMovement:
    """The movement as many times as slowly as its course is at the least factor from 1 on with which it passes.

    What the checks of one factor demand is the next one, if it lies between the largest that fails and the least that
    passes. With `follows` it is the speed that leads the tip off its path.
    """
    robot, joints, factor = untimed.robot, untimed.joints, 1.0
    made = first = _checked(untimed, course(factor))
    fails, passes, passing = 1.0, np.inf, None
    for k in range(_ROUNDS):
        if made.preflight.passed:
            passes, passing = factor, made
            if factor == 1 or passes / fails < _CLOSE or _used(made) * _CLOSE > 1:
                break
            factor *= max(_used(made), float(np.sqrt(fails / factor)))
        else:
            needed = _needed(untimed, made, follows)
            if not np.isfinite(needed):
                break
            fails = factor
            factor *= max(min(needed, _least(robot, joints, factor)), 1 + _A_LITTLE * 2**k)
            if factor >= passes:
                factor = float(np.sqrt(fails * passes))
        n_samples(factor * float(joints.x[-1]), untimed.rate, most)
        made = _checked(untimed, course(factor))
    return passing or (made if np.isfinite(_needed(untimed, made, follows)) else first)


def _needed(untimed: Untimed, made: RobotMovement, follows: bool) -> float:
    """How many times slower the checks that failed demand; a distance from the path falls with the square of it."""
    return max(
        (_off_path(c) if follows and c.what == "tracking" else c.slower for c in made.preflight.failed), default=1.0
    )


def _off_path(check: Check) -> float:
    return float(np.sqrt(check.worst / check.limit))


def _used(made: RobotMovement) -> float:
    """What share of the limits that speed is up to the movement takes, as a factor of its duration."""
    return max(c.slower for c in made.preflight.checks if c.what.removesuffix(SAMPLING) in _OF_SPEED)


def _least(robot: Robot, joints: CubicSpline, factor: float) -> float:
    """How many times slower than with `factor` velocities and accelerations must be; 2 at least, for torques.

    The accelerations of a cubic spline are largest at its knots. Few samples say too much.
    """
    velocities, accelerations = (np.abs(joints(joints.x, order)).max(axis=0) for order in (1, 2))
    needed = max((velocities / robot.velocity).max(), np.sqrt((accelerations / robot.acceleration).max()))
    return max(2.0, float(needed) / factor)


def _checked(untimed: Untimed, movement: Timed) -> RobotMovement:
    """The approach and the movement, and the checks of both; the approach slow enough for torques."""
    made = _assembled(untimed, movement)
    slower = max((check.slower for check in made.preflight.failed if check.time < made.begins), default=1.0)
    return _assembled(untimed, movement, slower * _APPROACH) if 1 < slower < np.inf else made


def _assembled(untimed: Untimed, movement: Timed, longer: float = 1.0) -> RobotMovement:
    robot, generated = untimed.robot, movement.generated
    in_force = np.searchsorted(untimed.step_times, generated + 1e-9, "right") - 1
    steps = {name: values[in_force] for name, values in untimed.steps.items()}
    along = {name: np.interp(generated, untimed.step_times, x) for name, x in untimed.continuous.items()}
    second = replace(movement.trajectory, steps=steps | along)
    first = approach(robot, untimed.start, second.positions[0], untimed.rate, longer)
    whole = joined(first, second)
    times = dense_times(robot, whole)
    times = times[np.searchsorted(times, first.duration - 1e-9) :]
    report = preflight(robot, whole, _wanted(untimed, movement, times, first.duration), untimed.follow)
    report = replace(report, checks=(*report.checks, *_steps(untimed, whole)))
    wanted = _wanted(untimed, movement, first.duration + second.times, first.duration)
    return RobotMovement(robot, whole, wanted, report, first.duration, second.duration / float(generated[-1]))


def _steps(untimed: Untimed, trajectory: JointTrajectory) -> Iterator[Check]:
    velocities = untimed.joints(untimed.step_times, 1)
    for name, values in untimed.steps.items():
        yield steps_kept(untimed.robot, trajectory, Steps(name, values, velocities))


def _wanted(untimed: Untimed, movement: Timed, times: Array, begins: float) -> TaskPath | None:
    """The poses of the tip at times of the trajectory, in which the movement begins at `begins` [s]."""
    if untimed.path is None:
        return None
    generated = PchipInterpolator(movement.trajectory.times, movement.generated)(times - begins)
    return untimed.path.at(np.clip(generated, 0.0, movement.generated[-1]))._replace(times=times)
