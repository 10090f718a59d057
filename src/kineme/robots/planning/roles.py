"""What an arm does with each column of a recording: its tip goes there, its joints do, or it is a step."""

from __future__ import annotations

from math import tau
from typing import NamedTuple

import numpy as np

from kineme.errors import TrajectoryError, warn
from kineme.movements.channels.channel import Channel, Channels
from kineme.movements.channels.coordinates import columns_of
from kineme.movements.rotations.quaternions import NORM_TOLERANCE
from kineme.robots.models.robot import Robot
from kineme.robots.planning.joint_names import DRIVERS, check_order, joints_among
from kineme.units import unit_named
from kineme.validation import Array

SPACES = ("auto", "tip", "joints")
#: What a caller may say of joints whose unit the file does not say -> that unit.
JOINT_UNITS = {"deg": "deg", "rad": "rad", "percent": "-100..100"}
_USUAL = {"length": "m, cm, mm, in, ft", "angle": "rad, deg"}
_KINDS = {"tip": ("position",), "joints": ("angle", "position")}


class Roles(NamedTuple):
    """Columns of a recording by what an arm does with them."""

    positions: list[int]  # of the tip, or of the joints
    columns: tuple[Channel, ...]  # of `positions`; empty if nothing is known of them
    orientation: tuple[Channel, slice] | None  # of the tip
    discrete: dict[str, int]  # name -> column
    continuous: dict[str, int]  # the same of what moves and is no joint, beside joints that are known by their names
    moving: list[int]  # all but the discrete ones


class Scales(NamedTuple):
    """Recorded positions in meters and radians: size times value plus offset."""

    size: Array  # (n,)
    offset: Array  # (n,)


def roles_of(channels: Channels | None, n_columns: int, space: str, robot: Robot | None = None) -> Roles:
    """Roles of recorded columns, of which nothing but the number is known if they have no channels.

    Columns with the names of the joints of the arm are these joints, in its order; the others, as of a gripper, go
    along. As many columns of other names are the joints one after the other, which a warning says.

    Raises
    ------
    TrajectoryError
        Several orientations of the tip, or angles beside its position; names of joints at the places of others.
    """
    if channels is None:
        posed = space == "tip" and n_columns == 7
        quaternion = Channel("q", "orientation", ("qw", "qx", "qy", "qz"), None, "wxyz")
        positions = list(range(3 if posed else n_columns))
        turned = (quaternion, slice(3, 7)) if posed else None
        return Roles(positions, (), turned, {}, {}, list(range(n_columns)))
    at = list(zip(channels, columns_of(channels), strict=True))
    along = [(one, columns.start) for one, columns in at if one.kind in _KINDS[space]]
    angles = [one.name for one in channels if one.kind == "angle" and space == "tip"]
    if angles:
        raise TrajectoryError(
            f"expected the tip by its position, and turned by a quaternion, got the angles {', '.join(angles)}; "
            "convert them to columns qw, qx, qy, qz or leave them out (columns=, in the shell --columns, --exclude); "
            "of a gripper say --kind gripper=discrete, of joints --joints"
        )
    orientations = [(one, columns) for one, columns in at if one.kind == "orientation" and space == "tip"]
    if len(orientations) > 1:
        named = ", ".join(one.name for one, _ in orientations)
        raise TrajectoryError(f"expected one orientation of the tip, got {named}; read the columns of one of them")
    discrete = {one.name: columns.start for one, columns in at if one.kind == "discrete"}
    moving = [k for one, columns in at if one.kind != "discrete" for k in range(columns.start, columns.stop)]
    joints = None if robot is None or space != "joints" else joints_among([one.name for one, _ in along], robot)
    continuous = {}
    if joints is not None:
        continuous = {one.name: column for k, (one, column) in enumerate(along) if k not in joints}
        along = [along[k] for k in joints]
    elif robot is not None and space == "joints" and len(along) == robot.n_joints:
        check_order([one.name for one, _ in along], robot)
    return Roles(
        [column for _, column in along],
        tuple(one for one, _ in along),
        orientations[0] if orientations else None,
        discrete,
        continuous,
        moving,
    )


