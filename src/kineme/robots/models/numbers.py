"""What of a URDF a library for kinematics would leave out or misread without a word."""

from __future__ import annotations

import math
import re
from pathlib import Path
from xml.etree import ElementTree

from kineme.errors import DataError

_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_SIZES = {"box": ("size", 3), "cylinder": ("radius length", 1), "sphere": ("radius", 1)}


_ORIGIN = {"xyz": 3, "rpy": 3, "quat_xyzw": 4}  # attributes of an <origin>, and how many numbers each has
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)  # Python reads more, as 1_000


def finite_number(text: str) -> float | None:
    """A number as every reader of URDF files reads it; None of anything else."""
    value = float(text) if _NUMBER.fullmatch(text.strip(" \t\r\n")) else math.nan
    return value if math.isfinite(value) else None


def finite_numbers(text: str | None, length: int) -> list[float]:
    """The finite numbers of an attribute; none of them where there are not as many as expected."""
    values = [value for word in (text or "").split() if (value := finite_number(word)) is not None]
    return values if len(values) == length == len((text or "").split()) else []


def check_origins(robot: ElementTree.Element, path: Path) -> None:
    """Refuse places of joints, masses and collision shapes that are no numbers: readers leave out what has one.

    Raises
    ------
    DataError
        The first such <origin>, with the joint or link.
    """
    for part in robot:
        origins = [*part.findall("origin"), *part.iterfind("inertial/origin"), *part.iterfind("collision/origin")]
        for origin in origins if part.tag in ("joint", "link") else ():
            for name, length in _ORIGIN.items():
                if name in origin.attrib and not finite_numbers(origin.get(name), length):
                    raise DataError(
                        f"{path}: {part.tag} {part.get('name')!r}: expected <origin {name}=/> as {length} numbers with "
                        f"spaces between them, got {origin.get(name)!r}"
                    )


def check_masses(robot: ElementTree.Element, path: Path) -> None:
    """Refuse masses and moments of inertia that are no numbers: torques would be checked without them.

    Raises
    ------
    DataError
        The first link with such a number.
    """
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
    """Refuse a joint that moves about or along no axis.

    Raises
    ------
    DataError
        An axis of length 0, or of other than three finite numbers.
    """
    axis = joint.find("axis")
    values = [1.0, 0.0, 0.0] if axis is None else finite_numbers(axis.get("xyz", "1 0 0"), 3)
    if not values or not 1e-6 < math.hypot(*values) < 1e6:
        raise DataError(
            f"{path}: joint {joint.get('name')!r}: expected <axis xyz=/> as three numbers that are not all 0, got "
            f"{'none' if axis is None else repr(axis.get('xyz'))}"
        )


def check_shapes(robot: ElementTree.Element, path: Path) -> None:
    """Refuse collision shapes that cannot be read: contacts would be looked for without them.

    Raises
    ------
    DataError
        The first link with another shape than a mesh, or a box, cylinder or sphere larger than nothing.
    """
    for link in robot.findall("link"):
        for collision in link.findall("collision"):
            shapes = [shape for geometry in collision.findall("geometry") for shape in geometry]
            if len(shapes) != 1 or not (_is_mesh(shapes[0]) or _has_size(shapes[0])):
                found = ", ".join(f"<{shape.tag}>" for shape in shapes) or "nothing"
                raise DataError(
                    f"{path}: link {link.get('name')!r}: expected the <geometry> of a <collision> to be a mesh, or a "
                    f"box, cylinder or sphere with sizes above 0, got {found}"
                )


def _is_mesh(shape: ElementTree.Element) -> bool:
    return shape.tag == "mesh" and bool(finite_numbers(shape.get("scale", "1 1 1"), 3))


def _has_size(shape: ElementTree.Element) -> bool:
    names, length = _SIZES.get(shape.tag, ("", 0))
    return bool(names) and all(min(finite_numbers(shape.get(name), length), default=0.0) > 0 for name in names.split())
