"""How fast a path is passed: the place along it, s, as a function of the time t of the arm."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.models.robot import Robot
from kineme.validation import Array

STANDS = 0.02  # of the limit of velocity: what counts as standing
_SHORTEST_RAMP = 0.1  # [s]
_SHARE = 0.5  # of the limit of acceleration that a ramp may take
_PEAK = 1.5  # of the slope of the ramp, over its mean


class Timing(NamedTuple):
    """The place s along a path at T even times t."""

    times: Array  # (T,), t [s]
    place: Array  # (T,), s(t), in the unit of the path's parameter
    speed: Array  # (T,), ds/dt
    change: Array  # (T,), d2s/dt2
    generated: Array  # (T,), the time of the movement as it was generated [s]


def as_generated(robot: Robot, path: CubicSpline, rate: float) -> Timing:
    """The timing of the movement itself, t = s; where it begins or ends in motion, with a ramp from or to a stand.

    In a ramp of r seconds, with x = t / r, ``ds/dt = 3 x^2 - 2 x^3`` and so ``s = r (x^3 - x^4 / 2)``: it takes r / 2
    seconds more than without. r is such that the arm takes half of its acceleration for it.
    """
    duration = float(path.x[-1])
    velocities = np.abs(path(np.array([0.0, duration]), 1))
    first, last = (min(duration, _ramp(robot, velocity)) for velocity in velocities)
    total = duration + (first + last) / 2
    times = np.linspace(0.0, total, max(4, round(total * rate) + 1))
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
    return Timing(times, place, speed, change, place)


def _ramp(robot: Robot, velocity: Array) -> float:
    if np.all(velocity <= STANDS * robot.velocity):
        return 0.0
    return max(_SHORTEST_RAMP, float(np.max(_PEAK * velocity / (_SHARE * robot.acceleration))))


def slowed(timing: Timing, factor: float, rate: float) -> Timing:
    """The same, `factor` times as long, sampled at `rate` again."""
    times = timing.times * factor
    even = np.linspace(0.0, times[-1], max(4, round(times[-1] * rate) + 1))
    place, speed, change, generated = (np.interp(even, times, values) for values in timing[1:])
    return Timing(even, place, speed / factor, change / factor**2, generated)


def timed(robot: Robot, path: CubicSpline, timing: Timing) -> JointTrajectory:
    """The joints along the path q(s) at the times of `timing`, by the chain rule.

    ``dq/dt = q'(s) ds/dt`` and ``d2q/dt2 = q''(s) (ds/dt)^2 + q'(s) d2s/dt2``.
    """
    first, second = path(timing.place, 1), path(timing.place, 2)
    speed, change = timing.speed[:, None], timing.change[:, None]
    return JointTrajectory(
        robot.joints, timing.times, path(timing.place), first * speed, second * speed**2 + first * change, {}
    )