def scales_of(roles: Roles, robot: Robot | None, joint_units: str | None = None) -> Scales:
    """Meters and radians of recorded positions: of the tip or, of a given arm, of its joints.

    Units are those of the heads. Where these say none, joints have `joint_units`: "deg", "rad", or "percent", which is
    -100 to 100 between the limits of each joint, as LeRobot's drivers normalize to their calibration. Without it
    columns that are called as LeRobot's drivers call them are in degrees, which is said by a warning; others are in
    radians and meters, and so are positions of the tip.

    Raises
    ------
    TrajectoryError
        A unit of another quantity, or that is not in the table of units; `joint_units` beside another unit in the head.
    """
    n = len(roles.positions)
    size, offset = np.ones(n), np.zeros(n)
    units = ("m",) * n if robot is None else robot.units
    guessed = []
    for k, (channel, native) in enumerate(zip(roles.columns or (None,) * n, units, strict=False)):
        name, text = (f"column {k}", None) if channel is None else (channel.name, channel.unit)
        if robot is not None and joint_units is not None and (native == "rad" or joint_units == "percent"):
            text = text or JOINT_UNITS[joint_units]
            unit = unit_named(text)
            if unit is None or joint_units != ("percent" if unit.quantity == "range" else unit.symbol):
                raise TrajectoryError(
                    f"expected joint_units={joint_units!r} of joints whose columns say no other unit, got {name!r}; "
                    "leave joint_units away, in the shell --joint-units"
                )
        elif text is None and robot is not None and native == "rad" and name.endswith(DRIVERS):
            guessed.append(name)
            text = "deg"
        if text is not None:
            ranged = robot if joint_units == "percent" else None
            size[k], offset[k] = _scale(name, text, native, ranged, k)
    if guessed:
        warn(
            f"{', '.join(guessed)} are taken as degrees, as LeRobot's drivers give them unless use_degrees is False: "
            "their data set says no unit; say joint_units='deg', or 'percent' of -100..100, in the shell --joint-units",
            UserWarning,
            3,
        )
    return Scales(size, offset)


def _scale(name: str, text: str, native: str, robot: Robot | None, k: int) -> tuple[float, float]:
    """Size and offset of one column in a unit; of an arm, between the limits of whose joint k a range is, if given."""
    unit = unit_named(text)
    quantity = "angle" if native == "rad" else "length"
    if unit is not None and unit.quantity == "range" and robot is not None:
        extent = float(robot.upper[k] - robot.lower[k])
        if not np.isfinite(extent):
            raise TrajectoryError(f"expected limits of {robot.joints[k]} for {name!r} in {text}, got none; convert it")
        size = float(unit.size) * extent
        return size, float(robot.lower[k]) - unit.zero * size
    if unit is None or unit.quantity != quantity:
        is_range = unit is not None and unit.quantity == "range"
        remedy = (
            "or, where it goes from limit to limit of the arm, say joint_units='percent', in the shell --joint-units"
        )
        raise TrajectoryError(
            f"expected {name!r} in a unit of {quantity} ({_USUAL[quantity]}), got {text!r}; convert the column, "
            f"{remedy if is_range else 'or name its unit in brackets at the end of its head'}"
        )
    return float(unit.size), 0.0


def check_plausible(positions: Array, robot: Robot) -> None:
    """Refuse joint positions (T, n) [rad, m] that are turns beyond the limits: degrees that are taken for radians.

    Raises
    ------
    TrajectoryError
        The message names the option for units of joints.
    """
    beyond = np.maximum(positions.max(axis=0) - robot.upper, robot.lower - positions.min(axis=0))
    wrong = np.array([unit == "rad" for unit in robot.units]) & (beyond > tau)
    if wrong.any():
        k = int(np.argmax(np.where(wrong, beyond, -np.inf)))
        value = positions[np.argmax(np.abs(positions[:, k])), k]
        raise TrajectoryError(
            f"expected radians between {robot.lower[k]:.4g} and {robot.upper[k]:.4g} of {robot.joints[k]}, got "
            f"{value:.4g}; "
            "if these are degrees, say joint_units='deg', if -100..100 of LeRobot, joint_units='percent', in the shell "
            "--joint-units"
        )


def space_of(channels: Channels | None, columns: Array, robot: Robot) -> str:
    """Whether recorded columns (T, m) move the joints of this arm or its tip.

    The joints: columns with the names of its joints, as many angles as the arm has joints, or as many columns, of which
    nothing is known and which are neither points nor poses.
    """
    if channels is not None:
        angles = sum(one.kind == "angle" for one in channels)
        named = joints_among([one.name for one in channels if one.kind in _KINDS["joints"]], robot) is not None
        return "joints" if named or angles == robot.n_joints else "tip"
    d = columns.shape[1]
    posed = d == 7 and bool(np.all(np.abs(np.linalg.norm(columns[:, 3:], axis=1) - 1) <= NORM_TOLERANCE))
    return "joints" if d == robot.n_joints and d not in (2, 3) and not posed else "tip"
