"""What makes a movement pass its checks that did not: it is tried before it is promised."""

from __future__ import annotations

import numpy as np

from kineme.errors import SpecificationError, TrajectoryError
from kineme.robots.checks.between_samples import SAMPLING
from kineme.robots.planning.robot_movement import RobotMovement
from kineme.robots.planning.timed_movement import FASTEST_RATE, Untimed, with_timing

_OF_SAMPLING = ("jump", "tracking", "turned away", "steps")  # may be mended by more samples
_ELSEWHERE = "No speed helps: choose another place (--at), orientation (--orientation, --follow) or posture (--rest)"
OTHER_JOINTS = "No speed helps: choose another goal (--goal) or start (--at) of the joints"
_TRIED = 20_000  # samples, at most, of the movement slowed down
_ENOUGH = 1_000.0  # samples per second to learn by how much; more of them pass as well
_MORE = 10  # times the samples, where they are too few


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
