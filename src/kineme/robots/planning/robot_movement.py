"""A movement on an arm: what is sent, what the tip follows, and the checks of both."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from kineme.errors import SpecificationError, TrajectoryError
from kineme.robots.execution.joint_trajectory import (
    LONGEST,
    JointTrajectory,
    Timed,
    approach,
    as_generated,
    dense_times,
    fastest,
    joined,
    n_samples,
    sampled,
)
from kineme.robots.execution.preflight import SAMPLING, Preflight, Steps, preflight, steps_kept
from kineme.robots.kinematics.descent import TaskPath, point_in_words
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_OF_SAMPLING = ("jump", "tracking", "turned away", "steps")  # may be mended by more samples
_ELSEWHERE = "No speed helps: choose another place (--at), orientation (--orientation, --follow) or posture (--rest)"
OTHER_JOINTS = "No speed helps: choose another goal (--goal) or start (--at) of the joints"
_TRIED = 20_000  # samples, at most, of the movement slowed down
_ENOUGH = 1_000.0  # samples per second to learn by how much; more of them pass as well
_MORE = 10  # times the samples, where they are too few

_FAR = 0.5  # outside its limits, a joint is not checked further [rad, m]
_NAMED = 4  # checks that the message names, the worst first

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
    """The result of `move`: a movement on an arm, with its checks.

    - `trajectory`: what is sent to the arm: the approach from the posture where it stands, then the movement.
    - `path`: what the tip follows, at the samples of the movement; None of a movement of the joints.
    - `preflight`: all checks of `trajectory`.
    - `begins`: when the approach is over and the movement begins [s].
    - `factor`: how many times as long the movement takes as it was generated.
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


def duration_in_words(movement: RobotMovement) -> str:
    """Write the duration, with the share of the approach, and how many times as long as generated it is."""
    factor = movement.factor
    slower = f", {factor:.3g} times as long as generated" if abs(factor - 1) > _LEAST_CHANGE else ""
    return f"{movement.trajectory.duration:.2f} s, of which {movement.begins:.2f} s of approach{slower}"


class PlannedPath(NamedTuple):
    """A path of the joints and all that goes with it, whatever its timing."""

    robot: Robot
    joints: CubicSpline  # (n,) over the time of the movement
    path: TaskPath | None  # of the tip
    start: Array  # (n,), where the joints stand
    rate: float  # samples per second of what is sent
    step_times: Array  # (T,) [s], from which on each value of `steps` holds
    steps: Mapping[str, Array]  # discrete channels, (T,)
    follow: str  # how much of the orientation
    continuous: Mapping[str, Array] = MappingProxyType({})  # channels that move and are no joints, (T,)


def with_timing(planned: PlannedPath, timing: str, most: int = LONGEST) -> RobotMovement:
    """The movement with that timing; "slowed" and "fastest" as slow as it passes, if any speed does."""
    robot, joints, rate = planned.robot, planned.joints, planned.rate
    itself = partial(as_generated, robot, joints, rate)
    if timing == "generated":
        return _checked(planned, itself(1.0))
    parameterization = fastest(robot, joints) if timing == "fastest" else None
    if parameterization is None:
        return _slowed(planned, itself, most)
    result = _slowed(planned, partial(sampled, robot, parameterization, rate), most, follows=True)
    if result.factor <= 1 or not np.isfinite(result.preflight.slower):
        return result
    other = _slowed(planned, itself, most)  # the fastest timing along the path is slower than that
    return min((result, other), key=lambda each: (not each.preflight.passed, each.trajectory.duration))


def _slowed(planned: PlannedPath, course: Callable[[float], Timed], most: int, follows: bool = False) -> RobotMovement:
    """The movement as many times as slowly as its course is at the least factor from 1 on with which it passes.

    What the checks of one factor demand is the next one, if it lies between the largest that fails and the least that
    passes. With `follows` it is the speed that leads the tip off its path.
    """
    robot, joints, factor = planned.robot, planned.joints, 1.0
    # The accelerations of a cubic spline are largest at its knots. Few samples say too much.
    velocities, accelerations = (np.abs(joints(joints.x, order)).max(axis=0) for order in (1, 2))
    enough = float(max((velocities / robot.velocity).max(), np.sqrt((accelerations / robot.acceleration).max())))
    result = first = _checked(planned, course(factor))
    fails, passes, passing = 1.0, np.inf, None
    for k in range(_ROUNDS):
        if result.preflight.passed:
            passes, passing = factor, result
            # The share of the limits that speed is up to, as a factor of the duration.
            used = max(c.slower for c in result.preflight.checks if c.what.removesuffix(SAMPLING) in _OF_SPEED)
            if factor == 1 or passes / fails < _CLOSE or used * _CLOSE > 1:
                break
            factor *= max(used, float(np.sqrt(fails / factor)))
        else:
            needed = _needed(result, follows)
            if not np.isfinite(needed):
                break
            fails = factor
            factor *= max(min(needed, max(2.0, enough / factor)), 1 + _A_LITTLE * 2**k)  # 2 at least, for torques
            if factor >= passes:
                factor = float(np.sqrt(fails * passes))
        n_samples(factor * float(joints.x[-1]), planned.rate, most)
        result = _checked(planned, course(factor))
    return passing or (result if np.isfinite(_needed(result, follows)) else first)


def _needed(movement: RobotMovement, follows: bool) -> float:
    """Return how many times slower failed checks demand; a distance from the path falls with the square of it."""
    factors = (
        float(np.sqrt(check.worst / check.limit)) if follows and check.what == "tracking" else check.slower
        for check in movement.preflight.failed
    )
    return max(factors, default=1.0)


