"""The fastest timing along a path of joints; the algorithm is toppra's."""

from __future__ import annotations

import logging

import numpy as np
from scipy.interpolate import CubicSpline

from kineme.errors import DataError, TrajectoryError
from kineme.robots.execution.timing import Timing, n_samples
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_GRID = 200  # intervals of the path at whose ends the limits hold
_POINTS = 200  # of the path by its length, at most
_FINE = 5000  # points at which that length is measured
_SHARE = 0.98  # of the limits of velocity and acceleration: they hold at the grid, and hardly more between


def fastest(robot: Robot, path: CubicSpline, rate: float) -> tuple[CubicSpline, Timing]:
    """The least time along the path q(s) within the limits of velocity and acceleration, standing at both ends.

    Time-optimal path parameterization by reachability analysis, Pham and Pham 2018, as in the package toppra. The
    acceleration along the path is constant between two of its 200 grid points. The path comes back by its length, in
    which the timing counts.

    Raises
    ------
    DataError
        The extra ``robot`` is not installed.
    TrajectoryError
        A path that has no timing, as one whose joints jump.
    """
    try:
        import toppra
    except ImportError as error:
        raise DataError("expected the package toppra to time movements; pip install 'kineme[robot]'") from error
    logging.getLogger("toppra").setLevel(logging.ERROR)
    velocity, acceleration = _SHARE * robot.velocity, _SHARE * robot.acceleration
    limits = [
        toppra.constraint.JointVelocityConstraint(np.column_stack((-velocity, velocity))),
        toppra.constraint.JointAccelerationConstraint(np.column_stack((-acceleration, acceleration))),
    ]
    curve, generated, length = _by_length(robot, path)
    grid = np.linspace(0.0, float(curve.x[-1]), _GRID + 1)
    spline = toppra.SplineInterpolator(curve.x, curve(curve.x))
    algorithm = toppra.algorithm.TOPPRA(limits, spline, gridpoints=grid, solver_wrapper="seidel")
    _, velocities, _ = algorithm.compute_parameterization(0.0, 0.0)  # at standstill at both ends
    if velocities is None or not np.isfinite(velocities).all():
        raise TrajectoryError(f"{robot.name}: no timing of this path keeps its limits; look at the path for jumps")
    return curve, _sampled(grid, velocities, rate, generated, length)


def _sampled(grid: Array, velocities: Array, rate: float, generated: Array, length: Array) -> Timing:
    """Even samples of the lengths s(t), whose velocities at the grid are known and accelerations between constant.

    The movement as it was generated has covered `length` at the times `generated`.
    """
    ends = np.concatenate(([0.0], np.cumsum(2 * np.diff(grid) / (velocities[1:] + velocities[:-1]))))
    accelerations = np.diff(velocities**2) / (2 * np.diff(grid))
    times = np.linspace(0.0, ends[-1], n_samples(float(ends[-1]), rate))
    k = np.clip(np.searchsorted(ends, times, "right") - 1, 0, len(grid) - 2)
    since, v, a = times - ends[k], velocities[k], accelerations[k]
    s = np.clip(grid[k] + v * since + a * since**2 / 2, 0.0, grid[-1])
    return Timing(times, s, v + a * since, a, np.interp(s, length, generated))


def _by_length(robot: Robot, path: CubicSpline) -> tuple[CubicSpline, Array, Array]:
    """The path by its length, each joint counted in its limit of velocity; times of the movement, and lengths there.

    Where the movement stands, its time would have to pass infinitely fast; the length does not.
    """
    generated = np.linspace(0.0, float(path.x[-1]), _FINE)
    joints = path(generated)
    length = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(joints, axis=0) / robot.velocity, axis=1))))
    if not length[-1] > 0:
        raise TrajectoryError(f"{robot.name}: expected a movement, the joints stand still")
    kept = np.concatenate(([True], np.diff(np.floor(length / length[-1] * _POINTS)) > 0))
    kept[-1] = True
    return CubicSpline(length[kept], joints[kept]), generated, length
