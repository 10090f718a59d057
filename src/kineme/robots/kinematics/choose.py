"""The branch, and where it is left free the place, over the whole movement."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from kineme.errors import TrajectoryError
from kineme.robots.kinematics.cost import cost_of
from kineme.robots.kinematics.inverse import InverseKinematics
from kineme.robots.kinematics.postures import postures
from kineme.robots.kinematics.task_path import TaskPath
from kineme.validation import Array

_KEY_POSES = 12  # of the movement, where branches are compared
_STEPS = 4  # of inverse kinematics between two of them
_REACHED = 1e-3  # farther from its pose than this, a posture does not reach it [m]
_OFFSETS = (-0.25, 0.0, 0.25)  # of the places that are tried, in reaches of the arm


class Choice(NamedTuple):
    """Where a movement is executed and from which posture."""

    start: Array  # (n,), joint positions at the first pose
    shift: Array  # (3,), what is added to the positions of the path [m]
    cost: float


def choose_posture(ik: InverseKinematics, path: TaskPath) -> Choice:
    """The posture at the start from which the whole movement costs least.

    Raises
    ------
    TrajectoryError
        No posture reaches the start, or none the whole movement: at which time, where and by how far.
    """
    starts = postures(ik, path.positions[0], path.rotations[0])
    if not starts:
        raise TrajectoryError(_unreachable(ik, path, 0))
    costs = [_track(ik, path, start)[0] for start in starts]
    best = int(np.argmin(costs))
    return Choice(starts[best], np.zeros(3), costs[best])


def choose_place(ik: InverseKinematics, path: TaskPath) -> Choice:
    """The place, among a grid around where the tip rests, and the posture, at which the whole movement costs least."""
    robot = ik.robot
    ik.reset(robot.rest)
    tip = ik.tip_position
    center = (path.positions.min(axis=0) + path.positions.max(axis=0)) / 2
    offsets = np.array(list(product(_OFFSETS, repeat=3))) * np.linalg.norm(tip)
    shifts = tip + offsets - center
    costs = np.array([_cost_from_rest(ik, _moved(path, shift)) for shift in shifts])
    shift = shifts[int(np.argmin(costs))]
    chosen = choose_posture(ik, _moved(path, shift))
    return chosen._replace(shift=shift)


def _moved(path: TaskPath, shift: Array) -> TaskPath:
    return path._replace(positions=path.positions + shift)


def _cost_from_rest(ik: InverseKinematics, path: TaskPath) -> float:
    ik.reset(ik.robot.rest)
    return _track(ik, path, ik.solve(path.positions[0], path.rotations[0]))[0]


def _track(ik: InverseKinematics, path: TaskPath, start: Array) -> tuple[float, Array]:
    """Cost and errors of the movement from one posture, at its key poses."""
    chosen = key_poses(len(path.times))
    ik.reset(start)
    joints, errors = np.empty((len(chosen), len(start))), np.empty(len(chosen))
    for i, t in enumerate(chosen):
        joints[i] = ik.solve(path.positions[t], path.rotations[t], most=_STEPS)
        errors[i] = ik.error
    return cost_of(ik.robot, path.times[chosen], joints, errors), errors


def key_poses(n_samples: int) -> Array:
    """Indices of the poses at which branches are compared, the first and the last among them."""
    return np.unique(np.linspace(0, n_samples - 1, min(_KEY_POSES, n_samples)).round().astype(int))


def _unreachable(ik: InverseKinematics, path: TaskPath, t: int) -> str:
    ik.reset(ik.robot.rest)
    ik.solve(path.positions[t], path.rotations[t], most=100)
    where = ", ".join(f"{x:.3f}" for x in path.positions[t])
    return (
        f"{ik.robot.name} does not reach ({where}) m at {path.times[t]:.2f} s: its tip stays {ik.error:.3f} m away; "
        "choose another place, free the orientation, or make the movement smaller"
    )
