"""A movement of an arm as one HTML page."""

from __future__ import annotations

import json
import math
from base64 import b64encode
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from kineme.errors import DataError
from kineme.reporting.atomic import write_atomically
from kineme.reporting.colors import BLUE, GRAY, GREEN, ORANGE
from kineme.reporting.page import filled
from kineme.reporting.text import counted, in_markup, printable
from kineme.robots.execution.preflight import preflight_table
from kineme.robots.kinematics.descent import kinematics
from kineme.robots.models.numbers import SIZES, finite_numbers
from kineme.robots.models.robot import FOLDER, MODELS, Robot
from kineme.robots.models.urdf import find_mesh, read_root
from kineme.robots.planning.robot_movement import RobotMovement, duration_in_words
from kineme.sampling import evenly_spaced
from kineme.validation import Array

Element = ElementTree.Element

_PACKAGE = "example-robot-data"
_ROBOTS = "cmeel.prefix/share/example-robot-data/robots"  # within what its wheel installs

_LARGEST = 16_000_000  # bytes of all meshes of one page
_MESHES = {".stl": "stl", ".dae": "collada"}

_GRAYS = ((0.93, 0.94, 0.96, 1.0), (0.72, 0.75, 0.80, 1.0))  # of links one after the other that have no color
_CAP = (0.0, 0.27, 0.50, 1.0)  # color of the ends of a joint
_LONG = 3.0  # times its radius: a longer cylinder is a limb, with round ends, a shorter one a joint, with caps
_CAPS = 0.8, 0.14  # radius and thickness of a cap, in radii of its joint
_THICKNESS = 0.12  # of the cylinder between two joints: its radius for each meter of its length
_THIN, _THICK = 0.01, 0.05  # bounds of that radius [m]

MOST_SAMPLES = 3000  # of a page; between two of them the page interpolates

WIDTH, HEIGHT = 320.0, 84.0  # of a drawing, in its own units
_EDGE = 4.0  # above the upper limit and below the lower one
_POINTS = 400

_FOLDER = Path(__file__).parent
_SCENE = "vendor/scene.min.js"
_LICENSES = ("vendor/LICENSE-three.txt", "vendor/LICENSE-urdf-loader.txt")


def write_view(path: str | Path, movement: RobotMovement) -> Path:
    """Write a page in which the arm moves: one HTML file that opens in a browser without server and network.

    The page shows the arm with the visual shapes of its URDF, the path that was wanted and the one that is executed,
    each joint over time between its limits, and the preflight table. A slider scrubs, the space bar plays. Nothing is
    requested from anywhere: the content security policy of the page allows its own scripts by their hashes, and nothing
    else. Drawn with three.js and urdf-loader, which are in the page with their licenses.

    Parameters
    ----------
    path : str or Path
        Replaced if it is there.
    movement : RobotMovement
        From `move`.

    Raises
    ------
    DataError
        The URDF file of the arm is no longer there.
    OSError
        The folder is missing, read-only or full.
    """
    return write_atomically(Path(path), view_page(movement).encode())


def view_page(movement: RobotMovement) -> str:
    """The text of the page."""
    shapes = shapes_of(movement.robot)
    scripts = {"scene": _asset(_SCENE), "viewer": _asset("page/viewer.js")}
    n_failed = len(movement.preflight.failed)
    checks = f"{counted(n_failed, 'check')} FAILED." if n_failed else "All checks passed."
    parts = {
        "title": in_markup(f"{movement.robot.name} moves"),
        "summary": in_markup(f"{duration_in_words(movement)}. {checks}"),
        "notes": _notes(movement, shapes.stand_ins),
        "charts": charts(movement),
        "preflight": _preflight(movement),
        "data": as_script_data(scene_data(movement, shapes)),
        "licenses": "\n\n".join(in_markup(_asset(name)) for name in _LICENSES),
    }
    return filled(_asset("page/page.html"), parts, _asset("page/viewer.css"), scripts, "img-src data:; ")


