"""Where the arm of a URDF ends: which joints belong to a gripper or a hand, and which link is the tip."""

from __future__ import annotations

import re
from typing import NamedTuple
from xml.etree import ElementTree

#: Types of joints that move.
MOVING = ("revolute", "continuous", "prismatic")
_LISTED = 8  # links that a message names
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


class Candidate(NamedTuple):
    """A link that may be the tip."""

    link: str
    n_joints: int  # of the arm, between the root and the link

    def __str__(self) -> str:
        return f"{self.link!r} ({self.n_joints} joint{'s' if self.n_joints != 1 else ''})"


class Ends:
    """The tree of a URDF as bodies, which are links that fixed joints hold together, and the joints between them.

    Parameters
    ----------
    links : list of str
    parents : dict of str to Element
        The joint above each link that has one.

    Attributes
    ----------
    gripper : set of str
        Names of the joints of grippers and hands: by their names (finger, thumb, jaw, gripper ...), joints that mimic
        others at the end of a chain, and two or more branches of equally many joints that leave the end of a chain at
        least twice as long. If nothing else moves, there are none.
    """

    def __init__(self, links: list[str], parents: dict[str, ElementTree.Element]) -> None:
        self._links, self._parents = links, parents
        self._bodies = {link: self._body(link) for link in links}
        self._branches: dict[str, list[str]] = {body: [] for body in self._bodies.values()}
        for link in links:
            if link in parents and parents[link].get("type") in MOVING:
                self._branches[self._bodies[_above(parents[link])]].append(link)
        self.gripper: set[str] = set()
        cut = [link for link in links if self._begins_gripper(link)]
        inside = {name for link in cut for name in self._joints_below(link)}
        if len(inside) < sum(map(len, self._branches.values())):
            self.gripper = inside

    def candidates(self) -> list[Candidate]:
        """The likely tip at each end of the arm, the one with most joints first."""
        arm = [body for body in self._branches if body in self._parents and self._is_arm(body)]
        ends = [body for body in arm if not any(map(self._is_arm, self._branches[body]))]
        return sorted(
            (Candidate(self._tip_of(body), self._n_above(body)) for body in ends), key=lambda end: -end.n_joints
        )

    def _body(self, link: str) -> str:
        """The link that stands for those which fixed joints hold together."""
        passed = set()
        while link in self._parents and self._parents[link].get("type") not in MOVING and link not in passed:
            passed.add(link)
            link = _above(self._parents[link])
        return link

    def _is_arm(self, body: str) -> bool:
        return str(self._parents[body].get("name")) not in self.gripper

    def _n_above(self, body: str) -> int:
        """Number of joints of the arm between the root and a body."""
        count, passed = 0, set()
        while body in self._parents and body not in passed:
            passed.add(body)
            count += self._is_arm(body)
            body = self._bodies[_above(self._parents[body])]
        return count

    def _n_below(self, body: str, depth: int = 0) -> int:
        """Number of joints of the longest chain below a body."""
        below = self._branches[body] if depth < len(self._links) else []
        return max((1 + self._n_below(branch, depth + 1) for branch in below), default=0)

    def _joints_below(self, body: str) -> list[str]:
        """Names of the joint that moves a body and of all below it."""
        joints, left = [], [body]
        while left:
            link = left.pop()
            joints.append(str(self._parents[link].get("name")))
            left += self._branches[link]
        return joints

    def _begins_gripper(self, link: str) -> bool:
        joint = self._parents.get(link)
        if joint is None or joint.get("type") not in MOVING:
            return False
        name = str(joint.get("name"))
        if _DIGITS.search(name) or _DIGITS.search(link) or (_GRIPPER.search(name) and not _WRIST.search(name)):
            return True
        if joint.find("mimic") is not None:
            return self._n_below(link) == 0
        body = self._bodies[_above(joint)]
        lengths = sorted((1 + self._n_below(branch) for branch in self._branches[body]), reverse=True)
        return len(lengths) > 1 and lengths[0] == lengths[1] and 2 * lengths[0] <= self._n_above(body) + 1

    def _tip_of(self, body: str) -> str:
        """The link of a body that is most likely the tip: by its name, else its only end, else the link itself."""
        links = [link for link in self._links if self._bodies[link] == body and not _SENSOR.search(link)]
        for names in _TIPS:
            named = [link for link in links if names.search(link)]
            if named:
                return max(named, key=self._n_fixed)
        inner = {_above(self._parents[link]) for link in links if link in self._parents}
        ends = [link for link in links if link not in inner]
        return ends[0] if len(ends) == 1 else body

    def _n_fixed(self, link: str) -> int:
        """Number of fixed joints between a link and the joint that moves it."""
        count, body = 0, self._bodies[link]
        while link != body:
            count, link = count + 1, _above(self._parents[link])
        return count


def in_words(candidates: list[Candidate]) -> str:
    """The first eight, each with its number of joints."""
    more = f" and {len(candidates) - _LISTED} more" if len(candidates) > _LISTED else ""
    return ", ".join(map(str, candidates[:_LISTED])) + more


def _above(joint: ElementTree.Element) -> str:
    parent = joint.find("parent")
    return "" if parent is None else str(parent.get("link"))
