"""Roles of the columns of a recording for an arm: positions of its tip or of its joints, or steps."""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import tau
from typing import NamedTuple

import numpy as np

from kineme.errors import TrajectoryError, warn
from kineme.movements.channels.channel import Channel, Channels
from kineme.movements.channels.column_match import are_unknown
from kineme.movements.channels.coordinates import columns_of
from kineme.movements.channels.detect import name_of
from kineme.movements.rotations import NORM_TOLERANCE
from kineme.movements.tables.time_stamps import words_of
from kineme.reporting.text import first_names
from kineme.robots.models.robot import Robot
from kineme.units import split_head, unit_named
from kineme.validation import Array

DRIVERS = ".pos"  # names of LeRobot's drivers end in it: shoulder_pan.pos
#: Words of columns that say how joints move, and not where they are.
_RATES = {"velocity", "velocities", "vel", "acceleration", "accelerations", "acc", "effort", "torque", "current"}
_AXES = "xyz"
_SIDES = ("left", "right")  # what names of two arms begin with
_SIDE = re.compile("(left|right|l|r)(?:arm|joint)?")  # a word of a name that says of which arm it is
_DEGREES = (
    "if these are degrees, say joint_units='deg', if -100..100 of LeRobot, joint_units='percent', in the shell "
    "--joint-units"
)
_Words = tuple[str, ...]

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
    units: tuple[str, ...]  # of the recorded positions; "" if a caller gave the size alone


def roles_of(channels: Channels | None, n_columns: int, space: str, robot: Robot | None = None) -> Roles:
    """Roles of recorded columns, of which nothing but the number is known if they have no channels, or no names.

    Columns with the names of joints are these, others go along; as many of other names are joints in their order.
    Positions of the tip are in the order of the axes that their names say.
    """
    if channels is None or (space == "tip" and are_unknown(channels)):
        posed = space == "tip" and n_columns == 7
        quaternion = Channel("q", "orientation", ("qw", "qx", "qy", "qz"), None, "wxyz")
        positions = list(range(3 if posed else n_columns))
        turned = (quaternion, slice(3, 7)) if posed else None
        return Roles(positions, (), turned, {}, {}, list(range(n_columns)))
    at = list(zip(channels, columns_of(channels), strict=True))
    along = [(channel, columns.start) for channel, columns in at if channel.kind in _KINDS[space]]
    angles = [channel.name for channel in channels if channel.kind == "angle" and space == "tip"]
    if angles:
        raise TrajectoryError(
            f"expected the tip by its position, and turned by a quaternion, got the angles {', '.join(angles)}; "
            "convert them to columns qw, qx, qy, qz or leave them out (columns=, in the shell --columns, --exclude); "
            "of a gripper say --kind gripper=discrete, of joints use robots.move(space='joints'), in the shell --joints"
        )
    orientations = [pair for pair in at if pair[0].kind == "orientation" and space == "tip"]
    if len(orientations) > 1:
        named = ", ".join(channel.name for channel, _ in orientations)
        raise TrajectoryError(f"expected one orientation of the tip, got {named}; read the columns of one of them")
    discrete = {channel.name: columns.start for channel, columns in at if channel.kind == "discrete"}
    moving = [k for channel, columns in at if channel.kind != "discrete" for k in range(columns.start, columns.stop)]
    names = [channel.name for channel, _ in along]
    joints = None if robot is None or space != "joints" else joints_among(names, robot)
    continuous = {}
    if joints is not None:
        if robot is not None and not are_unknown(channels):
            _check_sides([names[k] for k in joints], robot)
            _warn_of_other_names([names[k] for k in joints], robot)
        continuous = {channel.name: column for k, (channel, column) in enumerate(along) if k not in joints}
        along = [along[k] for k in joints]
    elif robot is not None and space == "joints" and len(along) == robot.n_joints:
        check_order(names, robot)
        _check_sides(names, robot)
    elif space == "tip" and len(along) in (2, 3):
        along = [along[k] for k in axis_order(names)]
    return Roles(
        [column for _, column in along],
        tuple(channel for channel, _ in along),
        orientations[0] if orientations else None,
        discrete,
        continuous,
        moving,
    )