def _asset(name: str) -> str:
    return (_FOLDER / name).read_text(encoding="utf-8")


def _notes(movement: RobotMovement, stand_ins: tuple[str, ...]) -> str:
    notes = list(movement.robot.assumed)
    if stand_ins:
        why = "their meshes are not there, no STL or COLLADA files, or too large to be in this page"
        notes.append(f"drawn as cylinders up to the next joint: {', '.join(map(printable, stand_ins))}; {why}")
    if len(movement.trajectory) > MOST_SAMPLES:
        notes.append(f"{MOST_SAMPLES:,} of {len(movement.trajectory):,} samples are in this page")
    return "".join(f"<li>{in_markup(note)}</li>" for note in notes)


def _preflight(movement: RobotMovement) -> str:
    """Write the table of checks; rows of those that failed stand first and carry a class."""
    table = preflight_table(movement.preflight)
    rows = sorted(zip(movement.preflight.checks, table.rows, strict=True), key=lambda pair: pair[0].passed)
    heads = "".join(f'<th scope="col">{in_markup(head or "result")}</th>' for head in table.columns)
    lines = ""
    for check, cells in rows:
        values = "".join(f"<td>{in_markup(cell)}</td>" for cell in cells[1:])
        opened = "<tr>" if check.passed else '<tr class="failed">'
        lines += f'{opened}<th scope="row">{in_markup(cells[0])}</th>{values}</tr>\n'
    return f"<table><thead><tr>{heads}</tr></thead><tbody>\n{lines}</tbody></table><p>{in_markup(table.reading)}</p>"


def charts(movement: RobotMovement) -> str:
    """A figure for each joint, from its lower limit to its upper one, and for each discrete channel."""
    trajectory, robot = movement.trajectory, movement.robot
    columns = zip(trajectory.joints, trajectory.positions.T, robot.lower, robot.upper, robot.units, strict=True)
    figures = [_chart(movement, name, values, (low, high), unit) for name, values, low, high, unit in columns]
    return "\n".join(figures + [_chart(movement, name, values, None, "") for name, values in trajectory.steps.items()])


def _chart(movement: RobotMovement, name: str, values: Array, limits: tuple[float, float] | None, unit: str) -> str:
    times = movement.trajectory.times
    shown = evenly_spaced(len(times), _POINTS)
    low, high = (float(values.min()), float(values.max()))
    if limits is not None:
        low, high = min(low, limits[0]), max(high, limits[1])
    scale = (HEIGHT - 2 * _EDGE) / max(high - low, 1e-9)
    across = WIDTH / max(float(times[-1]), 1e-9)

    def y(value: Array) -> Array:
        return np.asarray(HEIGHT - _EDGE - scale * (value - low))

    x, drawn = times[shown] * across, y(values[shown])
    if limits is None:  # a value holds until the next one
        x, drawn = np.repeat(x, 2)[1:], np.repeat(drawn, 2)[:-1]
    line = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, drawn, strict=True))
    levels = [float(y(np.asarray(limit))) for limit in limits or ()]
    lines = "".join(f'<line class="limit" x2="{WIDTH:g}" y1="{level:.1f}" y2="{level:.1f}"/>' for level in levels)
    range_text = "" if limits is None else f"limits {limits[0]:.3g} to {limits[1]:.3g} {unit}"
    extent = f"from {values.min():.3g} to {values.max():.3g} {unit}".strip()
    words = in_markup(f"{name} over time: {extent}{'; ' + range_text if range_text else ''}")
    return (
        f'<figure class="chart"><figcaption><span class="name">{in_markup(name)}</span> '
        f'<output data-unit="{unit}"></output></figcaption>'
        f'<svg viewBox="0 0 {WIDTH:g} {HEIGHT:g}" preserveAspectRatio="none" role="img" aria-label="{words}">'
        f'<rect class="approach" width="{movement.begins * across:.1f}" height="{HEIGHT:g}"/>{lines}'
        f'<polyline class="joint" points="{line}"/><line class="cursor" y2="{HEIGHT:g}"/></svg>'
        f'<p class="limits">{range_text or "a discrete channel"}</p></figure>'
    )


