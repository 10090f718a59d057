"""Trajectories that are sent to an arm: joint positions and rates over time, also between samples."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BPoly, CubicHermiteSpline, CubicSpline, PPoly

from kineme.errors import DataError, SpecificationError
from kineme.robots.models.robot import Robot
from kineme.validation import Array, as_numbers

_KNOTS_APART = 1e-3  # between two knots of the path: of what joints at their limits of velocity pass in a second
_KNOTS = 500, 5000  # of the path at least, and at most
_PER_GAP = 3  # intervals between two knots at whose ends the limits hold: corners are sharp between knots
_FINE = 20_000  # points at which the length is measured
_USABLE = 0.998  # of the limits of velocity and acceleration: they hold at the grid, and hardly more between
_UNLIMITED = 1e9  # [Nm, N]

_PEAK_VELOCITY, _PEAK_ACCELERATION = 15 / 8, 10 / np.sqrt(3)  # of the polynomial, per distance and duration
_SHORTEST = 0.5  # of an approach where samples are few [s]

STANDS = 1e-8  # of the limit of velocity: what counts as standing, also for controllers of ROS
_GENTLE = 0.02, 0.1  # from such a share of the limit of velocity on a ramp takes so long at least [s]
_SHARE = 0.5  # of the limit of acceleration that a ramp may take
_PEAK = 1.5  # of the slope of the ramp, over its mean
LONGEST = 1_000_000  # samples of one trajectory, at most
_LEAST = 4  # samples

_APART = 0.05  # between two postures that are looked at no joint moves farther [rad, m]


@dataclass(frozen=True, eq=False, repr=False)
class JointTrajectory:
    """Joint positions of one arm over time, T samples of n joints.

    - `times` (T,): from 0 [s].
    - `positions`, `velocities`, `accelerations` (T, n): [rad, m], per second, per second squared.
    - `steps`: channel beside the joints, such as a gripper -> value (T,) that holds from each sample on.
    - `units`: "rad", or "m" of joints that slide; by default "rad".
    """

    joints: tuple[str, ...]
    times: Array
    positions: Array
    velocities: Array
    accelerations: Array
    steps: dict[str, Array]
    units: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "joints", tuple(self.joints))
        object.__setattr__(self, "units", tuple(self.units) or ("rad",) * len(self.joints))
        for name in ("times", "positions", "velocities", "accelerations"):
            object.__setattr__(self, name, as_numbers(getattr(self, name), name))
        object.__setattr__(self, "steps", {name: as_numbers(values, name) for name, values in self.steps.items()})

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.times[-1])

    def __len__(self) -> int:
        return len(self.times)

    def __repr__(self) -> str:
        return f"JointTrajectory({len(self.joints)} joints, {len(self)} samples, {self.duration:.2f} s)"


def joined(first: JointTrajectory, second: JointTrajectory) -> JointTrajectory:
    """One after the other; the second begins where and when the first ends."""

    def both(name: str) -> Array:
        return np.concatenate((getattr(first, name)[:-1], getattr(second, name)))

    times = np.concatenate((first.times[:-1], second.times + first.duration))
    held = {name: np.concatenate((np.full(len(first) - 1, values[0]), values)) for name, values in second.steps.items()}
    return JointTrajectory(
        second.joints, times, both("positions"), both("velocities"), both("accelerations"), held, second.units
    )


def between(trajectory: JointTrajectory, times: Array) -> JointTrajectory:
    """The trajectory at other times (m,) within its own.

    Between two samples lies the polynomial of the fifth order that has the positions, velocities and accelerations of
    both at its ends: that is how the joint_trajectory_controller of ROS interpolates. Discrete channels hold.
    """
    path = _path(trajectory)
    held = np.searchsorted(trajectory.times, times, "right") - 1
    steps = {name: values[held] for name, values in trajectory.steps.items()}
    return JointTrajectory(
        trajectory.joints, times, path(times), path(times, 1), path(times, 2), steps, trajectory.units
    )


class Extreme(NamedTuple):
    """The largest value of any joint at any time, as a share of its limit."""

    share: float  # below 0 of a value below the center
    joint: int
    time: float  # [s]


def extreme(trajectory: JointTrajectory, order: int, limits: Array, centers: Array | float = 0.0) -> Extreme:
    """The largest ``|x_j - center_j| / limit_j``, between samples too: of the derivative of that order.

    The maximum of a polynomial lies at an end or where its derivative vanishes. Only those are searched whose Bernstein
    coefficients, which bound them, are beyond all samples.
    """
    path = _path(trajectory)
    path.c[-1] -= centers
    path = path.derivative(order)
    path.c /= limits
    largest = np.abs(path(path.x)).max()
    slope = path.derivative()
    slope.c[:, np.abs(BPoly.from_power_basis(path).c).max(axis=0) < largest] = 0.0
    times = np.concatenate((path.x, *slope.roots(False, False)))
    times = times[np.isfinite(times)]  # nan stands where a polynomial is 0 throughout
    shares = path(times)
    t, j = np.unravel_index(int(np.argmax(np.abs(shares))), shares.shape)
    return Extreme(float(shares[t, j]), int(j), float(times[t]))


def _path(trajectory: JointTrajectory) -> PPoly:
    """Return the joints over time: between two samples the polynomial that has the derivatives of both at its ends."""
    h = np.diff(trajectory.times)[:, None]
    q, v, a = trajectory.positions, h * trajectory.velocities[:-1], h**2 * trajectory.accelerations[:-1]
    distance = np.diff(q, axis=0) - v - a / 2
    more = h * trajectory.velocities[1:] - v - a
    most = h**2 * trajectory.accelerations[1:] - a
    c3 = 10 * distance - 4 * more + most / 2
    c4 = -15 * distance + 7 * more - most
    c5 = 6 * distance - 3 * more + most / 2
    return PPoly(np.stack((c5 / h**5, c4 / h**4, c3 / h**3, a / 2 / h**2, v / h, q[:-1])), trajectory.times)


def dense_times(robot: Robot, trajectory: JointTrajectory) -> Array:
    """The times of the samples, and so many between that no joint moves farther than 0.05 rad or m, as its speed says.

    That is the speed at samples or the mean between, within its limit: where it is faster, it moves twice as far.
    """
    times = trajectory.times
    gaps = np.diff(times)[:, None]
    speeds = np.maximum(np.abs(trajectory.velocities[1:]), np.abs(trajectory.velocities[:-1]))
    speeds = np.maximum(speeds, np.abs(np.diff(trajectory.positions, axis=0)) / gaps)
    moved = (gaps * np.minimum(np.nan_to_num(speeds), robot.velocity)).max(axis=1)
    parts = np.maximum(1, np.ceil(moved / _APART)).astype(int)
    first = np.repeat(np.arange(len(parts)), parts)
    share = (np.arange(len(first)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[first]
    return np.append(times[first] + share * gaps[first, 0], times[-1])


class Timed(NamedTuple):
    """A path of joints, followed in time."""

    trajectory: JointTrajectory
    generated: Array  # (T,), the time of the movement as it was generated, at each sample [s]


def n_samples(duration: float, rate: float, most: int = LONGEST) -> int:
    """Number of even samples from 0 to `duration` [s], about `rate` for each second."""
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
    velocities, accelerations = slope * velocity, bend * velocity**2 + slope * acceleration
    return Timed(JointTrajectory(robot.joints, factor * times, path(s), velocities, accelerations, {}, robot.units), s)


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
    Hogan 1985. Sampled at `rate` [1/s], four times at least; `factor` times as long as those limits allow.
    """
    distance = np.abs(end - start)
    by_velocity = _PEAK_VELOCITY * distance / (_SHARE * robot.velocity)
    by_acceleration = np.sqrt(_PEAK_ACCELERATION * distance / (_SHARE * robot.acceleration))
    shortest = min(_SHORTEST, (_LEAST - 1) / rate)
    duration = factor * max(shortest, float(by_velocity.max()), float(by_acceleration.max()))
    u = np.linspace(0.0, 1.0, n_samples(duration, rate))[:, None]
    shape = u**3 * (10 - 15 * u + 6 * u**2)
    velocity = 30 * u**2 * (1 - u) ** 2 / duration
    acceleration = 60 * u * (1 - u) * (1 - 2 * u) / duration**2
    q, v, a = start + (end - start) * shape, (end - start) * velocity, (end - start) * acceleration
    return JointTrajectory(robot.joints, duration * u[:, 0], q, v, a, {}, robot.units)


