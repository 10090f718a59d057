"""How fast a path q(s) is followed: its parameter s as a function of the time t of the arm."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from kineme.errors import SpecificationError
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_PEAK_VELOCITY, _PEAK_ACCELERATION = 15 / 8, 10 / np.sqrt(3)  # of the polynomial, per distance and duration
_SHORTEST = 0.5  # [s]

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


def knows_masses(robot: Robot) -> bool:
    """Whether the model says what its links weigh."""
    return float(sum(inertia.mass for inertia in robot.model.inertias)) > 0


class Torques:
    """Torques of one arm, posture by posture: inverse dynamics by the recursive Newton-Euler algorithm of Pinocchio.

    Without friction, and without a load that the model does not have.
    """

    def __init__(self, robot: Robot) -> None:
        import pinocchio

        self._inverse_dynamics = pinocchio.rnea
        self._model, self._data = robot.model, robot.model.createData()
        self._known = knows_masses(robot)
        self._most = np.where(np.isnan(robot.effort), np.inf, robot.effort)

    def of(self, q: Array, velocities: Array, accelerations: Array) -> Array:
        """Torques (n,) [Nm, N] at joint positions, velocities and accelerations (n,); nan without masses."""
        if not self._known:
            return np.full(len(q), np.nan)
        return np.array(self._inverse_dynamics(self._model, self._data, q, velocities, accelerations))

    def exceeded(self, torques: Array) -> bool:
        """Whether a joint would need more than it has; False where that is not known."""
        return bool((np.abs(torques) > self._most).any())
