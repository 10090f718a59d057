"""From one posture to another, as at the beginning of a movement."""

from __future__ import annotations

import numpy as np

from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.execution.timing import n_samples
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_PEAK_VELOCITY, _PEAK_ACCELERATION = 15 / 8, 10 / np.sqrt(3)  # of the polynomial, per distance and duration
_SHARE = 0.5  # of the limits of velocity and acceleration
_SHORTEST = 0.5  # [s]


def approach(robot: Robot, start: Array, end: Array, rate: float, factor: float = 1.0) -> JointTrajectory:
    """All joints together from `start` to `end` (n,), standing at both, at half the velocity and acceleration allowed.

    The polynomial of least jerk, ``q(u) = start + (end - start) (10 u^3 - 15 u^4 + 6 u^5)``, u from 0 to 1; Flash and
    Hogan 1985. Sampled at `rate` [1/s]; `factor` times as long as those limits allow.
    """
    distance = np.abs(end - start)
    by_velocity = _PEAK_VELOCITY * distance / (_SHARE * robot.velocity)
    by_acceleration = np.sqrt(_PEAK_ACCELERATION * distance / (_SHARE * robot.acceleration))
    duration = factor * max(_SHORTEST, float(by_velocity.max()), float(by_acceleration.max()))
    u = np.linspace(0.0, 1.0, n_samples(duration, rate))[:, None]
    shape = u**3 * (10 - 15 * u + 6 * u**2)
    velocity = 30 * u**2 * (1 - u) ** 2 / duration
    acceleration = 60 * u * (1 - u) * (1 - 2 * u) / duration**2
    change = (end - start)[None]
    return JointTrajectory(
        robot.joints, duration * u[:, 0], start + change * shape, change * velocity, change * acceleration, {}
    )
