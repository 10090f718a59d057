"""Why an arm cannot execute a movement, in words: which joint, when, and how far beyond its limit."""

from __future__ import annotations

import numpy as np

from kineme.errors import SpecificationError, TrajectoryError
from kineme.robots.execution.preflight import SAMPLING, Check, Preflight
from kineme.robots.kinematics.reach import point_in_words
from kineme.robots.models.robot import Robot
from kineme.robots.planning.robot_movement import FASTEST_RATE, RobotMovement, Untimed, with_timing
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


def loses_its_path(made: RobotMovement) -> bool:
    """Whether the joints left their path or jumped, so that another way along it may be better."""
    return any(check.what in _LOST for check in made.preflight.failed)


def refuse_failed(made: RobotMovement, untimed: Untimed, timing: str) -> None:
    """Refuse a movement that did not pass its checks.

    Raises InfeasibleError: a check that did not pass, with the least duration that works.
    """
    if not made.preflight.passed:
        raise InfeasibleError(_refusal(made, remedy(made, untimed, timing)), made.preflight)


def _refusal(made: RobotMovement, helps: str) -> str:
    failed = made.preflight.failed
    lines = [
        f"{c.what} of {c.where} at {c.time:.2f} s{_wanted_at(made, c)}: {c.worst:.3g}, limit {c.limit:.3g} {c.unit}"
        for c in failed[:_NAMED]
    ]
    more = f" and {len(failed) - _NAMED} more" if len(failed) > _NAMED else ""
    return f"{made.robot.name} cannot execute this: {'; '.join(lines)}{more}. {helps}"


def _wanted_at(made: RobotMovement, check: Check) -> str:
    """Where the tip was to be when it was farthest from there."""
    if check.what != "tracking" or made.path is None:
        return ""
    position = made.path.positions[int(np.argmin(np.abs(made.path.times - check.time)))]
    return f", from {point_in_words(position)} m"


def remedy(made: RobotMovement, untimed: Untimed, timing: str) -> str:
    """What was tried and works, in words: more samples, a lower speed, or both."""
    failed, duration = made.preflight.failed, made.trajectory.duration - made.begins
    finer = untimed._replace(rate=min(_MORE * untimed.rate, FASTEST_RATE))
    sampled = any(check.what in _OF_SAMPLING or check.what.endswith(SAMPLING) for check in failed)
    if not sampled and not np.isfinite(made.preflight.slower):
        return _elsewhere(made)
    more = f"{finer.rate:g} samples per second (rate=, --rate)"
    if sampled and _tried(finer, timing) is not None:
        return f"Choose a higher rate, as of {more}"
    itself = untimed._replace(rate=min(untimed.rate, _ENOUGH))
    for one, besides in ((itself, ""), (finer, f", at {more}"))[: 2 if sampled else 1]:
        slower = None if timing == "slowed" else _tried(one, "slowed")
        if slower is not None:
            slow = "slow it down (timing='slowed', --slow-down)"
            return f"It works in {slower:.3g} s instead of {duration:.3g}{besides}: {slow}"
    if not np.isfinite(made.preflight.slower):
        return _elsewhere(made)
    return "No speed helps, or only a very low one: look at the movement for jumps, or choose another posture"


def _elsewhere(made: RobotMovement) -> str:
    return OTHER_JOINTS if made.path is None else _ELSEWHERE


def _tried(untimed: Untimed, timing: str) -> float | None:
    """Duration of the movement with another timing [s], if that passes."""
    try:
        made = with_timing(untimed, timing, _TRIED)
    except (SpecificationError, TrajectoryError):
        return None
    return made.trajectory.duration - made.begins if made.preflight.passed else None
