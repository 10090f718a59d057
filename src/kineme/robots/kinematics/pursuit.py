"""Ways along a whole path from many postures at once: for paths that the joints lose if they look one step ahead."""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.linalg import solveh_banded

from kineme.robots.kinematics import descent
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_TOLERATED = 1e-4  # distance from the path that costs nothing [m]
_PER_METER = 1e3
AT_A_STOP = 5.0  # cost of a joint that comes to a stop: it does so suddenly, and the others have to do its part
_STOP = 0.99  # share of the range of a joint from which on it is at a stop

_KEY_POSES = 10  # of the movement, where branches are compared
_BETWEEN_STEPS = 3  # of inverse kinematics between two of them
_FIRST_STEPS = 12  # from the rest posture to the first of them
_OFFSETS = (-0.25, 0.0, 0.25)  # along each axis, in distances of the tip at rest from the base
_BELOW = 100.0  # cost of a meter that the tip goes below the plane on which the arm stands
_APPROACH = 0.1  # cost of a joint that first has to go a radian, beside shares of the limits of velocity

_ROUNDS = 12  # of the method of Gauss and Newton
_BENDING = 1e-4  # cost of bending, beside 1 per squared meter from the path, where 100 poses are the path
_POSES = 100.0
_MIDDLE = 0.97  # of its range: farther out a joint is pushed back
_STOPS = 1.0  # cost of lying there, per squared distance
_REGULARIZATION = 1e-6  # of a round, per squared change
_LARGEST_CHANGE = 0.3  # change of a joint in a round [rad, m]
_SECOND = (1.0, -2.0, 1.0)  # difference
_Limits = tuple[Array, Array, Array]  # costs of turning; the lowest and the highest positions of the joints

_DENSE = 400  # poses at least: between two of them, a step of Newton's method is nearly exact
_SEEDS = 48  # starts from which the postures at one pose are sought
_BEGINS = (0.0, 1.0, 0.5)  # of the path: postures are few where a joint is at a stop, and surest to be found from there
_PULLS = (0.0, 0.01)  # of the way to the rest posture, at each pose: so far go joints that the pose leaves free
_LARGEST_PULL = 0.01  # [rad, m]
_AWAY = 0.05  # of the way to the middle, so far goes a joint at a stop; less by the 7th power farther from it
_INSIDE = 0.9995  # of its range: between samples a joint goes a little beyond
_WAYS = 18  # postures at most that are followed together, once for each pull
_STEPS = 2  # of Newton's method at each pose
_DAMPING = 1e-8  # of a step, besides the squared distance from the pose
_LARGEST = 0.15  # change of a joint in one step [rad, m]: more is a jump to another posture
_LOST = 1e-3  # from its pose [m, rad], from which on a way is given up
_FOLLOWED = 1e-5  # the same, of a way that is followed
_NEARLY = 1e-4  # the same, if there is none: arms of few joints turn as far as the position allows


def pursue(robot: Robot, path: descent.TaskPath, turn_costs: Array) -> tuple[Array, descent.TaskPath] | None:
    """Find joint positions (T, n) along a path, and return them with the path at T poses; None if there is no way.

    Postures at the beginning are followed to the end, all at once, by Newton's method with limits. What a pose leaves
    free stays, or goes slowly towards the rest posture and away from stops. Of the ways within 0.01 mm of the path it
    is that of least cost, smoothed as `relaxed`; if it comes to a stop, also from the end and the middle on.
    """
    path = path if len(path.times) >= _DENSE else path.at(np.linspace(0.0, path.times[-1], _DENSE))
    margin = (1 - _INSIDE) * (robot.upper - robot.lower) / 2
    limits = turn_costs, robot.lower + margin, robot.upper - margin
    last = len(path.times) - 1
    least, best = np.inf, None
    for share in _BEGINS:
        begin = round(share * last)
        seeds = descent.postures(robot, path.positions[begin], path.rotations[begin], turn_costs, _SEEDS)
        starts = np.repeat(seeds.joints[seeds.errors <= _NEARLY][:_WAYS], len(_PULLS), axis=0)
        joints = np.tile(starts, (last + 1, 1, 1))
        errors = np.full(joints.shape[:2], np.inf)
        for order in (range(begin, last + 1), range(begin, -1, -1)):
            _follow(robot, path, limits, order, joints, errors)
        worst = errors.max(axis=0)
        close = min(_NEARLY, max(_FOLLOWED, min(worst, default=np.inf)))
        good = np.flatnonzero(worst <= close)
        if len(good) == 0:
            continue
        cheapest = good[int(np.argmin(_costs(robot, path.times, joints[:, good], errors[:, good])))]
        way, errors = joints[:, [cheapest]], errors[:, [cheapest]]
        near = relaxed(robot, path, turn_costs, way[:, 0])
        smooth, off = _newton(robot, near, np.zeros_like(near), (path.positions, path.rotations), limits)
        if off.max() <= close:  # with less bending, and as near to the path
            way, errors = smooth[:, None], off[:, None]
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


def _follow(robot: Robot, path: descent.TaskPath, limits: _Limits, order: range, joints: Array, errors: Array) -> None:
    """Fill `joints` (T, m, n) and `errors` (T, m) in place, in that order of poses; ways that are lost end."""
    middle, half = (robot.upper + robot.lower) / 2, (robot.upper - robot.lower) / 2
    ways = np.arange(joints.shape[1])
    pulls = np.resize(_PULLS, joints.shape[1])[:, None]
    before = q = joints[order[0]] if len(order) else joints[0]
    for t in order:
        away = ((q - middle) / half) ** 7 * half  # from the stops
        pull = np.clip(pulls[ways] * (robot.rest - q) - _AWAY * away, -_LARGEST_PULL, _LARGEST_PULL)
        ahead = np.clip(2 * q - before, *limits[1:])
        moved, off = _newton(robot, ahead, pull, (path.positions[t], path.rotations[t]), limits)
        joints[t, ways], errors[t, ways] = moved, off
        near = off <= _LOST
        ways, before, q = ways[near], q[near], moved[near]
        if len(ways) == 0:
            return