def scene_data(movement: RobotMovement, shapes: Shapes) -> dict[str, Any]:
    """Times, joint positions [rad, m] and positions of the tip [m], rounded to a millionth."""
    trajectory = movement.trajectory
    sent = evenly_spaced(len(trajectory), MOST_SAMPLES)
    wanted = np.empty((0, 3)) if movement.path is None else movement.path.positions
    return {
        **posture_data(movement.robot, shapes, trajectory.positions[sent]),
        "times": _rounded(trajectory.times[sent]),
        "steps": [_rounded(values[sent]) for values in trajectory.steps.values()],
        "wanted": _rounded(wanted[evenly_spaced(len(wanted), MOST_SAMPLES)] if len(wanted) else wanted),
        "begins": round(movement.begins, 6),
        "start": _rounded(kinematics(movement.robot, trajectory.positions[[movement.first]])[0][0]),
    }


def posture_data(robot: Robot, shapes: Shapes, joints: Array | None = None) -> dict[str, Any]:
    """The same of joint positions (T, n) at no times; of an arm that stands at rest where there are none."""
    positions = robot.rest[None] if joints is None else joints
    tip = kinematics(robot, positions)[0]
    return {
        **{name: getattr(shapes, name) for name in ("urdf", "meshes", "joints", "tip")},
        "positions": _rounded(positions),
        "executed": _rounded(tip),
        **{"times": [0.0], "steps": [], "wanted": [], "begins": 0.0},
        "start": _rounded(tip[0]),
        "goal": _rounded(tip[-1]),
        "colors": {"executed": BLUE, "wanted": ORANGE, "approach": GRAY, "goal": GREEN},
    }


def _rounded(values: Array) -> Any:
    return np.round(values, 6).tolist()


def as_script_data(data: dict[str, Any]) -> str:
    """JSON that can stand in a script element: no ``<`` is left in it that could end the element."""
    return json.dumps(data, separators=(",", ":")).replace("<", r"\u003c")


class Shapes(NamedTuple):
    """Shapes of an arm. Links are called l0, l1, ... and joints j0, j1, ...: no name of the file is in the text."""

    urdf: str
    meshes: tuple[dict[str, str], ...]  # kind, content in base64; a file name in `urdf` is an index into them
    joints: tuple[str, ...]  # those of the robot, in its order
    tip: str
    stand_ins: tuple[str, ...]  # links of the file that are drawn as cylinders


def shapes_of(robot: Robot) -> Shapes:
    """The visual shapes of an arm, by name those that are installed; where a link has none, its collision shapes.

    A link whose meshes cannot be in the page, and any of a file without shapes, is cylinders to the joints it bears.
    """
    root = root_with_shapes(robot)
    links = {str(link.get("name")): f"l{i}" for i, link in enumerate(root.findall("link"))}
    joints = {str(joint.get("name")): f"j{i}" for i, joint in enumerate(root.findall("joint"))}
    drawer = LinkShapes(root, robot.source)
    drawn = {name: drawer.of(link) for name, link in zip(links, root.findall("link"), strict=True)}
    bare = drawer.without if any(drawn.values()) else list(links)  # drawn as cylinders
    arm = ElementTree.Element("robot", name="arm")
    for i, (name, link) in enumerate(links.items()):
        to = ElementTree.SubElement(arm, "link", name=link)
        shapes = drawn[name] if name not in bare else list(_cylinders(root, name))
        if name in bare or robot.source.parent == FOLDER:
            shapes = [part for shape in shapes for part in _limb_or_joint(shape)]
        for shape in shapes:
            set_color(shape, _GRAYS[i % 2])
        to.extend(shapes)
    for joint in root.findall("joint"):
        arm.append(_joint(joint, joints[str(joint.get("name"))], links, joint.get("name") in robot.joints))
    return Shapes(
        ElementTree.tostring(arm, "unicode"),
        tuple(drawer.meshes),
        tuple(joints[name] for name in robot.joints),
        links[robot.tip],
        tuple(drawer.without),
    )


