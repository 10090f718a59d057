"""The branch, and where it is left free the place, over the whole movement."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from kineme.errors import TrajectoryError
from kineme.robots.kinematics.cost import costs_of
from kineme.robots.kinematics.descent import descend, kinematics
from kineme.robots.kinematics.postures import postures
from kineme.robots.kinematics.task_path import TaskPath
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_KEY_POSES = 10  # of the movement, where branches are compared
_STEPS = 3  # of inverse kinematics between two of them
_FIRST_STEPS = 12  # from the rest posture to the first of them
_OFFSETS = (-0.25, 0.0, 0.25)  # of the places that are tried, in reaches of the arm
_APPROACH = 0.1  # cost of a joint that first has to go a radian, beside shares of the limits of velocity
_REACHED = 1e-3  # farther from its pose than this, a posture does not reach it [m]
_LOOKED_AT = 20  # poses out of reach, at most, of which the farthest is said


class Choice(NamedTuple):
    """Where a movement is executed and from which posture."""

    start: Array  # (n,), joint positions at the first pose
    shift: Array  # (3,), what is added to the positions of the path [m]
    cost: float


def choose_posture(robot: Robot, path: TaskPath, costs: Array, stands: Array) -> Choice:
    """The posture at the start from which the whole movement costs least, the way to it from where the arm stands too.

    Raises
    ------
    TrajectoryError
        No posture reaches the start: where and by how far.
    """
    starts = postures(robot, path.positions[0], path.rotations[0], costs)
    if starts.errors[0] > _REACHED:
        raise TrajectoryError(_unreachable(robot, path, 0, float(starts.errors[0])))
    found = _track(robot, path, starts.joints, np.zeros((len(starts.joints), 3)), costs)
    found += _APPROACH * np.abs(starts.joints - stands).max(axis=1)
    best = int(np.argmin(found))
    return Choice(starts.joints[best], np.zeros(3), float(found[best]))


def choose_place(robot: Robot, path: TaskPath, costs: Array, stands: Array) -> Choice:
    """The place, among a grid around where the tip rests, and the posture, at which the whole movement costs least."""
    tip = kinematics(robot, robot.rest[None])[0][0]
    center = (path.positions.min(axis=0) + path.positions.max(axis=0)) / 2
    shifts = tip - center + np.array(list(product(_OFFSETS, repeat=3))) * np.linalg.norm(tip)
    rest = np.tile(robot.rest, (len(shifts), 1))
    starts = descend(robot, rest, path.positions[0] + shifts, path.rotations[0], costs, _FIRST_STEPS)
    shift = shifts[int(np.argmin(_track(robot, path, starts.joints, shifts, costs)))]
    moved = path._replace(positions=path.positions + shift)
    return choose_posture(robot, moved, costs, stands)._replace(shift=shift)


def _track(robot: Robot, path: TaskPath, starts: Array, shifts: Array, costs: Array) -> Array:
    """Costs (m,) of the movement from m postures (m, n), each with the path shifted (m, 3), at its key poses."""
    chosen = key_poses(len(path.times))
    joints, errors = np.empty((len(chosen), *starts.shape)), np.empty((len(chosen), len(starts)))
    q = starts
    for i, t in enumerate(chosen):
        q, errors[i] = descend(robot, q, path.positions[t] + shifts, path.rotations[t], costs, _STEPS)
        joints[i] = q
    return costs_of(robot, path.times[chosen], joints, errors)


def key_poses(n_samples: int) -> Array:
    """Indices of the poses at which branches are compared, the first and the last among them."""
    return np.unique(np.linspace(0, n_samples - 1, min(_KEY_POSES, n_samples)).round().astype(int))


def check_reached(robot: Robot, path: TaskPath, joints: Array, costs: Array, tolerance: float) -> None:
    """Refuse joints (T, n) whose tip stays farther from the poses of the path than that [m].

    Raises
    ------
    TrajectoryError
        The pose that is farthest out of reach: at which time, where and by how far; or, if every pose is within reach,
        from when to when the tip does not keep up.
    """
    errors = np.linalg.norm(kinematics(robot, joints)[0] - path.positions, axis=1)
    missed = np.flatnonzero(~(errors <= tolerance))
    if len(missed) == 0:
        return
    looked_at = missed[np.unique(np.linspace(0, len(missed) - 1, _LOOKED_AT).astype(int))]
    nearest = [postures(robot, path.positions[t], path.rotations[t], costs).errors[0] for t in looked_at]
    worst = int(np.argmax(nearest))
    if nearest[worst] > tolerance:
        raise TrajectoryError(_unreachable(robot, path, int(looked_at[worst]), float(nearest[worst])))
    raise TrajectoryError(
        f"{robot.name} reaches every pose of this movement, but not one after the other: from "
        f"{path.times[missed[0]]:.2f} to {path.times[missed[-1]]:.2f} s its tip stays up to {errors.max():.3f} m away, "
        "where joints come to a stop or would have to jump; choose another place, free the orientation, or make the "
        "movement smaller"
    )


def _unreachable(robot: Robot, path: TaskPath, t: int, meters: float) -> str:
    where = ", ".join(f"{x:.3f}" for x in path.positions[t])
    return (
        f"{robot.name} does not reach ({where}) m at {path.times[t]:.2f} s: its tip stays {meters:.3f} m away; "
        "choose another place, free the orientation, or make the movement smaller"
    )
