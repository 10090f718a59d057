"""What an arm does with each column of a recording: its tip goes there, its joints do, or it is a step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kineme.errors import TrajectoryError
from kineme.movements.channels.channel import Channel, Channels
from kineme.movements.channels.coordinates import columns_of
from kineme.movements.rotations.quaternions import NORM_TOLERANCE
from kineme.robots.models.robot import Robot
from kineme.units import unit_named
from kineme.validation import Array

SPACES = ("auto", "tip", "joints")
_USUAL = {"length": "m, cm, mm, in, ft", "angle": "rad, deg"}
_KINDS = {"tip": ("position",), "joints": ("angle", "position")}


class Roles(NamedTuple):
    """Columns of a recording by what an arm does with them."""

    positions: list[int]  # of the tip, or of the joints
    columns: tuple[Channel, ...]  # of `positions`; empty if nothing is known of them
    orientation: tuple[Channel, slice] | None  # of the tip
    discrete: dict[str, int]  # name -> column
    moving: list[int]  # all but the discrete ones


def roles_of(channels: Channels | None, n_columns: int, space: str) -> Roles:
    """Roles of recorded columns, of which nothing but the number is known if they have no channels.

    Raises
    ------
    TrajectoryError
        Several orientations of the tip.
    """
    if channels is None:
        posed = space == "tip" and n_columns == 7
        quaternion = Channel("q", "orientation", ("qw", "qx", "qy", "qz"), None, "wxyz")
        positions = list(range(3 if posed else n_columns))
        turned = (quaternion, slice(3, 7)) if posed else None
        return Roles(positions, (), turned, {}, list(range(n_columns)))
    at = list(zip(channels, columns_of(channels), strict=True))
    along = [(one, columns.start) for one, columns in at if one.kind in _KINDS[space]]
    orientations = [(one, columns) for one, columns in at if one.kind == "orientation" and space == "tip"]
    if len(orientations) > 1:
        named = ", ".join(one.name for one, _ in orientations)
        raise TrajectoryError(f"expected one orientation of the tip, got {named}; read the columns of one of them")
    return Roles(
        [column for _, column in along],
        tuple(one for one, _ in along),
        orientations[0] if orientations else None,
        {one.name: columns.start for one, columns in at if one.kind == "discrete"},
        [k for one, columns in at if one.kind != "discrete" for k in range(columns.start, columns.stop)],
    )


def sizes_of(roles: Roles, quantities: Sequence[Sequence[str]]) -> Array:
    """Meters or radians for one unit of each position, (len(positions),); 1 where a file does not say its unit.

    Parameters
    ----------
    roles : Roles
    quantities : sequence of len(positions) sequences of {"length", "angle"}
        What each of them may measure.

    Raises
    ------
    TrajectoryError
        A unit that is none of these quantities, or that is not in the table of units.
    """
    sizes = np.ones(len(roles.positions))
    for k, (channel, allowed) in enumerate(zip(roles.columns, quantities, strict=False)):
        if channel.unit is None:
            continue
        unit = unit_named(channel.unit)
        if unit is None or unit.quantity not in allowed:
            known = ", ".join(_USUAL[quantity] for quantity in allowed)
            raise TrajectoryError(
                f"expected {channel.name!r} in a unit of {' or '.join(allowed)} ({known}), got {channel.unit!r}; "
                "convert the column, or name its unit in brackets at the end of its head"
            )
        sizes[k] = float(unit.size)
    return sizes


def space_of(channels: Channels | None, columns: Array, robot: Robot) -> str:
    """Whether recorded columns (T, m) move the joints of this arm or its tip.

    The joints: as many angles as the arm has joints, columns with the names of its joints, or as many columns, of which
    nothing is known and which are neither points nor poses.
    """
    if channels is not None:
        angles = sum(one.kind == "angle" for one in channels)
        named = [one.name for one in channels if one.kind in _KINDS["joints"]] == list(robot.joints)
        return "joints" if named or angles == robot.n_joints else "tip"
    d = columns.shape[1]
    posed = d == 7 and bool(np.all(np.abs(np.linalg.norm(columns[:, 3:], axis=1) - 1) <= NORM_TOLERANCE))
    return "joints" if d == robot.n_joints and d not in (2, 3) and not posed else "tip"