def _joint(given: Element, name: str, links: dict[str, str], moves: bool) -> Element:
    """The joint; one that the arm does not move is fixed where the model has it, at 0."""
    kind = ("prismatic" if given.get("type") == "prismatic" else "revolute") if moves else "fixed"
    joint = ElementTree.Element("joint", name=name, type=kind)
    joint.append(origin_of(given))
    for end in ("parent", "child"):
        link = given.find(end)
        ElementTree.SubElement(joint, end, link=links["" if link is None else str(link.get("link"))])
    axis = given.find("axis")
    values = [] if axis is None else finite_numbers(axis.get("xyz"), 3)
    ElementTree.SubElement(joint, "axis", xyz=as_text(values if any(values) else [1.0, 0.0, 0.0]))
    return joint


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
        visual = ElementTree.Element("visual")
        turned = [0.0, math.acos(z / length), math.atan2(y, x)]
        ElementTree.SubElement(visual, "origin", xyz=as_text([x / 2, y / 2, z / 2]), rpy=as_text(turned))
        radius = min(max(_THICKNESS * length, _THIN), _THICK)
        shape = ElementTree.Element("cylinder", radius=as_text([radius]), length=as_text([length]))
        ElementTree.SubElement(visual, "geometry").append(shape)
        yield visual


def _limb_or_joint(shape: Element) -> Iterator[Element]:
    """Yield a cylinder without a color of its own with round ends, or a short one with colored caps."""
    yield shape
    cylinder = shape.find("geometry/cylinder")
    if cylinder is None or shape.find("material") is not None:
        return
    origin = origin_of(shape)
    radius, length = (float(cylinder.get(name, "0")) for name in ("radius", "length"))
    roll, pitch, yaw = finite_numbers(origin.get("rpy"), 3)
    is_limb = length > _LONG * radius
    away = length / 2 - radius * is_limb  # from the middle of the cylinder to the middle of an end
    if is_limb:
        cylinder.set("length", as_text([2 * away]))
    along = Rotation.from_euler("xyz", (roll, pitch, yaw)).apply([0.0, 0.0, away])
    for side in (-1, 1):
        end = ElementTree.Element("visual")
        place = np.add(finite_numbers(origin.get("xyz"), 3), side * along).tolist()
        ElementTree.SubElement(end, "origin", xyz=as_text(place), rpy=str(origin.get("rpy")))
        geometry = ElementTree.SubElement(end, "geometry")
        if is_limb:
            ElementTree.SubElement(geometry, "sphere", radius=as_text([radius]))
        else:
            sizes = {name: as_text([radius * part]) for name, part in zip(("radius", "length"), _CAPS, strict=True)}
            ElementTree.SubElement(geometry, "cylinder", sizes)
            set_color(end, _CAP)
        yield end


