"""URDF files of arms, checked before a library for kinematics reads them: joints, limits, meshes, grippers, the tip."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from kineme.errors import DataError
from kineme.reporting.text import first_names
from kineme.robots.models.numbers import check_axis, check_masses, check_origins, check_shapes, doubts_of, finite_number

#: Types of joints that move.
MOVING = ("revolute", "continuous", "prismatic")
LISTED = 8  # links that a message names
_DIGITS = re.compile(r"finger|thumb|knuckle|jaw|claw", re.IGNORECASE)  # in the name of a joint, or of the link it moves
_GRIPPER = re.compile(r"gripper|hand.*(index|middle|ring|little|pinky|mrl)", re.IGNORECASE)  # in the name of a joint
_WRIST = re.compile(r"wrist|roll|pitch|yaw|rotat|swivel", re.IGNORECASE)  # turns the gripper, and is no part of it
_SENSOR = re.compile(
    r"camera|optical|lens|depth|imu|laser|lidar|sensor|sonar|accelerom|gyro|collision|inertia", re.IGNORECASE
)
# Names of tips, the surest first: words between underscores, dashes, dots or slashes.
_TIPS = [
    re.compile(rf"(^|[_\-./])({words})($|[_\-./])", re.IGNORECASE)
    for words in (
        "tcp|tool_center_point",
        "tool0",
        "ee|eef|end_?effector",
        "tool|tool_frame|tool_link|gripper_frame|grasping_frame",
        "flange|hand|palm|gripper|tip",
    )
]

_PREFIXES = ("package://", "model://", "file://")

#: How tags of xacro begin, which a URDF has no more.
_XACRO = ("{http://www.ros.org/wiki/xacro}", "{http://wiki.ros.org/xacro}", "{http://ros.org/wiki/xacro}")

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
    """Read the chain from the root of a URDF to the frame `tip`, by default the end of the longest chain of the arm."""
    robot = read_root(path)
    links = _names(robot.findall("link"))
    parents: dict[str, ElementTree.Element] = {}  # the joint above each link that has one
    below: dict[str, list[str]] = {link: [] for link in links}
    for joint in robot.findall("joint"):
        parent, child = (_end(joint, which, path) for which in ("parent", "child"))
        if lost := {parent, child} - below.keys():
            raise DataError(f"{path}: joint {joint.get('name')!r}: expected links of this file, got {min(lost)!r}")
        below[parent].append(child)
        if child in parents:
            raise DataError(
                f"{path}: link {child!r} is the child of {parents[child].get('name')!r} and of {joint.get('name')!r}; "
                "a URDF is a tree"
            )
        parents[child] = joint
    downwards = [link for link in links if link not in parents]  # each link after the one above it
    for link in downwards:
        downwards += below[link]
    if circle := below.keys() - downwards:
        raise DataError(f"{path}: link {min(circle)!r} is below itself, or below such a link; a URDF is a tree")
    ends = Ends(links, downwards, parents)
    candidates = ends.candidates()
    others = tuple(candidates[1:]) if tip is None else ()
    tip = _tip(tip, links, candidates, path)
    above: list[ElementTree.Element] = []  # the joints between the root and the tip
    link = tip
    while link in parents:
        above.insert(0, parents[link])
        link = _parent_link(parents[link])
    moving = [joint for joint in above if joint.get("type") in MOVING and joint.get("name") not in ends.gripper]
    if not moving:
        raise DataError(f"{path}: expected at least one joint that moves between the root and {tip!r}, found none")
    doubts = tuple(doubts_of(above))
    free = _names(joint for joint in moving if joint.get("type") == "continuous")
    limits = tuple(_limits(joint, path) for joint in moving)
    for check in (check_masses, check_shapes, check_origins):
        check(robot, path)
    missing = tuple(dict.fromkeys(resolve_meshes(robot, path)))
    units = tuple("m" if joint.get("type") == "prismatic" else "rad" for joint in moving)
    gripper = tuple(name for name in _names(robot.findall("joint")) if name in ends.gripper)
    try:
        text = ElementTree.tostring(robot, "unicode")
    except RecursionError as error:
        raise DataError(f"{path}: expected a URDF file, got elements within one another without end") from error
    return Chain(text, _names(moving), units, limits, tip, free, missing, gripper, others, doubts)


def _names(elements: Iterable[ElementTree.Element]) -> tuple[str, ...]:
    return tuple(str(element.get("name")) for element in elements)


def read_root(path: Path) -> ElementTree.Element:
    """Read the root of a URDF file, in which no link is called like a joint; a xacro file is converted."""
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
    if any(element.tag.startswith(_XACRO) for element in robot.iter()):
        robot = without_macros(path)
    if robot.tag != "robot":
        raise DataError(f"{path}: expected a URDF, whose root is <robot>, got <{robot.tag}>")
    joints = {joint.get("name") for joint in robot.findall("joint")}
    for link in robot.findall("link"):
        name = link.get("name")
        if name in joints:  # another name: the model knows frames by their names
            link.set("name", f"{name}{_TWIN}")
            for end in robot.iterfind("joint/*[@link]"):
                if end.get("link") == name:
                    end.set("link", f"{name}{_TWIN}")
    return robot


def _end(joint: ElementTree.Element, which: str, path: Path) -> str:
    end = joint.find(which)
    if end is None or not end.get("link"):
        raise DataError(f"{path}: joint {joint.get('name')!r} has no <{which} link=...>")
    return str(end.get("link"))


def _tip(tip: str | None, links: Sequence[str], candidates: list[Candidate], path: Path) -> str:
    """Choose the link that is asked for, else the end of the longest chain if one is longer than all others."""
    if tip is not None:
        tip = f"{tip}{_TWIN}" if tip not in links and f"{tip}{_TWIN}" in links else tip
        if tip not in links:
            from difflib import get_close_matches

            alike = get_close_matches(tip, links, 3)
            listed = f"{', '.join(map(repr, alike))}, ..." if alike else first_names(candidates, LISTED)
            raise DataError(f"{path}: has no link {tip!r} to be the tip; there are {listed}")
        return tip
    if not candidates:
        raise DataError(f"{path}: expected a robot with at least one joint that moves, found none")
    if len(candidates) > 1 and candidates[0].n_joints == candidates[1].n_joints:
        raise DataError(
            f"{path}: expected a tip, as the robot ends in {len(candidates)} links: {first_names(candidates, LISTED)}; "
            "say which one follows the movement (tip=..., --tip)"
        )
    return candidates[0].link


def _limits(joint: ElementTree.Element, path: Path) -> JointLimits:
    """Read the limits of a joint; one without stops becomes a joint with those of one turn to each side, in place."""
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
        limit.attrib.update({"lower": f"{-_TURNS}", "upper": f"{_TURNS}"})
    if limit is None or limit.get("lower") is None or limit.get("upper") is None:
        raise DataError(f"{path}: joint {name!r} has no limits; add <limit lower= upper= velocity= effort=/> to it")

    def number(element: ElementTree.Element, key: str) -> float:
        text = element.get(key)
        value = math.nan if text is None else finite_number(text)
        if value is None:
            raise DataError(f"{path}: joint {name!r}: expected a number for {key}, got {text!r}")
        return value

    limits = JointLimits(*(number(limit, key) for key in JointLimits._fields))
    if (safety := joint.find("safety_controller")) is not None:  # drivers stop the joint there; NaN is not said
        lower, upper = (number(safety, f"soft_{key}_limit") for key in ("lower", "upper"))
        limits = limits._replace(lower=max(limits.lower, lower), upper=min(limits.upper, upper))
        limit.attrib.update({"lower": f"{limits.lower}", "upper": f"{limits.upper}"})
    if not limits.lower < limits.upper:
        raise DataError(f"{path}: joint {name!r}: expected lower < upper, got {limits.lower:g} and {limits.upper:g}")
    for key in ("velocity", "effort"):
        limit.set(key, limit.get(key, "0"))
    rates = {key: getattr(limits, key) for key in ("velocity", "acceleration", "effort")}
    if any(0 < value < _LEAST for value in rates.values()):
        raise DataError(f"{path}: joint {name!r}: expected limits of at least {_LEAST:g}, got {rates}")
    return limits._replace(**{key: value if value > 0 else math.nan for key, value in rates.items()})


def without_macros(path: Path) -> ElementTree.Element:
    """Convert a xacro file to a URDF with the defaults of its arguments, and return its root."""
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
    """Write the path of each collision mesh into the tree, and remove missing ones; return links without shape."""
    missing = []
    for link in robot.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)  # nothing here looks at it, and its meshes need not be there
        for collision in link.findall("collision"):
            if (mesh := collision.find("geometry/mesh")) is not None:
                if (file := find_mesh(mesh.get("filename", ""), path)) is None:
                    link.remove(collision)
                    missing.append(str(link.get("name")))
                else:
                    mesh.set("filename", str(file))
    return missing


def find_mesh(name: str, path: Path) -> Path | None:
    """Find the file of a mesh that a URDF names, in any folder above it, as ROS packages lie; None where it is not."""
    within = next((name.removeprefix(prefix) for prefix in _PREFIXES if name.startswith(prefix)), name)
    folders = path.resolve().parents
    try:
        return next((folder / within for folder in folders if within and (folder / within).is_file()), None)
    except (OSError, ValueError):  # as a name that is too long
        return None


class Candidate(NamedTuple):
    """A link that may be the tip."""

    link: str
    n_joints: int  # of the arm, between the root and the link

    def __str__(self) -> str:
        return f"{self.link!r} ({self.n_joints} joint{'s' if self.n_joints != 1 else ''})"


class Ends:
    """The tree of a URDF as bodies, which are links that fixed joints hold together, and the joints between them.

    `gripper`: names of the joints of grippers and hands: by words (finger, jaw ...), those that mimic others at the end
    of a chain, and branches of equally many joints at the end of a chain twice as long; none if nothing else moves.
    """

    def __init__(self, links: Sequence[str], downwards: list[str], parents: dict[str, ElementTree.Element]) -> None:
        # `downwards`: the links, each after the one above it; `parents`: the joint above each that has one.
        self._links, self._parents = links, parents
        self._bodies: dict[str, str] = {}  # link -> the link that stands for those which fixed joints hold together
        for link in downwards:
            fixed = link in parents and parents[link].get("type") not in MOVING
            self._bodies[link] = self._bodies[_parent_link(parents[link])] if fixed else link
        self._branches: dict[str, list[str]] = {self._bodies[link]: [] for link in links}
        for link in links:
            if link in parents and parents[link].get("type") in MOVING:
                self._branches[self._bodies[_parent_link(parents[link])]].append(link)
        self._n_below: dict[str, int] = {}  # body -> joints of the longest chain below it
        for body in reversed(downwards):
            below = self._branches.get(body, ())
            self._n_below[body] = max((1 + self._n_below[branch] for branch in below), default=0)
        self.gripper: set[str] = set()
        cut = [link for link in links if self._begins_gripper(link)]
        inside, left = set[str](), cut
        while left:
            link = left.pop()
            inside.add(str(parents[link].get("name")))
            left += self._branches[link]
        if len(inside) < sum(map(len, self._branches.values())):
            self.gripper = inside

    def candidates(self) -> list[Candidate]:
        """List the likely tip at each end of the arm, the one with most joints first."""
        arm = [body for body in self._branches if body in self._parents and self._is_arm(body)]
        ends = [body for body in arm if not any(map(self._is_arm, self._branches[body]))]
        return sorted(
            (Candidate(self._tip_of(body), self._n_above(body)) for body in ends), key=lambda end: -end.n_joints
        )

    def _is_arm(self, body: str) -> bool:
        return str(self._parents[body].get("name")) not in self.gripper

    def _n_above(self, body: str) -> int:
        """Count the joints of the arm between the root and a body."""
        count = 0
        while body in self._parents:
            count += self._is_arm(body)
            body = self._bodies[_parent_link(self._parents[body])]
        return count

    def _begins_gripper(self, link: str) -> bool:
        joint = self._parents.get(link)
        if joint is None or joint.get("type") not in MOVING:
            return False
        name = str(joint.get("name"))
        if _DIGITS.search(name) or _DIGITS.search(link) or (_GRIPPER.search(name) and not _WRIST.search(name)):
            return True
        if joint.find("mimic") is not None:
            return self._n_below[link] == 0
        body = self._bodies[_parent_link(joint)]
        lengths = sorted((1 + self._n_below[branch] for branch in self._branches[body]), reverse=True)
        return len(lengths) > 1 and lengths[0] == lengths[1] and 2 * lengths[0] <= self._n_above(body) + 1

    def _tip_of(self, body: str) -> str:
        """Choose the most likely tip of a body: by its name, else its only end, else the link itself."""

        def n_fixed(link: str) -> int:
            count = 0
            while link != body:
                count, link = count + 1, _parent_link(self._parents[link])
            return count

        links = [link for link in self._links if self._bodies[link] == body and not _SENSOR.search(link)]
        for names in _TIPS:
            named = [link for link in links if names.search(link)]
            if named:
                return max(named, key=n_fixed)
        inner = {_parent_link(self._parents[link]) for link in links if link in self._parents}
        ends = [link for link in links if link not in inner]
        return ends[0] if len(ends) == 1 else body


def _parent_link(joint: ElementTree.Element) -> str:
    parent = joint.find("parent")
    return "" if parent is None else str(parent.get("link"))
