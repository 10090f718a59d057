"""The branch of inverse kinematics, and where the movement lies if that is free: best for all of it together."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from kineme.robots.kinematics.descent import descend, kinematics
from kineme.robots.kinematics.reach import pose_in_words, reaching_postures
from kineme.robots.kinematics.task_path import TaskPath
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_TOLERATED = 1e-4  # distance from the path that costs nothing [m]
_PER_METER = 1e3
AT_A_STOP = 5.0  # cost of a joint that comes to a stop: it does so suddenly, and the others have to do its part
_STOP = 0.99  # share of the range of a joint from which on it is at a stop

_KEY_POSES = 10  # of the movement, where branches are compared
_STEPS = 3  # of inverse kinematics between two of them
_FIRST_STEPS = 12  # from the rest posture to the first of them
_OFFSETS = (-0.25, 0.0, 0.25)  # along each axis, in distances of the tip at rest from the base
_BELOW = 100.0  # cost of a meter that the tip goes below the plane on which the arm stands
_APPROACH = 0.1  # cost of a joint that first has to go a radian, beside shares of the limits of velocity


class Choice(NamedTuple):
    """From which posture a movement is executed, and where."""

    start: Array  # (n,), joint positions at the first pose
    shift: Array  # (3,), what is added to the positions of the path [m]


def choose_posture(robot: Robot, path: TaskPath, turn_costs: Array, stands: Array) -> Choice:
    """The posture at the start from which the whole movement costs least, with the way to it.

    `turn_costs` (3,): as `InverseKinematics.costs`; `stands` (n,): where the joints stand: 0.1 is added for each radian
    of the joint that has farthest to go. Raises TrajectoryError: no posture reaches the start: where and by how far.
    """
    starts = reaching_postures(robot, path.positions[0], path.rotations[0], turn_costs, pose_in_words(path, 0))
    total = _costs_of_movements(robot, path, starts, np.zeros((len(starts), 3)), turn_costs)
    total += _APPROACH * np.abs(starts - stands).max(axis=1)
    return Choice(starts[int(np.argmin(total))], np.zeros(3))


def choose_place(robot: Robot, path: TaskPath, turn_costs: Array, stands: Array) -> Choice:
    """The shift, among 27 around where the tip rests, and the posture, with which the whole movement costs least.

    A meter below z = 0, where the arm stands, or below the resting tip if that is lower, costs 100.

    The parameters and errors are those of `choose_posture`.
    """
    tip = kinematics(robot, robot.rest[None])[0][0]
    center = (path.positions.min(axis=0) + path.positions.max(axis=0)) / 2
    shifts = tip - center + np.array(list(product(_OFFSETS, repeat=3))) * np.linalg.norm(tip)
    rest = np.tile(robot.rest, (len(shifts), 1))
    starts = descend(robot, rest, path.positions[0] + shifts, path.rotations[0], turn_costs, _FIRST_STEPS)
    costs = _costs_of_movements(robot, path, starts.joints, shifts, turn_costs)
    costs += _BELOW * np.maximum(0.0, min(0.0, tip[2]) - (path.positions[:, 2].min() + shifts[:, 2]))
    shift = shifts[int(np.argmin(costs))]
    moved = path._replace(positions=path.positions + shift)
    return choose_posture(robot, moved, turn_costs, stands)._replace(shift=shift)


def _costs_of_movements(robot: Robot, path: TaskPath, starts: Array, shifts: Array, turn_costs: Array) -> Array:
    """Costs (m,) of the movement from m postures (m, n), each with the path shifted (m, 3), at its key poses."""
    keys = key_poses(len(path.times))
    joints, errors = np.empty((len(keys), *starts.shape)), np.empty((len(keys), len(starts)))
    q = starts
    for i, t in enumerate(keys):
        q, errors[i] = descend(robot, q, path.positions[t] + shifts, path.rotations[t], turn_costs, _STEPS)
        joints[i] = q
    return costs_of(robot, path.times[keys], joints, errors)


def key_poses(n_samples: int) -> Array:
    """Indices of the poses at which branches are compared, the first and the last among them."""
    return np.unique(np.linspace(0, n_samples - 1, min(_KEY_POSES, n_samples)).round().astype(int))


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
