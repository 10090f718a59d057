"""URDF files that are still templates: xacro, which its own package converts where it is installed."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from kineme.errors import DataError

_NAMES = ("http://www.ros.org/wiki/xacro", "http://wiki.ros.org/xacro", "http://ros.org/wiki/xacro")


def has_macros(robot: ElementTree.Element) -> bool:
    """Whether the tree has elements of xacro, which a URDF has no more."""
    return any(element.tag.startswith(tuple(f"{{{name}}}" for name in _NAMES)) for element in robot.iter())


def without_macros(path: Path) -> ElementTree.Element:
    """The root of the URDF that a xacro file is converted to, with the defaults of its arguments.

    Raises
    ------
    DataError
        The package ``xacro`` is not installed, or it cannot convert the file.
    """
    remedy = f"xacro {path.name} > {path.name.split('.')[0]}_converted.urdf"
    try:
        import xacro
    except ImportError as error:
        raise DataError(
            f"{path}: expected a URDF file, got xacro, a template of one; pip install xacro, or convert it where its "
            f"packages are: {remedy}"
        ) from error
    try:
        return ElementTree.fromstring(xacro.process_file(str(path)).toxml())
    except Exception as error:  # of any kind: expressions and files of a template, and packages that are not here
        reason = " ".join(str(error).split()) or type(error).__name__
        raise DataError(
            f"{path}: xacro cannot convert this file: {reason:.300}; convert it where its packages are: {remedy}"
        ) from error
