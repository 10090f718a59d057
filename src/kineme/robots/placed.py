"""A learned movement, generated where an arm is to execute it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.channels.coordinates import as_wxyz, columns_of
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.primitives.generation.generate import MovementOptions, generate
from kineme.primitives.generation.learned import Learned
from kineme.robots.kinematics.task_path import PLANES
from kineme.validation import Array, as_numbers


class Placed(NamedTuple):
    """A movement of the tip, or of the joints, with the discrete channels of its recording."""

    movement: Trajectory
    steps: dict[str, Array]  # name -> (T,)


def placed(  # noqa: PLR0913 - one parameter per option
    learned: Learned,
    at: ArrayLike | None = None,
    goal: ArrayLike | None = None,
    duration: float | None = None,
    *,
    scale: float = 1.0,
    rate: float = 100.0,
    joints: bool = False,
    plane: str = "xy",
) -> Placed:
    """Generate a movement with start and goal in the frame of a robot.

    Parameters
    ----------
    learned : Learned
    at, goal : array_like of shape (3,), optional
        Start and goal of the tip [m]; of the joints, with as many numbers as they are. By default as demonstrated; a
        goal is then that from the demonstrated start.
    duration : float, optional
        [s]
    scale : float, default 1
        Meters for one unit of the recording, as 0.001 for millimeters.
    rate : float, default 100
        Samples per second, at least.
    joints : bool, default False
        It is a movement of the joints.
    plane : {"xy", "xz", "yz"}
        Where the axes of a movement of two dimensions lie.

    Raises
    ------
    TrajectoryError
        A movement of the tip without two or three positions.
    SpecificationError
        A start or goal of another number of coordinates.
    """
    columns, orientation, discrete = _columns(learned, joints)
    start = _start(learned)[columns]
    axes = list(range(len(columns))) if joints or len(columns) == 3 else list(PLANES[plane])
    begin, end = _point(at, "at", len(columns) if joints else 3), _point(goal, "goal", len(columns) if joints else 3)
    unit = 1.0 if joints else scale
    origin = start * unit if begin is None else begin[axes]
    target = None
    if end is not None:
        target = _whole_goal(learned, columns, start + (end[axes] - origin) / unit)
    made = generate(learned, MovementOptions(goal=target, duration=duration, rate=rate)).columns
    moved = (made["positions"][:, columns] - start) * unit + origin
    if not joints and len(columns) == 2 and begin is not None:
        in_space = np.tile(begin, (len(moved), 1))
        in_space[:, axes] = moved
        moved = in_space
    if orientation is not None:
        moved = np.column_stack((moved, orientation(made["positions"])))
    steps = {name: made["positions"][:, column] for name, column in discrete.items()}
    return Placed(Trajectory(times=made["times"], positions=moved), steps)