class LinkShapes:
    """The shapes of one link after the other, and the meshes that they need."""

    def __init__(self, root: Element, path: Path) -> None:
        self.colors = {
            material.get("name"): color
            for material in root.findall("material")
            if (color := material.find("color")) is not None
        }
        self.path = path
        self.meshes: list[dict[str, str]] = []
        self.without: list[str] = []  # links with shapes, none of which can be drawn
        self._numbers: dict[Path, int] = {}
        self._bytes = 0

    def of(self, link: Element) -> list[Element]:
        """The visual shapes of a link, or else its collision shapes; none where they cannot be drawn."""
        for tag in ("visual", "collision"):
            shapes = [shape for given in link.findall(tag) if (shape := self._shape(given)) is not None]
            if shapes:
                return shapes
        if link.find("visual") is not None or link.find("collision") is not None:
            self.without.append(str(link.get("name")))
        return []

    def _shape(self, given: Element) -> Element | None:
        geometry = given.find("geometry")
        shape = None if geometry is None or len(geometry) == 0 else self._geometry(geometry[0])
        if shape is None:
            return None
        visual = ElementTree.Element("visual")
        visual.append(origin_of(given))
        ElementTree.SubElement(visual, "geometry").append(shape)
        color = given.find("material/color")
        if color is None and (material := given.find("material")) is not None:
            color = self.colors.get(material.get("name"))
        values = [] if color is None else finite_numbers(color.get("rgba"), 4)
        if values:
            set_color(visual, tuple(min(max(value, 0.0), 1.0) for value in values))
        return visual

    def _geometry(self, given: Element) -> Element | None:
        if given.tag == "mesh":
            number = self._mesh(given.get("filename", ""))
            if number is None:
                return None
            scale = finite_numbers(given.get("scale"), 3) or [1.0, 1.0, 1.0]
            return ElementTree.Element("mesh", filename=str(number), scale=as_text(scale))
        if given.tag not in SIZES:
            return None
        names, length = SIZES[given.tag]
        sizes = {name: finite_numbers(given.get(name), length) for name in names.split()}
        if not all(values and min(values) > 0 for values in sizes.values()):
            return None
        return ElementTree.Element(given.tag, {name: as_text(values) for name, values in sizes.items()})

    def _mesh(self, name: str) -> int | None:
        path = find_mesh(name, self.path)
        if path is None or path.suffix.lower() not in _MESHES:
            return None
        if path not in self._numbers:
            self._bytes += path.stat().st_size
            if self._bytes > _LARGEST:
                return None
            self._numbers[path] = len(self.meshes)
            content = b64encode(path.read_bytes()).decode()
            self.meshes.append({"kind": _MESHES[path.suffix.lower()], "content": content})
        return self._numbers[path]


def root_with_shapes(robot: Robot) -> Element:
    """The URDF of an arm; of one by name, with the shapes of its links in the package, whose frames are as ours."""
    root = read_root(robot.source)
    model = MODELS.get(robot.name) if robot.source.parent == FOLDER else None
    folder = robots_folder() if model is not None and model.meshes else None
    if model is None or folder is None:
        return root
    path = folder / model.meshes
    try:
        shown = read_root(path)
    except DataError:  # of another release, without this arm
        return root
    links = {link.get("name"): link for link in shown.findall("link")}
    for mesh in shown.iterfind("link/visual/geometry/mesh"):
        file = find_mesh(mesh.get("filename", ""), path)
        mesh.set("filename", "" if file is None else str(file))
    for link in root.findall("link"):
        like = links.get(link.get("name"))
        if like is not None and like.find("visual") is not None:
            for visual in link.findall("visual"):
                link.remove(visual)
            link.extend(like.findall("visual"))
    root.extend(shown.findall("material"))
    return root


def robots_folder() -> Path | None:
    """Find the folder of the robots of the package; None where it is not installed."""
    try:
        folder = Path(str(distribution(_PACKAGE).locate_file(_ROBOTS)))
    except PackageNotFoundError:
        return None
    return folder if folder.is_dir() else None


def origin_of(given: Element) -> Element:
    """A copy of the origin of an element; at 0 what it does not say."""
    origin = given.find("origin")
    values = {name: [] if origin is None else finite_numbers(origin.get(name), 3) for name in ("xyz", "rpy")}
    return ElementTree.Element("origin", {name: as_text(value or [0.0, 0.0, 0.0]) for name, value in values.items()})


def set_color(shape: Element, rgba: tuple[float, ...]) -> None:
    """Give a shape a color, unless it has one."""
    if shape.find("material") is None:
        material = ElementTree.SubElement(shape, "material", name="")
        ElementTree.SubElement(material, "color", rgba=as_text(list(rgba)))


def as_text(values: list[float]) -> str:
    """Numbers as an attribute."""
    return " ".join(f"{value:.9g}" for value in values)
