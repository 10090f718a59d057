"""A learned movement, generated where an arm is to execute it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.channels.coordinates import as_wxyz
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.primitives.generation.generate import MovementOptions, generate
from kineme.primitives.generation.learned import Learned
from kineme.robots.kinematics.task_path import PLANES
from kineme.robots.planning.roles import Roles, roles_of
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
    scale: float | None = None,
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
    scale : float, optional
        Meters (of the joints radians) for one unit of the recording, as 0.001 for millimeters; by default as the heads
        of its columns say, and where they do not, 1.
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
    found = roles_of(learned.primitive.channels, len(learned.columns), "joints" if joints else "tip")
    _check_tip(found, learned, joints)
    shown = generate(learned, MovementOptions(duration=duration, rate=rate)).columns["positions"]
    n = len(found.positions)
    axes = list(PLANES[plane]) if n == 2 and not joints else list(range(n))
    begin, end = (_point(point, name, n if joints else 3) for point, name in ((at, "at"), (goal, "goal")))
    unit = found.units if scale is None else np.full(n, scale)
    start = shown[0, found.positions]
    origin = start * unit if begin is None else begin[axes]
    target = None
    if end is not None:
        wanted = shown[-1].copy()
        wanted[found.positions] = start + (end[axes] - origin) / unit
        target = wanted[found.moving]
    options = MovementOptions(goal=target, duration=duration, rate=rate, meet_goal=target is not None)
    made = generate(learned, options).columns
    moved = (made["positions"][:, found.positions] - start) * unit + origin
    if begin is not None and not joints and n == 2:
        in_space = np.tile(begin, (len(moved), 1))
        in_space[:, axes] = moved
        moved = in_space
    if found.orientation is not None and moved.shape[1] == 3:
        moved = np.column_stack((moved, as_wxyz(made["positions"][:, found.orientation[1]], found.orientation[0])))
    steps = {name: made["positions"][:, column] for name, column in found.discrete.items()}
    return Placed(Trajectory(times=made["times"], positions=moved), steps)


def _check_tip(found: Roles, learned: Learned, joints: bool) -> None:
    if not joints and len(found.positions) not in (2, 3):
        raise TrajectoryError(
            f"expected two or three positions of the tip, got {len(found.positions)} among "
            f"{', '.join(learned.columns)}; choose columns, or say that it is a movement of the joints (joints=True, "
            "--joints)"
        )


def _point(point: ArrayLike | None, name: str, n: int) -> Array | None:
    if point is None:
        return None
    values = as_numbers(point, name)
    if values.shape != (n,) or not np.isfinite(values).all():
        raise SpecificationError(f"expected {name} as {n} finite numbers, got {np.asarray(point).tolist()}")
    return values