def scales_of(roles: Roles, robot: Robot | None, joint_units: str | None = None) -> Scales:
    """Meters and radians of recorded positions: of the tip or, of a given arm, of its joints.

    Units are those of the heads; where these say none, `joint_units` as of `move`. Without it columns that are called
    as LeRobot's drivers call them are in degrees, which is said by a warning, and others in radians and meters.
    """
    n = len(roles.positions)
    size, offset = np.ones(n), np.zeros(n)
    units = ["m"] * n if robot is None else [*robot.units]
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
            units[k] = text
    if guessed:
        warn(
            f"{', '.join(guessed)} are taken as degrees, as LeRobot's drivers give them unless use_degrees is False: "
            "their data set says no unit; say joint_units='deg', or 'percent' of -100..100, in the shell --joint-units",
            UserWarning,
            3,
        )
    return Scales(size, offset, tuple(units))


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
        remedy = "or name its unit in brackets at the end of its head"
        if unit is not None and unit.quantity == "range":
            percent = "say joint_units='percent', in the shell --joint-units"
            remedy = f"or, where it goes from limit to limit of the arm, {percent}"
        raise TrajectoryError(
            f"expected {name!r} in a unit of {quantity} ({_USUAL[quantity]}), got {text!r}; convert the column, "
            f"{remedy}"
        )
    return float(unit.size), 0.0


def check_columns(roles: Roles, joints: Robot | None) -> None:
    """Refuse another number of columns than the arm has joints, or, of its tip, than two or three.

    That the columns of a pose are joints is not advised: they would be executed.
    """
    n = len(roles.positions)
    if joints is not None and n != joints.n_joints:
        raise TrajectoryError(
            f"expected a movement of the {joints.n_joints} joints of {joints.name}, got {n} columns; "
            "choose them with columns=, in the shell --columns, or say which are no joints, --kind gripper=discrete"
        )
    if joints is not None or n in (2, 3):
        return
    names = [channel.name for channel in roles.columns]
    words = {word for name in names for word in words_of(name_of(name))}
    posed = {*_AXES} <= words or words & {"pose", "tcp", "tip"}
    as_joints = "" if posed else ", or say that the columns are the joints (space='joints', --joints)"
    among = f" among {first_names(names, 12)}" if names else ""
    raise TrajectoryError(
        f"expected a movement of the tip, of 2 or 3 dimensions, got {n}{among}; "
        "choose the position (columns=, in the shell --columns), and give the orientation, as a rotation vector or "
        f"angles, as a quaternion in columns qw, qx, qy, qz{as_joints}"
    )


def check_plausible(positions: Array, robot: Robot, remedy: str = _DEGREES) -> None:
    """Refuse joint positions (T, n) [rad, m] that are turns beyond the limits: degrees that are taken for radians."""
    beyond = np.maximum(positions.max(axis=0) - robot.upper, robot.lower - positions.min(axis=0))
    wrong = np.array([unit == "rad" for unit in robot.units]) & (beyond > tau)
    if wrong.any():
        k = int(np.argmax(np.where(wrong, beyond, -np.inf)))
        value = positions[np.argmax(np.abs(positions[:, k])), k]
        raise TrajectoryError(
            f"expected radians between {robot.lower[k]:.4g} and {robot.upper[k]:.4g} of {robot.joints[k]}, got "
            f"{value:.4g}; {remedy}"
        )


def space_of(channels: Channels | None, columns: Array, robot: Robot) -> str:
    """Tell whether recorded columns (T, m) move the joints of this arm or its tip.

    The joints: columns with the names of its joints, as many angles as the arm has joints, or as many columns, of which
    nothing is known and which are neither points nor poses.
    """
    if channels is not None and not are_unknown(channels):
        names = [channel.name for channel in channels if channel.kind in _KINDS["joints"]]
        angles = sum(channel.kind == "angle" for channel in channels)
        return "joints" if joints_among(names, robot) is not None or angles == robot.n_joints else "tip"
    d = columns.shape[1]
    posed = d == 7 and bool(np.all(np.abs(np.linalg.norm(columns[:, 3:], axis=1) - 1) <= NORM_TOLERANCE))
    return "joints" if d == robot.n_joints and d not in (2, 3) and not posed else "tip"


