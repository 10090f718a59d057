"""The fastest timing along a path of joints by toppra's algorithm, in samples between which its limits hold too."""

from __future__ import annotations

import logging
import math
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from kineme.errors import DataError, TrajectoryError
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.execution.timing import Timed, Torques, knows_masses, n_samples
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_APART = 1e-3  # between two knots of the path, in lengths that the joints pass in a second at their limits of velocity
_KNOTS = 500, 5000  # of the path at least, and at most
_PER_GAP = 3  # intervals between two knots at whose ends the limits hold: corners are sharp between knots
_FINE = 20_000  # points at which the length is measured
_SHARE = 0.998  # of the limits of velocity and acceleration: they hold at the grid, and hardly more between
_UNLIMITED = 1e9  # [Nm, N]


class Parameterization(NamedTuple):
    """A path q(s) with the velocity along it, whose square is linear in s between the points of a grid."""

    curve: CubicSpline  # q(s), s the length of the path
    grid: Array  # (m,), of s
    velocities: Array  # (m,), ds/dt
    ends: Array  # (m,), t [s]
    generated: Array  # (k,), times of the movement as it was generated [s]
    lengths: Array  # (k,), s at these times


def fastest(robot: Robot, path: CubicSpline) -> Parameterization | None:
    """The least time along the path q(s) within velocities, accelerations and torques, standing at both ends.

    Time-optimal path parameterization by reachability analysis, Pham and Pham 2018, as in the package toppra. The
    acceleration along the path is constant between two points of its grid, and the limits hold at both. The path is
    one of its length: each joint is counted in its limit of velocity, so where the movement stands nothing is passed.
    None of a path for which toppra finds no timing, as of one that the arm cannot hold.

    Raises
    ------
    DataError
        The extra ``robot`` is not installed.
    TrajectoryError
        A path on which no joint moves.
    """
    try:
        import toppra
    except ImportError as error:
        raise DataError("expected the package toppra to time movements; pip install 'kineme[robot]'") from error
    logging.getLogger("toppra").setLevel(logging.ERROR)
    constraint, both_ends = toppra.constraint, toppra.constraint.DiscretizationType.Interpolation
    velocity, acceleration = _SHARE * robot.velocity, _SHARE * robot.acceleration
    limits = [
        constraint.JointVelocityConstraint(np.column_stack((-velocity, velocity))),
        constraint.JointAccelerationConstraint(np.column_stack((-acceleration, acceleration)), both_ends),
    ]
    if knows_masses(robot) and not np.isnan(robot.effort).all():
        effort = _SHARE * np.where(np.isnan(robot.effort), _UNLIMITED, robot.effort)
        frictionless, within = np.zeros(robot.n_joints), np.column_stack((-effort, effort))
        limits.append(constraint.JointTorqueConstraint(Torques(robot).of, within, frictionless, both_ends))
    curve, generated, lengths = _by_length(robot, path)
    parts = np.arange(_PER_GAP) / _PER_GAP
    grid = np.append((curve.x[:-1, None] + np.diff(curve.x)[:, None] * parts).ravel(), curve.x[-1])
    spline = toppra.SplineInterpolator(curve.x, curve(curve.x))
    algorithm = toppra.algorithm.TOPPRA(limits, spline, gridpoints=grid, solver_wrapper="seidel")
    _, velocities, _ = algorithm.compute_parameterization(0.0, 0.0)  # at standstill at both ends
    if velocities is None or not np.isfinite(velocities).all() or not (velocities[1:] + velocities[:-1] > 0).all():
        return None
    ends = np.concatenate(([0.0], np.cumsum(2 * np.diff(grid) / (velocities[1:] + velocities[:-1]))))
    return Parameterization(curve, grid, velocities, ends, generated, lengths)


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
    total = factor * float(fast.ends[-1])
    n = n_samples(total, rate)
    h = total / (n - 1)
    s = _along(fast, np.linspace(0.0, fast.ends[-1], n))
    s = np.concatenate((s[[0, 0]], s, s[[-1, -1]]))
    controls = fast.curve(s)
    trajectory = JointTrajectory(
        robot.joints,
        h * np.arange(n + 2.0),
        _smooth(controls),
        (controls[2:] - controls[:-2]) / (2 * h),
        (controls[:-2] - 2 * controls[1:-1] + controls[2:]) / h**2,
        {},
    )
    return Timed(trajectory, np.interp(_smooth(s), fast.lengths, fast.generated))


def _smooth(controls: Array) -> Array:
    return np.asarray((controls[:-2] + 4 * controls[1:-1] + controls[2:]) / 6)


def _along(fast: Parameterization, times: Array) -> Array:
    """Lengths s(t) at times (T,)."""
    k = np.clip(np.searchsorted(fast.ends, times, "right") - 1, 0, len(fast.grid) - 2)
    since, v = times - fast.ends[k], fast.velocities
    acceleration = (v[k + 1] ** 2 - v[k] ** 2) / (2 * (fast.grid[k + 1] - fast.grid[k]))
    return np.asarray(np.clip(fast.grid[k] + v[k] * since + acceleration * since**2 / 2, 0.0, fast.grid[-1]))


def _by_length(robot: Robot, path: CubicSpline) -> tuple[CubicSpline, Array, Array]:
    """The path by its length, each joint counted in its limit of velocity; times of the movement, and lengths there.

    Where the movement stands, its time would have to pass infinitely fast; the length does not.
    """
    generated = np.linspace(0.0, float(path.x[-1]), _FINE)
    joints = path(generated)
    lengths = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(joints, axis=0) / robot.velocity, axis=1))))
    if not lengths[-1] > 0:
        raise TrajectoryError(f"{robot.name}: expected a movement, the joints stand still")
    least, most = _KNOTS
    knots = min(max(math.ceil(lengths[-1] / _APART), least), most)
    kept = np.concatenate(([True], np.diff(np.floor(lengths / lengths[-1] * knots)) > 0))
    kept[-1] = True
    return CubicSpline(lengths[kept], joints[kept]), generated, lengths
