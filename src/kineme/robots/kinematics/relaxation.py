"""A way along a path, smoothed as a whole: what the poses leave free bends little and keeps off the stops."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solveh_banded

from kineme.robots.kinematics.descent import distances, kinematics
from kineme.robots.kinematics.task_path import TaskPath
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_ROUNDS = 12  # of the method of Gauss and Newton
_BENDING = 1e-4  # cost of bending, beside 1 per squared meter from the path, where 100 poses are the path
_POSES = 100.0
_MIDDLE = 0.97  # of its range: farther out a joint is pushed back
_STOPS = 1.0  # cost of lying there, per squared distance
_DAMPING = 1e-6  # of a round, per squared change
_LARGEST = 0.3  # change of a joint in a round [rad, m]
_SECOND = (1.0, -2.0, 1.0)  # difference


def relaxed(robot: Robot, path: TaskPath, turn_costs: Array, joints: Array) -> Array:
    """Joint positions (T, n) near others (T, n) along a path: with less bending, hardly farther from the poses.

    The method of Gauss and Newton over all T poses at once minimizes

        sum_t |p_t - p*_t|^2 + |c log(R_t' R*_t)|^2 + b |(q_(t-1) - 2 q_t + q_(t+1)) / v|^2 + |beyond(q_t)|^2,

    with v the limits of velocity over their mean, b = 0.0001 (T / 100)^4, and `beyond` how far the joints lie outside
    the middle 97 % of their ranges. Its equations are banded, with 2 n numbers below the diagonal.

    The parameters are those of `choose_posture`.
    """
    n_poses, n = joints.shape
    weights = np.concatenate((np.ones(3), turn_costs))
    middle, half = (robot.upper + robot.lower) / 2, (robot.upper - robot.lower) / 2
    bending = _BENDING * (n_poses / _POSES) ** 4 * (robot.velocity.mean() / robot.velocity) ** 2
    bent = np.zeros((2 * n + 1, n_poses, n))  # the rows below the diagonal, of bending alone
    for i, first in enumerate(_SECOND):
        for k, second in enumerate(_SECOND[i:]):
            bent[k * n, i : n_poses - 2 + i] += first * second * bending
    q = joints
    for _ in range(_ROUNDS):
        at, turned, slopes = kinematics(robot, q)
        error = distances((at, turned), (path.positions, path.rotations), turn_costs) * weights
        slopes *= weights[:, None]
        inner = np.clip(q, middle - _MIDDLE * half, middle + _MIDDLE * half)
        gradient = np.einsum("tij,ti->tj", slopes, error) + _STOPS * (inner - q)
        for i, factor in enumerate(_SECOND):
            gradient[i : n_poses - 2 + i] -= factor * bending * np.diff(q, 2, axis=0)
        squares = slopes.transpose(0, 2, 1) @ slopes
        rows = bent.copy()
        rows[0] += _DAMPING + _STOPS * (inner != q)
        for i in range(n):
            rows[: n - i, :, i] += squares[:, i:, i].T
        change = solveh_banded(rows.reshape(2 * n + 1, -1), gradient.ravel(), lower=True, check_finite=False)
        q = q + (change * min(1.0, _LARGEST / max(np.abs(change).max(), _LARGEST))).reshape(n_poses, n)
    return np.asarray(np.clip(q, robot.lower, robot.upper))
