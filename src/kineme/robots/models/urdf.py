"""What a URDF file says about an arm, checked before a library for kinematics reads it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from kineme.errors import DataError
from kineme.robots.models.ends import MOVING, Candidate, Ends, in_words
from kineme.robots.models.numbers import check_axis, check_masses, check_origins, check_shapes, doubts_of, finite_number

_PREFIXES = ("package://", "model://", "file://")

_NAMES = ("http://www.ros.org/wiki/xacro", "http://wiki.ros.org/xacro", "http://ros.org/wiki/xacro")

_LARGEST = 20_000_000  # bytes
_TWIN = " link"  # is added to the name of a link that a joint has too
_DECLARED = b"<!DOCTYPE"  # declares entities: other files, or texts that grow
_LEAST = 1e-9  # velocity, acceleration or effort that is a limit and no rounding error
_TURNS = 2 * math.pi  # a joint without stops is kept within one turn to each side


class JointLimits(NamedTuple):
    """Limits of one joint; nan where the file does not say."""

    lower: float  # [rad] or [m]
    upper: float
    velocity: float  # per second
    acceleration: float  # per second squared
    effort: float  # [Nm] or [N]


class Chain(NamedTuple):
    """The joints between the root of a robot and the frame that follows the movement."""

    text: str  # the URDF, joints without stops given those of one turn
    joints: tuple[str, ...]
    units: tuple[str, ...]  # rad, or m of joints that slide
    limits: tuple[JointLimits, ...]
    tip: str
    without_stops: tuple[str, ...]  # joints that the file calls continuous
    without_shape: tuple[str, ...]  # links whose meshes are not there
    gripper: tuple[str, ...]  # joints of grippers, fingers and hands, which are locked
    others: tuple[Candidate, ...]  # links that might be the tip as well; none if the tip was given
    doubts: tuple[str, ...]  # sentences about numbers that may be in other units


def read_chain(path: Path, tip: str | None) -> Chain:
    """The chain from the root of the URDF at `path` to the frame `tip`, by default the end of the longest chain.

    Joints of grippers and hands are no part of it.

    Raises
    ------
    DataError
        No such file, no URDF, a tip that does not exist, several chains as long and no tip, a joint without limits or
        with a mimic joint in the chain, masses or shapes that cannot be read; each with the name of the joint or link.
    """
    robot = read_root(path)
    parents = _joints_above(robot, path)
    links = [str(link.get("name")) for link in robot.findall("link")]
    ends = Ends(links, parents)
    candidates = ends.candidates()
    others = tuple(candidates[1:]) if tip is None else ()
    tip = _tip(tip, links, candidates, path)
    above = _above(tip, parents)
    moving = [joint for joint in above if joint.get("type") in MOVING]
    moving = [joint for joint in moving if joint.get("name") not in ends.gripper]
    if not moving:
        raise DataError(f"{path}: expected at least one joint that moves between the root and {tip!r}, found none")
    doubts = tuple(doubts_of(above))
    free = tuple(str(joint.get("name")) for joint in moving if joint.get("type") == "continuous")
    limits = tuple(_limits(joint, path) for joint in moving)
    check_masses(robot, path)
    check_shapes(robot, path)
    check_origins(robot, path)
    missing = tuple(dict.fromkeys(resolve_meshes(robot, path)))
    joints = tuple(str(joint.get("name")) for joint in moving)
    units = tuple("m" if joint.get("type") == "prismatic" else "rad" for joint in moving)
    gripper = tuple(str(joint.get("name")) for joint in robot.findall("joint") if joint.get("name") in ends.gripper)
    return Chain(_as_text(robot, path), joints, units, limits, tip, free, missing, gripper, others, doubts)


def _joints_above(robot: ElementTree.Element, path: Path) -> dict[str, ElementTree.Element]:
    """The joint above each link that has one."""
    parents: dict[str, ElementTree.Element] = {}
    for joint in robot.findall("joint"):
        _end(joint, "parent", path)
        child = _end(joint, "child", path)
        if child in parents:
            raise DataError(
                f"{path}: link {child!r} is the child of {parents[child].get('name')!r} and of {joint.get('name')!r}; "
                "a URDF is a tree"
            )
        parents[child] = joint
    return parents


def _above(tip: str, parents: dict[str, ElementTree.Element]) -> list[ElementTree.Element]:
    """The joints between the root and a link."""
    chain, link = [], tip
    while link in parents:
        chain.append(parents[link])
        link = str(parents[link].find("parent").get("link"))  # type: ignore[union-attr] # looked at before
    return chain[::-1]


def _as_text(robot: ElementTree.Element, path: Path) -> str:
    try:
        return ElementTree.tostring(robot, "unicode")
    except RecursionError as error:
        raise DataError(f"{path}: expected a URDF file, got elements within one another without end") from error


def read_root(path: Path) -> ElementTree.Element:
    """The root of a URDF file, in which no link is called like a joint; of a xacro file, what it is converted to.

    Raises
    ------
    DataError
        No such file, one of more than 20 MB, no XML, or XML that is no URDF; xacro without the package of that name.
    """
    try:
        if path.stat().st_size > _LARGEST:
            raise DataError(f"{path}: expected a URDF of at most {_LARGEST / 1e6:.0f} MB, got {path.stat().st_size:,}")
        text = path.read_bytes()
        robot = None if _DECLARED in text else ElementTree.fromstring(text)
    except OSError as error:
        raise DataError(f"{path}: expected a URDF file, got {error.strerror or error}") from error
    except (ElementTree.ParseError, ValueError) as error:
        raise DataError(f"{path}: expected a URDF file, got text that is no XML: {error}") from error
    if robot is None:
        raise DataError(
            f"{path}: expected a URDF file, got text that is no XML of a robot: it declares a document type"
        )
    if has_macros(robot):
        robot = without_macros(path)
    if robot.tag != "robot":
        raise DataError(f"{path}: expected a URDF, whose root is <robot>, got <{robot.tag}>")
    _name_apart(robot)
    return robot


def _name_apart(robot: ElementTree.Element) -> None:
    """Give links that are called like a joint another name, in place: frames of the model are known by their names."""
    joints = {joint.get("name") for joint in robot.findall("joint")}
    for link in robot.findall("link"):
        name = link.get("name")
        if name in joints:
            link.set("name", f"{name}{_TWIN}")
            for end in robot.iterfind("joint/*[@link]"):
                if end.get("link") == name:
                    end.set("link", f"{name}{_TWIN}")


def _end(joint: ElementTree.Element, which: str, path: Path) -> str:
    end = joint.find(which)
    if end is None or not end.get("link"):
        raise DataError(f"{path}: joint {joint.get('name')!r} has no <{which} link=...>")
    return str(end.get("link"))


def _tip(tip: str | None, links: list[str], candidates: list[Candidate], path: Path) -> str:
    """The link that is asked for, else the end of the longest chain if one is longer than all others."""
    if tip is not None:
        tip = f"{tip}{_TWIN}" if tip not in links and f"{tip}{_TWIN}" in links else tip
        if tip not in links:
            from difflib import get_close_matches

            alike = get_close_matches(tip, links, 3)
            listed = f"{', '.join(map(repr, alike))}, ..." if alike else in_words(candidates)
            raise DataError(f"{path}: has no link {tip!r} to be the tip; there are {listed}")
        return tip
    if not candidates:
        raise DataError(f"{path}: expected a robot with at least one joint that moves, found none")
    if len(candidates) > 1 and candidates[0].n_joints == candidates[1].n_joints:
        raise DataError(
            f"{path}: expected a tip, as the robot ends in {len(candidates)} links: {in_words(candidates)}; "
            "say which one follows the movement (tip=..., --tip)"
        )
    return candidates[0].link


def _limits(joint: ElementTree.Element, path: Path) -> JointLimits:
    """The limits of a joint; one without stops becomes a joint with those of one turn to each side, in place."""
    name = joint.get("name")
    if not name:
        raise DataError(f"{path}: expected a name of each joint that moves, got one without")
    check_axis(joint, path)
    if joint.find("mimic") is not None:
        raise DataError(
            f"{path}: joint {name!r} mimics another one, which is not known within an arm; "
            f"choose a tip before it, as {_end(joint, 'parent', path)!r} (tip=..., --tip)"
        )
    limit = joint.find("limit")
    if joint.get("type") == "continuous":
        limit = ElementTree.SubElement(joint, "limit") if limit is None else limit
        joint.set("type", "revolute")
        limit.set("lower", f"{-_TURNS}")
        limit.set("upper", f"{_TURNS}")
        limit.set("velocity", limit.get("velocity", "0"))
        limit.set("effort", limit.get("effort", "0"))
    if limit is None or limit.get("lower") is None or limit.get("upper") is None:
        raise DataError(f"{path}: joint {name!r} has no limits; add <limit lower= upper= velocity= effort=/> to it")
    found = JointLimits(*(_number(limit, key, joint, path) for key in JointLimits._fields))
    if not found.lower < found.upper:
        raise DataError(f"{path}: joint {name!r}: expected lower < upper, got {found.lower:g} and {found.upper:g}")
    for key in ("velocity", "effort"):
        limit.set(key, limit.get(key, "0"))
    known = {key: getattr(found, key) for key in ("velocity", "acceleration", "effort")}
    if any(0 < value < _LEAST for value in known.values()):
        raise DataError(f"{path}: joint {name!r}: expected limits of at least {_LEAST:g}, got {known}")
    return found._replace(**{key: value if value > 0 else math.nan for key, value in known.items()})


def _number(limit: ElementTree.Element, key: str, joint: ElementTree.Element, path: Path) -> float:
    text = limit.get(key)
    value = math.nan if text is None else finite_number(text)
    if value is None:
        raise DataError(f"{path}: joint {joint.get('name')!r}: expected a number for {key}, got {text!r}")
    return value


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


def resolve_meshes(robot: ElementTree.Element, path: Path) -> list[str]:
    """Write the path of each collision mesh into the tree, and remove those that are not there; links without shape.

    ``package://NAME/...`` is looked for in every folder above the URDF, as ROS packages lie beside one another.
    """
    missing = []
    for link in robot.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)  # nothing here looks at it, and its meshes need not be there
        for collision in link.findall("collision"):
            mesh = collision.find("geometry/mesh")
            if mesh is None:
                continue
            found = find_mesh(mesh.get("filename", ""), path)
            if found is None:
                link.remove(collision)
                missing.append(str(link.get("name")))
            else:
                mesh.set("filename", str(found))
    return missing


def find_mesh(name: str, path: Path) -> Path | None:
    """Where the mesh lies that the URDF at `path` calls `name`; None where it is not there."""
    within = next((name.removeprefix(prefix) for prefix in _PREFIXES if name.startswith(prefix)), name)
    folders = path.resolve().parents
    try:
        return next((folder / within for folder in folders if within and (folder / within).is_file()), None)
    except (OSError, ValueError):  # as a name that is too long
        return None
