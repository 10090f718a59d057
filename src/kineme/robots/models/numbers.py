"""What of a URDF a library for kinematics would leave out or misread without a word."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree

from kineme.errors import DataError

_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_SIZES = {"box": ("size", 3), "cylinder": ("radius length", 1), "sphere": ("radius", 1)}


def finite_numbers(text: str | None, length: int) -> list[float]:
    """The finite numbers of an attribute; none of them where there are not as many as expected."""
    try:
        values = [float(word) for word in (text or "").split()]
    except ValueError:
        return []
    return values if len(values) == length and all(map(math.isfinite, values)) else []


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
            moments = [] if inertia is None else [finite_numbers(inertia.get(name, "0"), 1) for name in _MOMENTS]
            if not value or value[0] < 0 or not all(moments) or not moments:
                raise DataError(
                    f"{path}: link {link.get('name')!r}: expected <inertial> with <mass value=/>, 0 or more, and "
                    "<inertia ixx= .../>, all of them finite numbers"
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
            shape = next(iter(collision.find("geometry") or ()), None)
            if shape is None or not (shape.tag == "mesh" or _has_size(shape)):
                raise DataError(
                    f"{path}: link {link.get('name')!r}: expected the <geometry> of a <collision> to be a mesh, or a "
                    "box, cylinder or sphere with sizes above 0"
                )


def _has_size(shape: ElementTree.Element) -> bool:
    names, length = _SIZES.get(shape.tag, ("", 0))
    return bool(names) and all(min(finite_numbers(shape.get(name), length), default=0.0) > 0 for name in names.split())
