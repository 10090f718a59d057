"""Checks of URDF values that libraries for kinematics would leave out or misread silently, and of their units."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from xml.etree import ElementTree

from kineme.errors import DataError

_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
SIZES = {"box": ("size", 3), "cylinder": ("radius length", 1), "sphere": ("radius", 1)}  # and how many numbers each has

_ORIGIN = {"xyz": 3, "rpy": 3, "quat_xyzw": 4}  # attributes of an <origin>, and how many numbers each has
_ELEMENTS = ("origin", "axis", "limit", "mimic")  # of a joint: one that is misspelt would be left out
_TURNS = 4 * math.pi  # angles beyond are rather degrees [rad]
_UNLIMITED = 1e4  # limits of position from which on they stand for none [rad]
_LONGEST = 20.0  # of an arm: a longer one is rather in millimeters [m]
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)  # Python reads more, as 1_000


def finite_number(text: str) -> float | None:
    """Read a number as every reader of URDF files reads it; None of anything else."""
    value = float(text) if _NUMBER.fullmatch(text.strip(" \t\r\n")) else math.nan
    return value if math.isfinite(value) else None


def finite_numbers(text: str | None, length: int) -> list[float]:
    """Read the finite numbers of an attribute; none of them where there are not as many as expected."""
    values = [value for word in (text or "").split() if (value := finite_number(word)) is not None]
    return values if len(values) == length == len((text or "").split()) else []


def check_origins(robot: ElementTree.Element, path: Path) -> None:
    """Refuse places of joints, masses and collision shapes that readers would leave out or misread."""
    for part in robot:
        if part.tag not in ("joint", "link"):
            continue
        of = f"{path}: {part.tag} {part.get('name')!r}"
        for owner in (part, *part.iterfind("inertial"), *part.iterfind("collision")):
            for element in owner:
                meant = get_close_matches(str(element.tag), _ELEMENTS, 1, 0.7)
                if meant and element.tag != meant[0]:
                    raise DataError(
                        f"{of}: expected <{meant[0]}>, got <{element.tag}>, which readers of URDF leave out"
                    )
            for origin in owner.findall("origin"):
                unread = sorted(origin.attrib.keys() - _ORIGIN.keys())
                if unread:
                    raise DataError(
                        f"{of}: expected <origin xyz= rpy=/>, got {unread[0]}=, which readers of URDF leave out"
                    )
                for name, length in _ORIGIN.items():
                    value = origin.get(name)
                    if value is not None and not finite_numbers(value, length):
                        raise DataError(
                            f"{of}: expected <origin {name}=/> as {length} numbers with spaces between them, got "
                            f"{value!r}"
                        )
                rpy = origin.get("rpy")
                if max(map(abs, finite_numbers(rpy, 3)), default=0.0) > _TURNS:
                    raise DataError(f"{of}: expected <origin rpy=/> in radians, got {rpy!r}; are these degrees?")


def doubts_of(joints: Sequence[ElementTree.Element]) -> list[str]:
    """List doubtful numbers of the joints between root and tip, degrees for radians, millimeters for meters."""
    doubts = []
    for joint in joints:
        limits = joint.findall("limit") if joint.get("type") == "revolute" else []
        values = [finite_number(limit.get(key, "")) or 0.0 for limit in limits for key in ("lower", "upper")]
        if 2 * _TURNS < max(map(abs, values), default=0.0) < _UNLIMITED:
            turns = f"{joint.get('name')} may turn from {values[0]:g} to {values[1]:g} rad"
            doubts.append(f"{turns}: if the file means degrees, write radians")
            break
    origins = [joint.find("origin") for joint in joints]
    length = sum(math.hypot(*finite_numbers(origin.get("xyz"), 3)) for origin in origins if origin is not None)
    if length > _LONGEST:
        doubts.append(f"the arm is {length:g} m long: if the file means millimeters, write meters")
    locked = [str(joint.get("name")) for joint in joints if joint.get("type") in ("floating", "planar")]
    return doubts + [f"{name} can move freely or in a plane: locked, no part of the arm" for name in locked]


def check_masses(robot: ElementTree.Element, path: Path) -> None:
    """Refuse masses and moments of inertia that are no numbers: torques would be checked without them."""
    for link in robot.findall("link"):
        for inertial in link.findall("inertial"):
            mass, inertia = inertial.find("mass"), inertial.find("inertia")
            value = [] if mass is None else finite_numbers(mass.get("value"), 1)
            unread = [name for name in _MOMENTS if inertia is None or not finite_numbers(inertia.get(name), 1)]
            if not value or value[0] < 0 or unread:
                missing = f"; {', '.join(unread)} cannot be read" if unread else ""
                raise DataError(
                    f"{path}: link {link.get('name')!r}: expected <inertial> with <mass value=/>, 0 or more, and "
                    f"<inertia ixx= ixy= ixz= iyy= iyz= izz=/>, all of them finite numbers{missing}"
                )


def check_axis(joint: ElementTree.Element, path: Path) -> None:
    """Refuse a joint that moves about or along no axis."""
    axis = joint.find("axis")
    values = [1.0, 0.0, 0.0] if axis is None else finite_numbers(axis.get("xyz"), 3)
    if not values or not 1e-6 < math.hypot(*values) < 1e6:
        raise DataError(
            f"{path}: joint {joint.get('name')!r}: expected <axis xyz=/> as three numbers that are not all 0, got "
            f"{'none' if axis is None else repr(axis.get('xyz'))}"
        )


def check_shapes(robot: ElementTree.Element, path: Path) -> None:
    """Refuse collision shapes that cannot be read: contacts would be looked for without them."""
    for link in robot.findall("link"):
        for collision in link.findall("collision"):
            shapes = [shape for geometry in collision.findall("geometry") for shape in geometry]
            if len(shapes) == 1 and shapes[0].tag == "mesh" and finite_numbers(shapes[0].get("scale", "1 1 1"), 3):
                continue
            names, length = SIZES.get(shapes[0].tag, ("", 0)) if len(shapes) == 1 else ("", 0)
            sizes = [finite_numbers(shapes[0].get(name), length) for name in names.split()]
            if not sizes or not all(min(values, default=0.0) > 0 for values in sizes):
                named = ", ".join(f"<{shape.tag}>" for shape in shapes) or "nothing"
                raise DataError(
                    f"{path}: link {link.get('name')!r}: expected the <geometry> of a <collision> to be a mesh, or a "
                    f"box, cylinder or sphere with sizes above 0, got {named}"
                )
