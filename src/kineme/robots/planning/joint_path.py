"""The joints along a movement of the tip: the place and the branch are chosen, then inverse kinematics follows it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from kineme.movements.rotations.matrices import quaternion_of
from kineme.robots.kinematics.choose import choose_place, choose_posture
from kineme.robots.kinematics.inverse import InverseKinematics
from kineme.robots.kinematics.task_path import TaskPath, task_path
from kineme.robots.planning.request import Request
from kineme.validation import Array

PLACES = ("as given", "free")
_DENSE = 150  # poses at least for which the joints are solved, whatever the duration


def path_of_the_tip(
    ik: InverseKinematics, request: Request, orientation: ArrayLike | None = None, plane: str = "xy"
) -> TaskPath:
    """The poses that are asked for; where an orientation or a third coordinate is missing, that of the tip at rest."""
    turned = request.orientations if orientation is None else orientation
    at_rest = quaternion_of(ik.tip_rotation)
    return task_path(request.times, request.positions, at_rest if turned is None else turned, plane, ik.tip_position)


def joints_along(ik: InverseKinematics, path: TaskPath, place: str, stands: Array) -> tuple[CubicSpline, TaskPath]:
    """The joints over time, and the path at its place, for an arm that stands at `stands` (n,).

    The posture at the start, and a place that is free, are those with which the whole movement costs least.

    Raises
    ------
    TrajectoryError
        No posture reaches the start of the path.
    """
    choose = choose_place if place == "free" else choose_posture
    chosen = choose(ik.robot, path, ik.costs, stands)
    path = path._replace(positions=path.positions + chosen.shift)
    if len(path.times) < _DENSE:
        path = path.at(np.linspace(0.0, path.times[-1], _DENSE))
    ik.reset(chosen.start)
    ik.solve(path.positions[0], path.rotations[0])
    return CubicSpline(path.times, ik.follow(path.positions, path.rotations)), path
