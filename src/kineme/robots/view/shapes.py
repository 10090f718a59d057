"""What of an arm is drawn: its links and joints as a URDF without names, and the meshes of its links."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple
from xml.etree import ElementTree

from kineme.robots.models.numbers import finite_numbers
from kineme.robots.models.robot import Robot
from kineme.robots.view.elements import Element, as_text, origin_of, set_color
from kineme.robots.view.installed_meshes import root_with_shapes
from kineme.robots.view.link_shapes import LinkShapes, Mesh

_GRAYS = ((0.80, 0.82, 0.85, 1.0), (0.58, 0.61, 0.66, 1.0))  # of links one after the other that have no color
_THICKNESS = 0.12  # of the cylinder between two joints: its radius for each meter of its length
_THIN, _THICK = 0.01, 0.05  # bounds of that radius [m]


class Shapes(NamedTuple):
    """What is drawn. Links are called l0, l1, ... and joints j0, j1, ...: no name of the file is in the text."""

    urdf: str
    meshes: tuple[Mesh, ...]  # a file name in `urdf` is an index into them
    joints: tuple[str, ...]  # those of the robot, in its order
    tip: str
    stand_ins: tuple[str, ...]  # links of the file that are drawn as cylinders


def shapes_of(robot: Robot) -> Shapes:
    """The visual shapes of an arm, by name those that are installed; where a link has none, its collision shapes.

    A link whose meshes are not there, of another format than STL and COLLADA, or larger than 16 MB with those before
    them, is drawn as cylinders to the joints that it bears; so is every link of a file without any shape.
    """
    root = root_with_shapes(robot)
    links = {str(link.get("name")): f"l{i}" for i, link in enumerate(root.findall("link"))}
    joints = {str(joint.get("name")): f"j{i}" for i, joint in enumerate(root.findall("joint"))}
    drawer = LinkShapes(root, robot.source)
    drawn = {name: drawer.of(link) for name, link in zip(links, root.findall("link"), strict=True)}
    nothing = not any(drawn.values())
    bare = [name for name in links if not drawn[name] and (nothing or name in drawer.without)]
    made = ElementTree.Element("robot", name="arm")
    for i, (name, link) in enumerate(links.items()):
        to = ElementTree.SubElement(made, "link", name=link)
        shapes = drawn[name] if name not in bare else list(_cylinders(root, name))
        for shape in shapes:
            set_color(shape, _GRAYS[i % 2])
        to.extend(shapes)
    moving = {str(joint.get("name")): joint for joint in root.findall("joint") if joint.get("name") in robot.joints}
    for joint in root.findall("joint"):
        made.append(_joint(joint, joints[str(joint.get("name"))], links, str(joint.get("name")) in moving))
    return Shapes(
        ElementTree.tostring(made, "unicode"),
        tuple(drawer.meshes),
        tuple(joints[name] for name in robot.joints),
        links[robot.tip],
        tuple(name for name in bare if name in drawer.without),
    )


def _joint(given: Element, name: str, links: dict[str, str], moves: bool) -> Element:
    """The joint; one that the arm does not move is fixed where the model has it, at 0."""
    kind = ("prismatic" if given.get("type") == "prismatic" else "revolute") if moves else "fixed"
    made = ElementTree.Element("joint", name=name, type=kind)
    made.append(origin_of(given))
    for end in ("parent", "child"):
        found = given.find(end)
        ElementTree.SubElement(made, end, link=links["" if found is None else str(found.get("link"))])
    axis = given.find("axis")
    values = [] if axis is None else finite_numbers(axis.get("xyz"), 3)
    ElementTree.SubElement(made, "axis", xyz=as_text(values if any(values) else [1.0, 0.0, 0.0]))
    return made


def _cylinders(root: Element, link: str) -> Iterator[Element]:
    """One from the frame of a link to each joint that it bears."""
    for joint in root.findall("joint"):
        parent = joint.find("parent")
        if parent is None or parent.get("link") != link:
            continue
        x, y, z = finite_numbers(origin_of(joint).get("xyz"), 3)
        length = math.hypot(x, y, z)
        if length < 1e-3:
            continue
        made = ElementTree.Element("visual")
        turned = [0.0, math.acos(z / length), math.atan2(y, x)]
        ElementTree.SubElement(made, "origin", xyz=as_text([x / 2, y / 2, z / 2]), rpy=as_text(turned))
        radius = min(max(_THICKNESS * length, _THIN), _THICK)
        shape = ElementTree.Element("cylinder", radius=as_text([radius]), length=as_text([length]))
        ElementTree.SubElement(made, "geometry").append(shape)
        yield made
