"""A learned movement, generated where an arm is to execute it: start and goal in the frame of the robot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.dmp.generation.generate import Learned, MovementOptions, generate
from kineme.errors import SpecificationError, warn
from kineme.movements.channels.channel import Channel
from kineme.movements.channels.coordinates import as_wxyz
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.robots.execution.preflight import TRACKED
from kineme.robots.kinematics.descent import PLANES
from kineme.robots.models.robot import Robot
from kineme.robots.planning.roles import (
    DRIVERS,
    Roles,
    Scales,
    check_columns,
    check_plausible,
    plane_of,
    roles_of,
    scales_of,
)
from kineme.units import split_head
from kineme.validation import Array, as_point


class GeneratedMovement(NamedTuple):
    """A movement of the tip, or of the joints, with the discrete channels of its recording."""

    movement: Trajectory  # [m] or [rad]; of the tip alone or, (T, 7), with its orientations w, x, y, z
    steps: dict[str, Array]  # name -> (T,)
    continuous: dict[str, Array]  # the same of what moves beside joints, as a gripper
    plane: str  # of two positions
    said: list[str]  # start and goal of joints as they were taken, with names and units


def generate_at(  # noqa: PLR0913 - one parameter per option
    learned: Learned,
    at: ArrayLike | None = None,
    goal: ArrayLike | None = None,
    duration: float | None = None,
    *,
    displacement: ArrayLike | None = None,
    scale: float | None = None,
    rate: float = 100.0,
    joints: Robot | None = None,
    joint_units: str | None = None,
    plane: str | None = None,
) -> GeneratedMovement:
    """Generate a movement of the tip, or of the `joints` of an arm, with start and goal in the frame of the robot.

    `at` and `goal` (3,) are in meters or, of the joints, (n,) in the units and the order of their columns, by default
    as demonstrated; `displacement` (n,) is goal minus start in the unit of the recording. `scale` is meters or radians
    for one of these units, by default as heads of columns say it, else 1. `joint_units` and `plane` are as of `move`,
    `rate` is the least [1/s].
    """
    roles = roles_of(learned.primitive.channels, len(learned.columns), "joints" if joints else "tip", joints)
    n = len(roles.positions)
    check_columns(roles, joints)
    scaled = None if scale is None else Scales(np.full(n, scale), np.zeros(n), ("",) * n)
    scales = scaled or scales_of(roles, joints, joint_units)
    said: list[str] = []
    begin, end = (
        None if p is None else _joints(name, p, joints, roles, scales, said) if joints else as_point(name, p, "xyz")
        for name, p in (("at", at), ("goal", goal))
    )
    plane = plane_of(() if joints else roles.columns, plane)
    axes = list(PLANES[plane]) if n == 2 and not joints else list(range(n))
    if begin is not None and end is not None and len(axes) < len(end):
        across = ({0, 1, 2} - {*axes}).pop()
        if abs(end[across] - begin[across]) > TRACKED:
            raise SpecificationError(
                f"expected the goal of a movement of two dimensions in the plane of its start, {'xyz'[across]} = "
                f"{begin[across]:g} m, got {end[across]:g}; give both the same, or choose another plane (plane=, "
                "--plane)"
            )
    shown = generate(learned, MovementOptions(duration=duration, rate=rate)).columns["positions"]
    start = shown[0, roles.positions]
    if joints is not None and scale is None and joint_units is None:
        _say_radians(roles.columns, joints)
    origin = start * scales.size + scales.offset if begin is None else begin[axes]
    way = None if end is None else (end[axes] - origin) / scales.size
    if displacement is not None:
        way = as_point("displacement", displacement, [learned.columns[k] for k in roles.positions])
    target = None
    if way is not None:  # positions as asked for, what moves besides as it is demonstrated
        target = shown[-1].copy()
        target[roles.positions] = start + way
        target = target[roles.moving]
    options = MovementOptions(goal=target, duration=duration, rate=rate, meet_goal=target is not None)
    generated = generate(learned, options).columns
    recorded = generated["positions"]
    moved = (recorded[:, roles.positions] - start) * scales.size + origin
    through = end if begin is None else begin
    if through is not None and len(through) > n:
        flat, moved = moved, np.tile(through, (len(moved), 1))  # in the plane through that point
        moved[:, axes] = flat
    if roles.orientation is not None and moved.shape[1] == 3:
        channel, columns = roles.orientation
        moved = np.column_stack((moved, as_wxyz(recorded[:, columns], channel)))
    steps, continuous = (
        {name: recorded[:, column] for name, column in columns.items()}
        for columns in (roles.discrete, roles.continuous)
    )
    return GeneratedMovement(Trajectory(times=generated["times"], positions=moved), steps, continuous, plane, said)


def _joints(name: str, point: ArrayLike, robot: Robot, roles: Roles, scales: Scales, said: list[str]) -> Array:
    """Return a start or goal in the order and the units of the columns as joints [rad, m], and say what it is."""
    order = np.argsort(roles.positions)
    names = [split_head(channel.name)[0] for channel in roles.columns] or robot.joints
    heads = [f"{names[k]} [{scales.units[k]}]" if scales.units[k] else names[k] for k in order]
    values = as_point(name, point, heads)
    said.append(f"{name} is {', '.join(f'{head} {value:g}' for head, value in zip(heads, values, strict=True))}")
    joints = values[np.argsort(order)] * scales.size + scales.offset
    units = f"{name} is in the units of the columns, {', '.join(heads)}"
    remedy = "convert it, or say joint_units= of columns that say none, in the shell --joint-units"
    check_plausible(joints[None], robot, f"{units}; {remedy}")
    return joints


def _say_radians(columns: Sequence[Channel], robot: Robot) -> None:
    """Warn which joints are taken as radians although nothing says their unit.

    Columns with the very names of the joints are what ROS and the URDF have: radians.
    """
    named = [
        channel.name
        for channel, native in zip(columns, robot.units, strict=False)
        if native == "rad" and channel.unit is None and not channel.name.endswith(DRIVERS)
        if channel.name not in robot.joints
    ]
    if named or not columns:
        warn(
            f"{', '.join(named) or 'the joints'} are taken as radians, since nothing says their unit; if they are "
            "degrees, say joint_units='deg', in the shell --joint-units",
            UserWarning,
            3,
        )