def _checked(planned: PlannedPath, movement: Timed) -> RobotMovement:
    """Join the approach and the movement, and check both; the approach is slow enough for torques."""
    result = _assembled(planned, movement)
    slower = max((check.slower for check in result.preflight.failed if check.time < result.begins), default=1.0)
    return _assembled(planned, movement, slower * _APPROACH) if 1 < slower < np.inf else result


def _assembled(planned: PlannedPath, movement: Timed, longer: float = 1.0) -> RobotMovement:
    robot, generated = planned.robot, movement.generated
    in_force = np.searchsorted(planned.step_times, generated + 1e-9, "right") - 1
    steps = {name: values[in_force] for name, values in planned.steps.items()}
    along = {name: np.interp(generated, planned.step_times, x) for name, x in planned.continuous.items()}
    second = replace(movement.trajectory, steps=steps | along)
    first = approach(robot, planned.start, second.positions[0], planned.rate, longer)
    trajectory = joined(first, second)

    def target_poses(times: Array) -> TaskPath | None:
        if planned.path is None:
            return None
        at = PchipInterpolator(movement.trajectory.times, generated)(times - first.duration)
        return planned.path.at(np.clip(at, 0.0, generated[-1]))._replace(times=times)

    times = dense_times(robot, trajectory)
    report = preflight(
        robot, trajectory, target_poses(times[np.searchsorted(times, first.duration - 1e-9) :]), planned.follow
    )
    velocities = planned.joints(planned.step_times, 1)
    step_checks = (
        steps_kept(robot, trajectory, Steps(name, values, velocities)) for name, values in planned.steps.items()
    )
    report = replace(report, checks=(*report.checks, *step_checks))
    path, factor = target_poses(first.duration + second.times), second.duration / float(generated[-1])
    return RobotMovement(robot, trajectory, path, report, first.duration, factor)


class InfeasibleError(TrajectoryError):
    """A trajectory that an arm cannot or must not execute; ``preflight`` holds the checks."""

    def __init__(self, message: str, preflight: Preflight | None = None) -> None:
        super().__init__(message)
        self.preflight = preflight


def refuse_outside(robot: Robot, times: Array, joints: Array) -> None:
    """Refuse a movement of the joints (T, n) that is far outside their limits, before anything is computed."""
    beyond = np.maximum(robot.lower - joints, joints - robot.upper)
    t, j = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    if beyond[t, j] > _FAR:
        limit = robot.lower[j] if joints[t, j] < robot.lower[j] else robot.upper[j]
        raise InfeasibleError(
            f"{robot.name} cannot execute this: position of {robot.joints[j]} at {times[t]:.2f} s: {joints[t, j]:.3g}, "
            f"limit {limit:.3g} {robot.units[j]}. {OTHER_JOINTS}"
        )


def refuse_failed(movement: RobotMovement, planned: PlannedPath, timing: str) -> None:
    """Refuse a movement that did not pass its checks, with the least duration that works."""
    failed, path = movement.preflight.failed, movement.path
    if not failed:
        return
    lines = []
    for check in failed[:_NAMED]:
        target = ""  # of the tip when it was farthest from there
        if check.what == "tracking" and path is not None:
            position = path.positions[int(np.argmin(np.abs(path.times - check.time)))]
            target = f", from {point_in_words(position)} m"
        place = f"{check.what} of {check.where} at {check.time:.2f} s{target}"
        lines.append(f"{place}: {check.worst:.3g}, limit {check.limit:.3g} {check.unit}")
    more = f" and {len(failed) - _NAMED} more" if len(failed) > _NAMED else ""
    raise InfeasibleError(
        f"{movement.robot.name} cannot execute this: {'; '.join(lines)}{more}. {remedy(movement, planned, timing)}",
        movement.preflight,
    )


def remedy(movement: RobotMovement, planned: PlannedPath, timing: str) -> str:
    """Write what was tried and works: more samples, a lower speed, or both."""
    failed, duration = movement.preflight.failed, movement.trajectory.duration - movement.begins
    finer = planned._replace(rate=min(_MORE * planned.rate, FASTEST_RATE))
    sampled = any(check.what in _OF_SAMPLING or check.what.endswith(SAMPLING) for check in failed)
    elsewhere = OTHER_JOINTS if movement.path is None else _ELSEWHERE
    if not sampled and not np.isfinite(movement.preflight.slower):
        return elsewhere
    more = f"{finer.rate:g} samples per second (rate=, --rate)"
    if sampled and _tried(finer, timing) is not None:
        return f"Choose a higher rate, as of {more}"
    itself = planned._replace(rate=min(planned.rate, _ENOUGH))
    for path, besides in ((itself, ""), (finer, f", at {more}"))[: 2 if sampled else 1]:
        slower = None if timing == "slowed" else _tried(path, "slowed")
        if slower is not None:
            slow = "slow it down (timing='slowed', --slow-down)"
            return f"It works in {slower:.3g} s instead of {duration:.3g}{besides}: {slow}"
    if not np.isfinite(movement.preflight.slower):
        return elsewhere
    return "No speed helps, or only a very low one: look at the movement for jumps, or choose another posture"


def _tried(planned: PlannedPath, timing: str) -> float | None:
    """Return the duration of the movement with another timing [s], if that passes."""
    try:
        movement = with_timing(planned, timing, _TRIED)
    except (SpecificationError, TrajectoryError):
        return None
    return movement.trajectory.duration - movement.begins if movement.preflight.passed else None