def knows_masses(robot: Robot) -> bool:
    """Tell whether the model says what its links weigh."""
    return any(inertia.mass > 0 for inertia in robot.model.inertias)


class Torques:
    """Torques of one arm without friction: inverse dynamics by the recursive Newton-Euler algorithm of Pinocchio."""

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
        """Tell whether a joint would need more than it has; False where that is not known."""
        return bool((np.abs(torques) > self._most).any())


class Parameterization(NamedTuple):
    """A path q(s) and its least time."""

    curve: CubicSpline  # q(s), s the length of the path
    course: CubicHermiteSpline  # s(t)
    generated: Array  # (k,), times of the movement as it was generated [s]
    lengths: Array  # (k,), s at these times


def fastest(robot: Robot, path: CubicSpline) -> Parameterization | None:
    """The least time along the path q(s) within velocities, accelerations and torques, standing at both ends.

    Time-optimal path parameterization by reachability analysis, Pham and Pham 2018, as in the package toppra. The
    acceleration along the path is constant between two points of its grid, and the limits hold at both. The path is
    one of its length: each joint is counted in its limit of velocity, so where the movement stands nothing is passed.
    None of a path without length, and of one for which toppra finds no timing, as of one that the arm cannot hold.
    """
    try:
        import toppra
    except ImportError as error:
        raise DataError("expected the package toppra to time movements; pip install 'kineme[robot]'") from error
    logging.getLogger("toppra").setLevel(logging.ERROR)
    constraint, both_ends = toppra.constraint, toppra.constraint.DiscretizationType.Interpolation
    velocity, acceleration = _USABLE * robot.velocity, _USABLE * robot.acceleration
    limits = [
        constraint.JointVelocityConstraint(np.column_stack((-velocity, velocity))),
        constraint.JointAccelerationConstraint(np.column_stack((-acceleration, acceleration)), both_ends),
    ]
    if knows_masses(robot) and not np.isnan(robot.effort).all():
        effort = _USABLE * np.where(np.isnan(robot.effort), _UNLIMITED, robot.effort)
        frictionless, within = np.zeros(robot.n_joints), np.column_stack((-effort, effort))
        limits.append(constraint.JointTorqueConstraint(Torques(robot).of, within, frictionless, both_ends))
    if (by_length := _by_length(robot, path)) is None:
        return None
    curve, generated, lengths = by_length
    parts = np.arange(_PER_GAP) / _PER_GAP
    grid = np.append((curve.x[:-1, None] + np.diff(curve.x)[:, None] * parts).ravel(), curve.x[-1])
    spline = toppra.SplineInterpolator(curve.x, curve(curve.x))
    algorithm = toppra.algorithm.TOPPRA(limits, spline, gridpoints=grid, solver_wrapper="seidel")
    _, velocities, _ = algorithm.compute_parameterization(0.0, 0.0)  # at standstill at both ends
    if velocities is None or not np.isfinite(velocities).all() or not (velocities[1:] + velocities[:-1] > 0).all():
        return None
    ends = np.concatenate(([0.0], np.cumsum(2 * np.diff(grid) / (velocities[1:] + velocities[:-1]))))
    return Parameterization(curve, CubicHermiteSpline(ends, grid, velocities), generated, lengths)


