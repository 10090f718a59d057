"""How fast a path q(s) is followed: its parameter s as a function of the time t of the arm."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from kineme.errors import SpecificationError
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.models.robot import Robot
from kineme.validation import Array

STANDS = 1e-8  # of the limit of velocity: what counts as standing, also for controllers of ROS
_GENTLE = 0.02, 0.1  # from such a share of the limit of velocity on a ramp takes so long at least [s]
_SHARE = 0.5  # of the limit of acceleration that a ramp may take
_PEAK = 1.5  # of the slope of the ramp, over its mean
LONGEST = 1_000_000  # samples of one trajectory, at most
_LEAST = 4  # samples


class Timed(NamedTuple):
    """A path of joints, followed in time."""

    trajectory: JointTrajectory
    generated: Array  # (T,), the time of the movement as it was generated, at each sample [s]


def n_samples(duration: float, rate: float, most: int = LONGEST) -> int:
    """Number of even samples from 0 to `duration` [s], about `rate` for each second.

    Raises
    ------
    SpecificationError
        More than `most`.
    """
    if not duration * rate <= most:
        raise SpecificationError(
            f"expected at most {most:,} samples of one trajectory, got {duration * rate:,.0f}; choose a lower "
            "rate, a shorter movement or higher limits of velocity and acceleration"
        )
    return max(_LEAST, round(duration * rate) + 1)


def as_generated(robot: Robot, path: CubicSpline, rate: float, factor: float = 1.0) -> Timed:
    """The timing of the movement itself, t = s; where it begins or ends in motion, with a ramp from or to a stand.

    In a ramp of r seconds, with x = t / r, ``ds/dt = 3 x^2 - 2 x^3`` and so ``s = r (x^3 - x^4 / 2)``: it takes r / 2
    seconds more than without. r is such that the arm takes half of its acceleration for it. All of it takes `factor`
    times as long, ``s(t / factor)``. By the chain rule ``dq/dt = q'(s) ds/dt`` and ``d2q/dt2 = q''(s) (ds/dt)^2 +
    q'(s) d2s/dt2``.
    """
    duration = float(path.x[-1])
    at_ends = np.abs(path(np.array([0.0, duration]), 1)) / factor  # (2, n)
    first, last = (min(duration, _ramp(robot, joints) / factor) for joints in at_ends)
    total = duration + (first + last) / 2
    times = np.linspace(0.0, total, n_samples(factor * total, rate))
    s, velocity, acceleration = times - first / 2, np.ones_like(times), np.zeros_like(times)
    for ramp, at, sign in ((first, times, 1.0), (last, total - times, -1.0)):
        if ramp == 0:
            continue
        x = np.clip(at / ramp, 0.0, 1.0)
        within = x < 1
        covered = ramp * (x**3 - x**4 / 2)
        s[within] = (covered if sign > 0 else duration - covered)[within]
        velocity[within] = (3 * x**2 - 2 * x**3)[within]
        acceleration[within] = (sign * 6 * (x - x**2) / ramp)[within]
    s = np.clip(s, 0.0, duration)
    slope, bend = path(s, 1), path(s, 2)
    velocity, acceleration = velocity[:, None] / factor, acceleration[:, None] / factor**2
    trajectory = JointTrajectory(
        robot.joints, factor * times, path(s), slope * velocity, bend * velocity**2 + slope * acceleration, {}
    )
    return Timed(trajectory, s)


def _ramp(robot: Robot, velocity: Array) -> float:
    """Seconds of a ramp to velocities (n,); next to none where the movement is almost at a stand."""
    share = float(np.max(velocity / robot.velocity))
    if share <= STANDS:
        return 0.0
    moving, shortest = _GENTLE
    return max(shortest * min(1.0, share / moving), float(np.max(_PEAK * velocity / (_SHARE * robot.acceleration))))
