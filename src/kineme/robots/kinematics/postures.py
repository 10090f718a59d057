"""Postures that reach a pose: the branches of inverse kinematics."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.stats import qmc

from kineme.robots.kinematics.descent import Reached, descend
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_APART = 0.3  # two postures that differ by less in every joint count as one [rad]
_STEPS = 30
_STARTS = 16
_TOLERANCE = 1e-4  # from the pose [m]


def postures(robot: Robot, position: Array, rotation: Array, turn_costs: Array, n_starts: int = _STARTS) -> Reached:
    """Joint positions that bring the tip to one pose, from the rest posture and from others spread over the limits.

    Two that differ by less than 0.3 rad in every joint count as one. The most exact comes first; if none comes within
    0.1 mm, it is alone.
    """
    found = descend(robot, _starts(robot, n_starts), position, rotation, turn_costs, _STEPS)
    order = np.argsort(found.errors, kind="stable")
    kept = [int(order[0])]
    for i in order[1:]:
        apart = np.abs(found.joints[kept] - found.joints[i]).max(axis=1)
        if found.errors[i] <= _TOLERANCE and apart.min() > _APART:
            kept.append(int(i))
    return Reached(found.joints[kept], found.errors[kept])


@lru_cache(maxsize=8)
def _starts(robot: Robot, n: int) -> Array:
    """The same every time, so that the same question has the same answer.

    A Halton sequence within the limits, at most half a turn to each side.
    """
    lower, upper = np.clip((-np.pi, np.pi), robot.lower[:, None], robot.upper[:, None]).T
    spread = qmc.Halton(robot.n_joints, scramble=False).random(n)[1:]
    return np.vstack((robot.rest, lower + spread * (upper - lower)))
