"""Ways along a whole path from many postures at once: for paths that the joints lose if they look one step ahead."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solveh_banded

from kineme.robots.kinematics.choose import AT_A_STOP, costs_of
from kineme.robots.kinematics.descent import distances, kinematics, postures, step_within
from kineme.robots.kinematics.task_path import TaskPath
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_ROUNDS = 12  # of the method of Gauss and Newton
_BENDING = 1e-4  # cost of bending, beside 1 per squared meter from the path, where 100 poses are the path
_POSES = 100.0
_MIDDLE = 0.97  # of its range: farther out a joint is pushed back
_STOPS = 1.0  # cost of lying there, per squared distance
_REGULARIZATION = 1e-6  # of a round, per squared change
_LARGEST_CHANGE = 0.3  # change of a joint in a round [rad, m]
_SECOND = (1.0, -2.0, 1.0)  # difference

_DENSE = 400  # poses at least: between two of them, a step of Newton's method is nearly exact
_SEEDS = 48  # starts from which the postures at one pose are sought
_BEGINS = (0.0, 1.0, 0.5)  # of the path: postures are few where a joint is at a stop, and surest to be found from there
_PULLS = (0.0, 0.01)  # of the way to the rest posture, at each pose: so far go joints that the pose leaves free
_LARGEST_PULL = 0.01  # [rad, m]
_AWAY = (
    0.05  # of the way to the middle of its range, so far goes a joint at a stop; less by the 7th power farther from it
)
_INSIDE = 0.9995  # of its range: between samples a joint goes a little beyond
_WAYS = 18  # postures at most that are followed together, once for each pull
_STEPS = 2  # of Newton's method at each pose
_DAMPING = 1e-8  # of a step, besides the squared distance from the pose
_LARGEST = 0.15  # change of a joint in one step [rad, m]: more is a jump to another posture
_LOST = 1e-3  # from its pose [m, rad], from which on a way is given up
_FOLLOWED = 1e-5  # the same, of a way that is followed
_NEARLY = 1e-4  # the same, if there is none: arms of few joints turn as far as the position allows


def pursue(robot: Robot, path: TaskPath, turn_costs: Array) -> tuple[Array, TaskPath] | None:
    """Find joint positions (T, n) along a path, and return them with the path at T poses; None if there is no way.

    Postures at the beginning, the end and the middle of the path are followed to both ends, all at once, by Newton's
    method with limits: a joint at a stop stays there and the others do its part. What a pose leaves free stays as it
    is, or goes slowly towards the rest posture and away from stops. Of the ways that stay within 0.01 mm of the path,
    that of least cost, smoothed as `relaxed`; the end and the middle are begun at only if it comes to a stop.

    The parameters are those of `choose_posture`.
    """
    path = path if len(path.times) >= _DENSE else path.at(np.linspace(0.0, path.times[-1], _DENSE))
    last = len(path.times) - 1
    least, best = np.inf, None
    for share in _BEGINS:
        begin = round(share * last)
        seeds = postures(robot, path.positions[begin], path.rotations[begin], turn_costs, _SEEDS)
        starts = np.repeat(seeds.joints[seeds.errors <= _NEARLY][:_WAYS], len(_PULLS), axis=0)
        joints = np.tile(starts, (last + 1, 1, 1))
        errors = np.full(joints.shape[:2], np.inf)
        for order in (range(begin, last + 1), range(begin, -1, -1)):
            _follow(robot, path, turn_costs, order, joints, errors)
        worst = errors.max(axis=0)
        close = min(_NEARLY, max(_FOLLOWED, min(worst, default=np.inf)))
        good = np.flatnonzero(worst <= close)
        if len(good) == 0:
            continue
        cheapest = good[int(np.argmin(_costs(robot, path.times, joints[:, good], errors[:, good])))]
        way, errors = _relaxed(robot, path, turn_costs, joints[:, [cheapest]], errors[:, [cheapest]], close)
        cost = float(_costs(robot, path.times, way, errors)[0])
        if cost < least:
            least, best = cost, way[:, 0]
        if least < AT_A_STOP:
            break
    return None if best is None else (best, path)


def _costs(robot: Robot, times: Array, joints: Array, errors: Array) -> Array:
    """Costs (m,) of m ways (T, m, n), as `costs_of`, and how many times slower accelerations make them."""
    steps = np.diff(times)[:, None, None]
    bends = np.abs(np.diff(np.diff(joints, axis=0) / steps, axis=0)) * 2 / (steps[1:] + steps[:-1])
    return costs_of(robot, times, joints, errors) + np.sqrt((bends / robot.acceleration).max(axis=(0, 2)))


def _relaxed(
    robot: Robot, path: TaskPath, turn_costs: Array, way: Array, errors: Array, close: float
) -> tuple[Array, Array]:
    """The way (T, 1, n) with less bending, and its errors (T, 1); itself, where that leads farther from the path."""
    middle, half = (robot.upper + robot.lower) / 2, (robot.upper - robot.lower) / 2
    limits = turn_costs, middle - _INSIDE * half, middle + _INSIDE * half
    near = relaxed(robot, path, turn_costs, way[:, 0])
    joints, off = _newton(robot, near, np.zeros_like(near), (path.positions, path.rotations), limits)
    return (joints[:, None], off[:, None]) if off.max() <= close else (way, errors)


def _follow(robot: Robot, path: TaskPath, turn_costs: Array, order: range, joints: Array, errors: Array) -> None:
    """Fill `joints` (T, m, n) and `errors` (T, m) in place, in that order of poses; ways that are lost end."""
    middle, half = (robot.upper + robot.lower) / 2, (robot.upper - robot.lower) / 2
    lower, upper = middle - _INSIDE * half, middle + _INSIDE * half
    ways = np.arange(joints.shape[1])
    pulls = np.resize(_PULLS, joints.shape[1])[:, None]
    before = q = joints[order[0]] if len(order) else joints[0]
    for t in order:
        away = ((q - middle) / half) ** 7 * half  # from the stops
        pull = np.clip(pulls[ways] * (robot.rest - q) - _AWAY * away, -_LARGEST_PULL, _LARGEST_PULL)
        ahead = np.clip(2 * q - before, lower, upper)
        pose = path.positions[t], path.rotations[t]
        moved, off = _newton(robot, ahead, pull, pose, (turn_costs, lower, upper))
        joints[t, ways], errors[t, ways] = moved, off
        near = off <= _LOST
        ways, before, q = ways[near], q[near], moved[near]
        if len(ways) == 0:
            return


def _newton(
    robot: Robot, q: Array, pull: Array, pose: tuple[Array, Array], limits: tuple[Array, Array, Array]
) -> tuple[Array, Array]:
    """Postures (m, n) brought to one pose, and how far they are from it (m,) [m, rad]."""
    turn_costs, lower, upper = limits
    weights = np.concatenate((np.ones(3), turn_costs))
    counted = weights >= 1  # less is what arms of few joints follow as far as they can
    for step in range(_STEPS + 1):
        at, turned, jacobians = kinematics(robot, q)
        error = distances((at, turned), pose, turn_costs)
        if step < _STEPS:
            near = np.einsum("mi,mi->m", error * weights, error * weights) + _DAMPING
            drift = pull if step == 0 else np.zeros_like(q)
            costs, range_left = (drift, near, np.zeros(len(q))), (lower - q, upper - q)
            change = step_within(jacobians * weights[:, None], error * weights, costs, range_left)
            q = q + change * np.minimum(1.0, _LARGEST / np.maximum(np.abs(change).max(axis=1, keepdims=True), 1e-12))
    return q, np.linalg.norm(error[:, counted], axis=1)


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
        rows[0] += _REGULARIZATION + _STOPS * (inner != q)
        for i in range(n):
            rows[: n - i, :, i] += squares[:, i:, i].T
        change = solveh_banded(rows.reshape(2 * n + 1, -1), gradient.ravel(), lower=True, check_finite=False)
        q = q + (change * min(1.0, _LARGEST_CHANGE / max(np.abs(change).max(), _LARGEST_CHANGE))).reshape(n_poses, n)
    return np.asarray(np.clip(q, robot.lower, robot.upper))