def joints_among(names: Sequence[str], robot: Robot) -> list[int] | None:
    """Find the column of each joint of an arm, by its name; None unless every joint has exactly one.

    Units, features and topics, the ``.pos`` of LeRobot's drivers, and the side of one arm of two are no part of it.
    Without such names, columns with all words of a joint are it, as ``ur5_elbow_joint_position``; or those that differ
    from one another by the same words as the joints, as ``q1``. Names of other joints of the same robot are refused
    then. Columns of velocities and efforts are none.
    """
    names = ["" if _is_rate(name) else name for name in names]
    plain = [split_head(name)[0].removesuffix(DRIVERS) for name in names]
    places = [_places(plain, joint) for joint in robot.joints]
    if (exact := _single(places)) is not None:
        return exact
    if all(places) and {*names} == {names[k] for place in places for k in place}:
        joint, several = max(zip(robot.joints, places, strict=True), key=lambda pair: len(pair[1]))
        raise TrajectoryError(
            f"expected one column for each joint, got {', '.join(names[k] for k in several)} for {joint}; choose with "
            f"columns=, in the shell --columns '{plain[several[0]].removesuffix(joint)}*'"
        )
    sides = {side: _single([_places(plain, f"{side}_{joint}") for joint in robot.joints]) for side in _SIDES}
    sides = {side: columns for side, columns in sides.items() if columns is not None}
    if len(sides) > 1:
        raise TrajectoryError(
            f"expected the joints of one arm, got those of two, {' and '.join(sides)}; choose one with columns=, in "
            f"the shell --columns '{next(iter(sides))}_*'"
        )
    for columns in sides.values():
        return columns
    words, joints = [words_of(name_of(name)) for name in names], list(map(words_of, robot.joints))
    columns = _single(_holding(words, joints)) or _differing(words, joints)
    _check_no_others([plain[k] for k in columns or ()], robot)
    return columns


def axis_order(names: Sequence[str]) -> list[int]:
    """Return the columns in the order x, y, z that their names say, as ``tip_z``; in theirs if these say no axes.

    Raises `TrajectoryError` where names of axes are in another order among others, of which the axis is not known.
    """
    axes = _axes_said(names)
    if all(axes) and len({*axes}) == len(axes):
        return sorted(range(len(axes)), key=axes.__getitem__)
    if any(axis and _AXES.index(axis) < k for k, axis in enumerate(axes)):
        raise TrajectoryError(
            f"expected the positions of the tip as x, y, z or in this order, got {', '.join(names)}; choose them with "
            "columns=, in the shell --columns, or rename them"
        )
    return list(range(len(axes)))


def plane_of(columns: Sequence[Channel], plane: str | None = None) -> str:
    """Return the plane of two positions of the tip, in their order: as given, else as their names say, else "xy".

    Columns x and y may be given any plane, as those of a drawing; beside a z, names of axes mean those of the robot.
    """
    names = [channel.name for channel in columns]
    axes = _axes_said(names)
    taken = plane or ("".join(axes) if len(axes) == 2 and all(axes) else "xy")
    if len(axes) == 2 and "z" in axes and any(said not in ("", axis) for said, axis in zip(axes, taken, strict=True)):
        remedy = "leave plane= away, in the shell --plane," if all(axes) else "say plane=, in the shell --plane,"
        raise TrajectoryError(
            f"expected a plane with the axes that {', '.join(names)} say, got {taken!r}; {remedy} or rename the columns"
        )
    return taken


def _axes_said(names: Sequence[str]) -> list[str]:
    """The axis that each name says, as ``tip_z``, else ""."""
    said = [[word for word in words_of(name_of(name)) if word in {*_AXES}] for name in names]
    return ["".join(words) if len(words) == 1 else "" for words in said]


def check_order(names: Sequence[str], robot: Robot) -> None:
    """Warn that columns of other names are taken as the joints in their order; refuse rates, axes, names of another."""
    rates = list(filter(_is_rate, names))
    if rates:
        raise TrajectoryError(f"expected positions of the joints, got {', '.join(rates)}; choose other columns")
    if {"x", "y"} <= {*_axes_said(names)}:
        raise TrajectoryError(
            f"expected columns with the names of the joints of {robot.name}, {', '.join(robot.joints)}, or without "
            f"axes, got {', '.join(names)}; choose the place of the tip (columns=, in the shell --columns), or rename "
            "them if they are joints"
        )
    _check_no_others([split_head(name)[0].removesuffix(DRIVERS) for name in names], robot)
    words, joints = [words_of(name_of(name)) for name in names], _different(list(map(words_of, robot.joints)))
    listed = ", ".join(names)
    for k, holding in enumerate(_holding(words, joints)):
        if len(holding) == 1 and holding[0] != k and not all(map(str.isdecimal, joints[k])):
            raise TrajectoryError(
                f"expected columns with the names of the joints of {robot.name}, {', '.join(robot.joints)}, in any "
                f"order, or without names in this order, got {listed}; rename the columns"
            )
    numbers = [int(last[-1]) for last in _different(words) if len(last) == 1 and last[-1].isdecimal()]
    if len(numbers) == len(words) and numbers != sorted(numbers):
        raise TrajectoryError(f"expected the joints in the order of their numbers, got {listed}; order the columns")
    warn(f"{listed} are taken as {', '.join(robot.joints)}, one after the other", UserWarning, 4)


