"""Refusals of movements that an arm cannot execute, in words: which joint, when, and how far beyond its limit."""

from __future__ import annotations

import numpy as np

from kineme.errors import SpecificationError, TrajectoryError
from kineme.robots.execution.preflight import SAMPLING, Preflight
from kineme.robots.kinematics.reach import point_in_words
from kineme.robots.models.robot import Robot
from kineme.robots.planning.robot_movement import FASTEST_RATE, PlannedPath, RobotMovement, with_timing
from kineme.validation import Array

_OF_SAMPLING = ("jump", "tracking", "turned away", "steps")  # may be mended by more samples
_ELSEWHERE = "No speed helps: choose another place (--at), orientation (--orientation, --follow) or posture (--rest)"
OTHER_JOINTS = "No speed helps: choose another goal (--goal) or start (--at) of the joints"
_TRIED = 20_000  # samples, at most, of the movement slowed down
_ENOUGH = 1_000.0  # samples per second to learn by how much; more of them pass as well
_MORE = 10  # times the samples, where they are too few

_FAR = 0.5  # outside its limits, a joint is not checked further [rad, m]
_LOST = ("tracking", "turned away", "jump", "position")  # checks of what another way may mend
_NAMED = 4  # checks that the message names, the worst first


class InfeasibleError(TrajectoryError):
    """A trajectory that an arm cannot or must not execute; ``preflight`` holds the checks."""

    def __init__(self, message: str, preflight: Preflight | None = None) -> None:
        super().__init__(message)
        self.preflight = preflight


def refuse_outside(robot: Robot, times: Array, joints: Array) -> None:
    """Refuse a movement of the joints (T, n) that is far outside their limits, before anything is computed.

    Raises InfeasibleError: the joint that is farthest outside: when, its position and its limit.
    """
    beyond = np.maximum(robot.lower - joints, joints - robot.upper)
    t, j = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    if beyond[t, j] > _FAR:
        limit = robot.lower[j] if joints[t, j] < robot.lower[j] else robot.upper[j]
        raise InfeasibleError(
            f"{robot.name} cannot execute this: position of {robot.joints[j]} at {times[t]:.2f} s: {joints[t, j]:.3g}, "
            f"limit {limit:.3g} {robot.units[j]}. {OTHER_JOINTS}"
        )


def loses_its_path(movement: RobotMovement) -> bool:
    """Tell whether the joints left their path or jumped, so that another way along it may be better."""
    return any(check.what in _LOST for check in movement.preflight.failed)


def refuse_failed(movement: RobotMovement, planned: PlannedPath, timing: str) -> None:
    """Refuse a movement that did not pass its checks.

    Raises InfeasibleError: a check that did not pass, with the least duration that works.
    """
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
    if not sampled and not np.isfinite(movement.preflight.slower):
        return _elsewhere(movement)
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
        return _elsewhere(movement)
    return "No speed helps, or only a very low one: look at the movement for jumps, or choose another posture"


def _elsewhere(movement: RobotMovement) -> str:
    return OTHER_JOINTS if movement.path is None else _ELSEWHERE


def _tried(planned: PlannedPath, timing: str) -> float | None:
    """Return the duration of the movement with another timing [s], if that passes."""
    try:
        movement = with_timing(planned, timing, _TRIED)
    except (SpecificationError, TrajectoryError):
        return None
    return movement.trajectory.duration - movement.begins if movement.preflight.passed else None
