"""How fast a path is passed: the place along it, s, as a function of the time t of the arm."""

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


class Timing(NamedTuple):
    """The place s along a path at T even times t."""

    times: Array  # (T,), t [s]
    place: Array  # (T,), s(t), in the unit of the path's parameter
    speed: Array  # (T,), ds/dt
    change: Array  # (T,), d2s/dt2
    generated: Array  # (T,), the time of the movement as it was generated [s]


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


def as_generated(robot: Robot, path: CubicSpline, rate: float, factor: float = 1.0) -> Timing:
    """The timing of the movement itself, t = s; where it begins or ends in motion, with a ramp from or to a stand.

    In a ramp of r seconds, with x = t / r, ``ds/dt = 3 x^2 - 2 x^3`` and so ``s = r (x^3 - x^4 / 2)``: it takes r / 2
    seconds more than without. r is such that the arm takes half of its acceleration for it. All of it takes `factor`
    times as long, ``s(t / factor)``.
    """
    duration = float(path.x[-1])
    velocities = np.abs(path(np.array([0.0, duration]), 1))
    first, last = (min(duration, _ramp(robot, velocity / factor) / factor) for velocity in velocities)
    total = duration + (first + last) / 2
    times = np.linspace(0.0, total, n_samples(factor * total, rate))
    place, speed, change = times - first / 2, np.ones_like(times), np.zeros_like(times)
    for ramp, at, sign in ((first, times, 1.0), (last, total - times, -1.0)):
        if ramp == 0:
            continue
        x = np.clip(at / ramp, 0.0, 1.0)
        within = x < 1
        covered = ramp * (x**3 - x**4 / 2)
        place[within] = (covered if sign > 0 else duration - covered)[within]
        speed[within] = (3 * x**2 - 2 * x**3)[within]
        change[within] = (sign * 6 * (x - x**2) / ramp)[within]
    place = np.clip(place, 0.0, duration)
    return Timing(factor * times, place, speed / factor, change / factor**2, place)


def _ramp(robot: Robot, velocity: Array) -> float:
    """Seconds of a ramp to velocities (n,); next to none where the movement is almost at a stand."""
    share = float(np.max(velocity / robot.velocity))
    if share <= STANDS:
        return 0.0
    moving, shortest = _GENTLE
    return max(shortest * min(1.0, share / moving), float(np.max(_PEAK * velocity / (_SHARE * robot.acceleration))))


def timed(robot: Robot, path: CubicSpline, timing: Timing) -> JointTrajectory:
    """The joints along the path q(s) at the times of `timing`, by the chain rule.

    ``dq/dt = q'(s) ds/dt`` and ``d2q/dt2 = q''(s) (ds/dt)^2 + q'(s) d2s/dt2``.
    """
    first, second = path(timing.place, 1), path(timing.place, 2)
    speed, change = timing.speed[:, None], timing.change[:, None]
    return JointTrajectory(
        robot.joints, timing.times, path(timing.place), first * speed, second * speed**2 + first * change, {}
    )