def _check_no_others(names: Sequence[str], robot: Robot) -> None:
    """Refuse names of joints of the same robot that are no part of this arm, as those of its other arm."""
    others = [joint for joint in robot.locked if _places(names, joint)]
    if others:
        raise TrajectoryError(
            f"expected the joints {', '.join(robot.joints)}, got {', '.join(others)}, which {robot.name} has besides; "
            "choose the tip that they move (tip=, in the shell --tip), or rename the columns"
        )


def _check_sides(names: Sequence[str], robot: Robot) -> None:
    """Refuse columns, in the order of the joints, whose names say the other arm than those of joints, or of the tip."""
    for name, joint in zip(names, robot.joints, strict=True):
        said, meant = _side_said(name), _side_said(joint) or _side_said(robot.tip)
        if said and meant and said != meant:
            raise TrajectoryError(
                f"expected a recording of the {meant} arm, as {joint} and the tip {robot.tip} say, got {name}, of the "
                f"{said} one; choose the tip of that arm (tip=, in the shell --tip), other columns, or rename them"
            )


def _side_said(name: str) -> str:
    """The side that words of a name say, spelled out or, where none is, by its letter; "" of none, and of both."""
    said = [match[1] for word in words_of(split_head(name)[0]) if (match := _SIDE.fullmatch(word))]
    sides = {side for side in said if side in _SIDES} or {side for side in _SIDES for word in said if word == side[0]}
    return sides.pop() if len(sides) == 1 else ""


def _warn_of_other_names(names: Sequence[str], robot: Robot) -> None:
    """Warn that columns, in the order of the joints, have words of another arm in place of those of this one."""
    pairs = [({*words_of(name_of(name))}, {*words_of(joint)}) for name, joint in zip(names, robot.joints, strict=True)]
    if any(max(map(len, words - joint), default=0) > 1 and joint - words - {"joint"} for words, joint in pairs):
        warn(f"{', '.join(names)} are taken as {', '.join(robot.joints)}, one after the other", UserWarning, 4)


def _is_rate(name: str) -> bool:
    return not _RATES.isdisjoint(words_of(name))


def _places(names: Sequence[str], joint: str) -> list[int]:
    return [k for k, name in enumerate(names) if name == joint or name.endswith((f".{joint}", f"/{joint}"))]


def _single(places: Sequence[list[int]]) -> list[int] | None:
    """The column of each joint, if every joint has one and no two the same."""
    columns = [place[0] for place in places if len(place) == 1]
    return columns if len({*columns}) == len(places) else None


def _holding(columns: Sequence[_Words], joints: Sequence[_Words]) -> list[list[int]]:
    """For each joint the columns in which its words stand side by side, and those of no joint with more words."""
    held = [max((len(joint) for joint in joints if _stand_in(joint, column)), default=0) for column in columns]
    return [
        [k for k, column in enumerate(columns) if held[k] == len(joint) and _stand_in(joint, column)]
        for joint in joints
    ]


def _stand_in(words: _Words, column: _Words) -> bool:
    n = len(words)
    return n > 0 and any(column[k : k + n] == words for k in range(len(column) - n + 1))


def _differing(columns: Sequence[_Words], joints: Sequence[_Words]) -> list[int] | None:
    """The column of each joint, if columns differ from one another by the same words as the joints."""
    ours, theirs = _different(columns), _different(joints)
    return [ours.index(words) for words in theirs] if len(joints) > 1 and sorted(ours) == sorted(theirs) else None


def _different(names: Sequence[_Words]) -> list[_Words]:
    """Return what is left of each name without the words with which all begin, and those in which all end."""
    shortest = min(map(len, names))
    first = next((k for k in range(shortest) if len({words[k] for words in names}) > 1), shortest)
    last = next((k for k in range(shortest - first) if len({words[-1 - k] for words in names}) > 1), shortest - first)
    return [words[first : len(words) - last] for words in names]
