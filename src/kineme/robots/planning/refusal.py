"""Why an arm cannot execute a movement, in words: which joint, when, how far beyond its limit, and what helps."""

from __future__ import annotations

import numpy as np

from kineme.errors import SpecificationError, TrajectoryError
from kineme.robots.checks.between_samples import SAMPLING
from kineme.robots.checks.check import Check, Preflight
from kineme.robots.kinematics.reach import point_in_words
from kineme.robots.planning.robot_movement import RobotMovement
from kineme.robots.planning.timed_movement import FASTEST_RATE, Untimed, with_timing

_NAMED = 4  # checks that the message names, the worst first
_OF_SAMPLING = ("jump", "tracking", "turned away")  # may be mended by more samples
_TRIED = 20_000  # samples, at most, of the movement slowed down
_MORE = 10  # times the samples, where they are too few


class InfeasibleError(TrajectoryError):
    """A trajectory that an arm cannot or must not execute; ``preflight`` holds the checks."""

    def __init__(self, message: str, preflight: Preflight | None = None) -> None:
        super().__init__(message)
        self.preflight = preflight


def refuse_failed(made: RobotMovement, untimed: Untimed, timing: str) -> None:
    """Refuse a movement that did not pass its checks.

    Raises
    ------
    InfeasibleError
        A check that did not pass, with the least duration that works.
    """
    if not made.preflight.passed:
        raise InfeasibleError(_refusal(made, _remedy(made, untimed, timing)), made.preflight)


def _refusal(made: RobotMovement, remedy: str) -> str:
    failed = made.preflight.failed
    lines = [
        f"{c.what} of {c.where} at {c.time:.2f} s{_wanted_at(made, c)}: {c.worst:.3g}, limit {c.limit:.3g} {c.unit}"
        for c in failed[:_NAMED]
    ]
    more = f" and {len(failed) - _NAMED} more" if len(failed) > _NAMED else ""
    return f"{made.robot.name} cannot execute this: {'; '.join(lines)}{more}. {remedy}"


def _remedy(made: RobotMovement, untimed: Untimed, timing: str) -> str:
    """What was tried and works: more samples, less speed, or both."""
    failed, duration = made.preflight.failed, made.trajectory.duration - made.begins
    finer = untimed._replace(rate=min(_MORE * untimed.rate, FASTEST_RATE))
    sampled = any(check.what in _OF_SAMPLING or check.what.endswith(SAMPLING) for check in failed)
    if not sampled and not np.isfinite(made.preflight.slower):
        return "No speed helps: choose another place (--at), orientation (--orientation, --follow) or posture (--rest)"
    more = f"{finer.rate:g} samples per second (rate=, --rate)"
    if sampled and _tried(finer, timing) is not None:
        return f"Choose a higher rate, as of {more}"
    for one, besides in ((untimed, ""), (finer, f", at {more}"))[: 2 if sampled else 1]:
        slower = None if timing == "slowed" else _tried(one, "slowed")
        if slower is not None:
            slow = "slow it down (timing='slowed', --slow-down)"
            return f"It works in {slower:.3g} s instead of {duration:.3g}{besides}: {slow}"
    return "No speed helps, or only a very low one: look at the movement for jumps, or choose another posture"


def _tried(untimed: Untimed, timing: str) -> float | None:
    """Duration of the movement with another timing [s], if that passes."""
    try:
        made = with_timing(untimed, timing, _TRIED)
    except (SpecificationError, TrajectoryError):
        return None
    return made.trajectory.duration - made.begins if made.preflight.passed else None


def _wanted_at(made: RobotMovement, check: Check) -> str:
    """Where the tip was to be when it was farthest from there."""
    if check.what != "tracking" or made.path is None:
        return ""
    position = made.path.positions[int(np.argmin(np.abs(made.path.times - check.time)))]
    return f", from {point_in_words(position)} m"
