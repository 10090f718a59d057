"""The joints along a movement of the tip: one way after another, until one passes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from kineme.errors import TrajectoryError
from kineme.movements.rotations.matrices import quaternion_of
from kineme.robots.kinematics.choose import choose_place, choose_posture
from kineme.robots.kinematics.descent import kinematics
from kineme.robots.kinematics.inverse import ORIENTATIONS, InverseKinematics
from kineme.robots.kinematics.pursuit import pursue
from kineme.robots.kinematics.task_path import TaskPath, task_path
from kineme.robots.planning.request import Request
from kineme.validation import Array

PLACES = ("as given", "free")
_STRICTER = {follow: list(ORIENTATIONS)[i::-1] for i, follow in enumerate(ORIENTATIONS)}  # itself first
_SAMPLES = (150, 600)  # poses at least for which the joints are solved, whatever the duration; more where needed
_CLOSE = 1e-5  # to the path between them [m]


def path_of_the_tip(
    ik: InverseKinematics, request: Request, orientation: ArrayLike | None = None, plane: str = "xy"
) -> TaskPath:
    """The poses that are asked for; where an orientation or a third coordinate is missing, that of the tip at rest."""
    turned = request.orientations if orientation is None else orientation
    at_rest = quaternion_of(ik.tip_rotation)
    return task_path(request.times, request.positions, at_rest if turned is None else turned, plane, ik.tip_position)


class Way(NamedTuple):
    """How the joints may follow a movement; it is solved when it is asked for."""

    ik: InverseKinematics
    sought: bool  # by `pursue`, among many postures: that takes as long as fifty others

    def joints(self, path: TaskPath, place: str, stands: Array) -> tuple[CubicSpline, TaskPath]:
        """The joints over time, and the path at its place, for an arm that stands at `stands` (n,).

        The posture at the start, and a place that is free, are those with which the whole movement costs least.

        Raises
        ------
        OutOfReachError
            No posture reaches the start of the path.
        TrajectoryError
            None of the postures that are followed keeps to the path.
        """
        choose = choose_place if place == "free" else choose_posture
        chosen = choose(self.ik.robot, path, self.ik.costs, stands)
        path = path._replace(positions=path.positions + chosen.shift)
        if self.sought:
            found = pursue(self.ik.robot, path, self.ik.costs)
            if found is None:
                raise TrajectoryError(f"{self.ik.robot.name} reaches no way along this movement")
            return CubicSpline(found[1].times, found[0]), found[1]
        for n in _SAMPLES:
            dense = path if len(path.times) >= n else path.at(np.linspace(0.0, path.times[-1], n))
            self.ik.reset(chosen.start)
            self.ik.solve(dense.positions[0], dense.rotations[0])
            joints = CubicSpline(dense.times, self.ik.follow(dense.positions, dense.rotations))
            between = (dense.times[:-1] + dense.times[1:]) / 2
            off = kinematics(self.ik.robot, joints(between))[0] - dense.at(between).positions
            if np.abs(off).max() <= _CLOSE:
                break
        return joints, dense


def ways_along(ik: InverseKinematics, follow: str) -> Iterator[Way]:
    """Yield the ways to try, the quickest first.

    An orientation that need not be followed may be: what is left free never loses a movement.
    """
    solvers = [ik]
    yield Way(ik, False)
    for stricter in _STRICTER[follow][1:]:
        solvers.append(InverseKinematics(ik.robot, stricter))
        yield Way(solvers[-1], False)
    for solver in solvers:
        yield Way(solver, True)