def _newton(robot: Robot, q: Array, pull: Array, pose: tuple[Array, Array], limits: _Limits) -> tuple[Array, Array]:
    """Postures (m, n) brought to one pose, and how far they are from it (m,) [m, rad]."""
    turn_costs, lower, upper = limits
    weights = np.concatenate((np.ones(3), turn_costs))
    counted = weights >= 1  # less is what arms of few joints follow as far as they can
    for step in range(_STEPS + 1):
        at, turned, jacobians = descent.kinematics(robot, q)
        error = descent.distances((at, turned), pose, turn_costs)
        if step < _STEPS:
            near = np.einsum("mi,mi->m", error * weights, error * weights) + _DAMPING
            drift = pull if step == 0 else np.zeros_like(q)
            costs, range_left = (drift, near, np.zeros(len(q))), (lower - q, upper - q)
            change = descent.step_within(jacobians * weights[:, None], error * weights, costs, range_left)
            q = q + change * np.minimum(1.0, _LARGEST / np.maximum(np.abs(change).max(axis=1, keepdims=True), 1e-12))
    return q, np.linalg.norm(error[:, counted], axis=1)


def relaxed(robot: Robot, path: descent.TaskPath, turn_costs: Array, joints: Array) -> Array:
    """Joint positions (T, n) near others (T, n) along a path: with less bending, hardly farther from the poses.

    The method of Gauss and Newton over all T poses at once minimizes

        sum_t |p_t - p*_t|^2 + |c log(R_t' R*_t)|^2 + b |(q_(t-1) - 2 q_t + q_(t+1)) / v|^2 + |beyond(q_t)|^2,

    with v the limits of velocity over their mean, b = 0.0001 (T / 100)^4, and `beyond` how far the joints lie outside
    the middle 97 % of their ranges. Its equations are banded, with 2 n numbers below the diagonal.
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
        at, turned, slopes = descent.kinematics(robot, q)
        error = descent.distances((at, turned), (path.positions, path.rotations), turn_costs) * weights
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


def choose_posture(robot: Robot, path: descent.TaskPath, turn_costs: Array, stands: Array) -> Array:
    """The posture at the start from which the movement costs least, plus 0.1 a radian of the joint farthest from it."""
    starts = descent.reaching_postures(
        robot, path.positions[0], path.rotations[0], turn_costs, descent.pose_in_words(path, 0)
    )
    total = _costs_of_movements(robot, path, starts, np.zeros((len(starts), 3)), turn_costs)
    total += _APPROACH * np.abs(starts - stands).max(axis=1)
    return np.asarray(starts[int(np.argmin(total))])


def choose_place(robot: Robot, path: descent.TaskPath, turn_costs: Array) -> descent.TaskPath:
    """The path at that of 27 places around the resting tip where it costs least; a meter below the base costs 100."""
    tip = descent.kinematics(robot, robot.rest[None])[0][0]
    center = (path.positions.min(axis=0) + path.positions.max(axis=0)) / 2
    shifts = tip - center + np.array(list(product(_OFFSETS, repeat=3))) * np.linalg.norm(tip)
    rest = np.tile(robot.rest, (len(shifts), 1))
    starts = descent.descend(robot, rest, path.positions[0] + shifts, path.rotations[0], turn_costs, _FIRST_STEPS)
    costs = _costs_of_movements(robot, path, starts.joints, shifts, turn_costs)
    costs += _BELOW * np.maximum(0.0, min(0.0, tip[2]) - (path.positions[:, 2].min() + shifts[:, 2]))
    return path._replace(positions=path.positions + shifts[int(np.argmin(costs))])


def _costs_of_movements(robot: Robot, path: descent.TaskPath, starts: Array, shifts: Array, turn_costs: Array) -> Array:
    """Costs (m,) of the movement from m postures (m, n), each with the path shifted (m, 3), at its key poses."""
    n_samples = len(path.times)
    keys = np.unique(np.linspace(0, n_samples - 1, min(_KEY_POSES, n_samples)).round().astype(int))
    joints, errors = np.empty((len(keys), *starts.shape)), np.empty((len(keys), len(starts)))
    q = starts
    for i, t in enumerate(keys):
        q, errors[i] = descent.descend(
            robot, q, path.positions[t] + shifts, path.rotations[t], turn_costs, _BETWEEN_STEPS
        )
        joints[i] = q
    return costs_of(robot, path.times[keys], joints, errors)


def costs_of(robot: Robot, times: Array, joints: Array, errors: Array) -> Array:
    """Costs (m,) of m ways of joint positions (T, m, n) at times (T,), tips off by (T, m) [m]; smaller is better.

    The sum of: 1000 times the largest error beyond 0.1 mm; the largest share of the limits of velocity; the fourth
    power of the largest share of the range of a joint, which rises where a joint comes close to a stop, and 5 where it
    comes to it. A posture near a singularity costs by the velocities it takes.
    """
    missed = _PER_METER * np.maximum(0.0, errors.max(axis=0) - _TOLERATED)
    speed = np.abs(np.diff(joints, axis=0)) / np.diff(times)[:, None, None] / robot.velocity
    middle, half = (robot.upper + robot.lower) / 2, (robot.upper - robot.lower) / 2
    stops = (np.abs(joints - middle) / half).max(axis=(0, 2))
    return np.asarray(missed + speed.max(axis=(0, 2)) + stops**4 + AT_A_STOP * (stops > _STOP))
