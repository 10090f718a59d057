"""How well an arm can execute a movement, from a few joint positions along it."""

from __future__ import annotations

import numpy as np

from kineme.robots.models.robot import Robot
from kineme.validation import Array

_TOLERATED = 1e-4  # distance from the path that costs nothing [m]
_PER_METER = 1e3


def cost_of(robot: Robot, times: Array, joints: Array, errors: Array) -> float:
    """Cost of joint positions (T, n) at times (T,), with the tip off by errors (T,) [m]; smaller is better.

    The sum of: 1000 times the largest error beyond 0.1 mm; the largest share of the limits of velocity; the fourth
    power of the largest share of the range of a joint, which rises where a joint comes close to a stop. A posture near
    a singularity costs by the velocities it takes.
    """
    missed = _PER_METER * max(0.0, float(errors.max()) - _TOLERATED)
    speed = np.abs(np.diff(joints, axis=0)) / np.diff(times)[:, None] / robot.velocity
    middle, half = (robot.upper + robot.lower) / 2, (robot.upper - robot.lower) / 2
    return missed + float(speed.max()) + float((np.abs(joints - middle) / half).max()) ** 4
