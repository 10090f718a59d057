"""Postures that reach a pose: the branches of inverse kinematics."""

from __future__ import annotations

import numpy as np
from scipy.stats import qmc

from kineme.robots.kinematics.inverse import InverseKinematics
from kineme.validation import Array

_APART = 0.3  # two postures that differ by less in every joint count as one [rad]
_STEPS = 25


def postures(
    ik: InverseKinematics, position: Array, rotation: Array, n_starts: int = 8, tolerance: float = 1e-4
) -> list[Array]:
    """Joint positions that bring the tip to one pose, found from the rest posture and from spread random ones.

    The same starts every time (a Halton sequence within the limits, at most half a turn to each side), so that the same
    question has the same answer.
    """
    robot = ik.robot
    lower, upper = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
    spread = qmc.Halton(robot.n_joints, scramble=False).random(n_starts)[1:]
    found: list[Array] = []
    for start in [robot.rest, *(lower + spread * (upper - lower))]:
        ik.reset(start)
        q = ik.solve(position, rotation, most=_STEPS)
        if ik.error <= tolerance and all(np.abs(q - other).max() > _APART for other in found):
            found.append(q)
    return found