def sampled(robot: Robot, fast: Parameterization, rate: float, factor: float = 1.0) -> Timed:
    """The joints at even times along the fastest timing, or `factor` times as slowly.

    They are the cubic B-spline whose control points are the joints c_k at times h apart,

        q_k = (c_(k-1) + 4 c_k + c_(k+1)) / 6,
        v_k = (c_(k+1) - c_(k-1)) / (2 h),
        a_k = (c_(k-1) - 2 c_k + c_(k+1)) / h^2,

    with the first and the last repeated, so that it begins and ends at a stand. Its velocity and acceleration are
    means of those of the timing, so they keep its limits, also where that steps from one limit to the opposite one; and
    its acceleration is linear between samples, where the polynomials of the fifth order of a controller are therefore
    this spline itself. It leaves the path by ``h^2 a / 6``.
    """
    least = float(fast.course.x[-1])
    n = n_samples(factor * least, rate)
    h = factor * least / (n - 1)
    s = np.clip(fast.course(np.linspace(0.0, least, n)), 0.0, fast.lengths[-1])
    s = np.concatenate((s[[0, 0]], s, s[[-1, -1]]))
    c = fast.curve(s)
    velocities, accelerations = (c[2:] - c[:-2]) / (2 * h), (c[:-2] - 2 * c[1:-1] + c[2:]) / h**2
    times = h * np.arange(n + 2.0)
    trajectory = JointTrajectory(robot.joints, times, _smooth(c), velocities, accelerations, {}, robot.units)
    return Timed(trajectory, np.interp(_smooth(s), fast.lengths, fast.generated))


def _smooth(controls: Array) -> Array:
    return np.asarray((controls[:-2] + 4 * controls[1:-1] + controls[2:]) / 6)


def _by_length(robot: Robot, path: CubicSpline) -> tuple[CubicSpline, Array, Array] | None:
    """The path by its length, each joint counted in its limit of velocity; times of the movement, and lengths there.

    None where the joints stand still.
    """
    generated = np.linspace(0.0, float(path.x[-1]), _FINE)
    joints = path(generated)
    lengths = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(joints, axis=0) / robot.velocity, axis=1))))
    if not lengths[-1] > 0:
        return None
    least, most = _KNOTS
    knots = min(max(math.ceil(lengths[-1] / _KNOTS_APART), least), most)
    begins_knot = np.concatenate(([True], np.diff(np.floor(lengths / lengths[-1] * knots)) > 0))
    begins_knot[-1] = True
    return CubicSpline(lengths[begins_knot], joints[begins_knot]), generated, lengths
