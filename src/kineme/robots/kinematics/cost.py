"""How well an arm can execute a movement, from a few joint positions along it."""

from __future__ import annotations

import numpy as np

from kineme.robots.models.robot import Robot
from kineme.validation import Array

_TOLERATED = 1e-4  # distance from the path that costs nothing [m]
_PER_METER = 1e3
AT_A_STOP = 5.0  # cost of a joint that comes to a stop: it does so suddenly, and the others have to do its part
_STOP = 0.99  # share of the range of a joint from which on it is at a stop


def costs_of(robot: Robot, times: Array, joints: Array, errors: Array) -> Array:
    """Costs (m,) of m ways of joint positions (T, m, n) at times (T,), tips off by (T, m) [m]; smaller is better.

    The sum of: 1000 times the largest error beyond 0.1 mm; the largest share of the limits of velocity; the fourth
    power of the largest share of the range of a joint, which rises where a joint comes close to a stop, and 5 where it
    comes to it. A posture near a singularity costs by the velocities it takes.
    """
    missed = _PER_METER * np.maximum(0.0, errors.max(axis=0) - _TOLERATED)
    speed = np.abs(np.diff(joints, axis=0)) / np.diff(times)[:, None, None] / robot.velocity
    middle, half = (robot.upper + robot.lower) / 2, (robot.upper - robot.lower) / 2
    stops = (np.abs(joints - middle) / half).max(axis=(0, 2))
    return np.asarray(missed + speed.max(axis=(0, 2)) + stops**4 + AT_A_STOP * (stops > _STOP))
