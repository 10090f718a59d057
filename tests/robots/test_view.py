"""The page in which an arm moves: it needs nothing else, says what the trajectory says, and obeys no name."""

from __future__ import annotations

import json
import re
from base64 import b64decode, b64encode
from hashlib import sha256
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from view_samples import HOSTILE, arm, mesh_visual, moved, write_stl

from kineme.robots import view

pytest.importorskip("pinocchio", reason="the extra robot is not installed")

from kineme.movements.trajectories.trajectory import Trajectory
from kineme.reporting import colors
from kineme.robots import load, move, write_view
from kineme.robots.execution.preflight import along
from kineme.robots.kinematics.descent import InverseKinematics
from kineme.robots.models.robot import MODELS
from kineme.robots.view import write_view as module
from kineme.robots.view.write_view import MOST_SAMPLES, as_script_data, shapes_of, view_page

FOLDER = Path(view.__file__).parent
VENDORED = json.loads((FOLDER / "vendor" / "vendored.json").read_text())


class Parsed(HTMLParser):
    """The elements of a page, and the text of its scripts and styles."""

    def __init__(self, page):
        super().__init__()
        self.elements, self.texts, self._open = [], [], None
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        self._open = (tag, dict(attrs))
        if tag in ("script", "style"):
            self.texts.append([tag, dict(attrs), ""])

    def handle_data(self, data):
        if self._open and self._open[0] in ("script", "style"):
            self.texts[-1][2] += data

    def handle_endtag(self, tag):
        self._open = None

    @property
    def data(self):
        return json.loads(next(text for _, attrs, text in self.texts if attrs.get("id") == "data"))


@pytest.fixture(scope="module")
def panda():
    robot = load("panda")
    u = np.linspace(0, 1, 150)
    shape = np.column_stack((0 * u, 0.3 * (u - 0.5), 0.1 * np.sin(2 * np.pi * u)))
    positions = InverseKinematics(robot).tip_position + shape
    return move(Trajectory(times=3 * u, positions=positions), robot, timing="slowed", force=True)


@pytest.fixture(scope="module")
def page(panda):
    return view_page(panda)


def test_vendored_files_are_those_that_the_table_names():
    folder = FOLDER / "vendor"
    assert {path.name for path in folder.iterdir()} == {*VENDORED["sha256"], "vendored.json"}
    for name, expected in VENDORED["sha256"].items():
        assert sha256((folder / name).read_bytes()).hexdigest() == expected, name
    named = json.loads((folder / "package.json").read_text())["devDependencies"]
    packages = [*VENDORED["packages"], VENDORED["built_with"]]
    assert named == {one["package"]: one["version"] for one in packages}
    assert all((folder / f"LICENSE-{one['package']}.txt").is_file() for one in VENDORED["packages"])


def test_the_page_is_one_file_that_requests_nothing(page):
    parsed = Parsed(page)
    loading = {"src", "href", "srcset", "data", "action", "poster", "background", "xlink:href"}
    loaded = [(tag, name, value) for tag, attrs in parsed.elements for name, value in attrs.items() if name in loading]
    assert loaded == [("link", "href", "data:,")]
    assert not [
        attrs for _, attrs in parsed.elements if any(name.startswith("on") or name == "style" for name in attrs)
    ]
    for tag, _, text in parsed.texts:
        assert not re.search(r"@import|url\(", text) or tag == "script"
    own = (FOLDER / "page" / "viewer.js").read_text()
    assert not re.search(r"https?:|fetch\(|XMLHttpRequest|WebSocket|import\(|innerHTML|eval\(", own)


def test_the_policy_allows_the_scripts_of_the_page_and_nothing_else(page):
    parsed = Parsed(page)
    policy = next(attrs["content"] for tag, attrs in parsed.elements if "Content-Security-Policy" in attrs.values())
    rules = {rule.split()[0]: rule.split()[1:] for rule in policy.split(";")}
    assert rules["default-src"] == ["'none'"]

    def hashes(tag):
        texts = [text for one, attrs, text in parsed.texts if one == tag and attrs.get("id") != "data"]
        return [f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'" for text in texts]

    assert rules["script-src"] == hashes("script")
    assert rules["style-src"] == hashes("style")
    assert len(rules["script-src"]) == 2
    assert rules["img-src"] == ["data:"]


@pytest.mark.parametrize("name", MODELS)
def test_pages_of_the_own_arms_are_small(name, page, monkeypatch):
    monkeypatch.setattr(module, "robots_folder", lambda: None)
    if name == "panda":
        assert len(page.encode()) < 1_000_000
    shapes = shapes_of(load(name))
    assert not shapes.meshes
    assert not shapes.stand_ins
    assert shapes.urdf.count("<cylinder") >= load(name).n_joints


def test_the_data_are_those_of_the_trajectory(panda, page):
    data = Parsed(page).data
    np.testing.assert_allclose(data["times"], panda.trajectory.times, atol=1e-6)
    np.testing.assert_allclose(data["positions"], panda.trajectory.positions, atol=1e-6)
    np.testing.assert_allclose(data["executed"], along(panda.robot, panda.trajectory).tip_positions, atol=1e-6)
    np.testing.assert_allclose(data["wanted"], panda.path.positions, atol=1e-6)
    assert data["begins"] == pytest.approx(panda.begins, abs=1e-6)
    np.testing.assert_allclose(data["start"], data["wanted"][0], atol=1e-3)
    np.testing.assert_allclose(data["goal"], data["wanted"][-1], atol=1e-3)
    palette = {colors.BLUE, colors.ORANGE, colors.GRAY, colors.GREEN}
    assert set(data["colors"].values()) == palette
    style = (FOLDER / "page" / "viewer.css").read_text().lower().replace("#777;", "#777777;")
    assert all(color.lower() in style for color in palette)


def test_the_drawn_arm_has_the_joints_and_the_tip_of_the_model():
    pinocchio = pytest.importorskip("pinocchio")
    for name in MODELS:
        robot = load(name)
        shapes = shapes_of(robot)
        model = pinocchio.buildModelFromXML(_with_limits(shapes.urdf))
        data = model.createData()
        q = robot.rest
        assert [str(joint) for joint in model.names][1:] == list(shapes.joints)
        pinocchio.framesForwardKinematics(model, data, q)
        drawn = data.oMf[model.getFrameId(shapes.tip)]
        own = robot.model.createData()
        pinocchio.framesForwardKinematics(robot.model, own, q)
        np.testing.assert_allclose(drawn.homogeneous, own.oMf[robot.model.getFrameId(robot.tip)].homogeneous, atol=1e-6)


def _with_limits(urdf):
    """The reduced URDF says no limits, since the page has none to keep; pinocchio asks for them."""
    root = ElementTree.fromstring(urdf)
    for joint in root.findall("joint"):
        ElementTree.SubElement(joint, "limit", lower="-9", upper="9", velocity="9", effort="9")
    return ElementTree.tostring(root, "unicode")


def test_a_hostile_name_is_shown_and_never_obeyed(tmp_path):
    made = moved(arm(tmp_path, names=HOSTILE))
    page = view_page(made)
    parsed = Parsed(page)
    assert sum(tag == "script" for tag, _ in parsed.elements) == 3
    assert not [tag for tag, attrs in parsed.elements if tag == "img" or "onerror" in attrs]
    assert "{{" not in page.replace("to {{data}}", "")
    assert page.count('id="data"') == 1
    assert "alert" not in parsed.data["urdf"]
    assert "&lt;/script&gt;&lt;script&gt;alert(1)" in page
    assert parsed.data["tip"] == "l3"


def test_data_cannot_end_their_script_element():
    data = {"name": "</script><!--<script>"}
    assert "<" not in as_script_data(data)
    assert json.loads(as_script_data(data)) == data


def test_failed_checks_stand_first_and_are_marked(tmp_path):
    passing, failing = view_page(moved(arm(tmp_path))), view_page(moved(arm(tmp_path), True, max_velocity=0.1))
    assert '<tr class="failed">' not in passing
    assert "All checks passed." in passing
    body = failing[failing.index("<tbody>") :]
    assert body.index('<tr class="failed">') == body.index("<tr")
    marked = body[: body.index("</tbody>")].split("<tr")[1:]
    assert all(('class="failed"' in row) == ("<td>FAILED</td>" in row) for row in marked)
    assert re.search(r"\d checks FAILED\.", failing)


def test_charts_reach_from_limit_to_limit_in_the_unit_of_the_joint(tmp_path):
    page = view_page(moved(arm(tmp_path)))
    assert re.findall(r'<output data-unit="(\w*)">', page) == ["rad", "rad", "m"]
    assert page.count('class="limit"') == 6
    assert page.count("limits -2 to 2 rad") == 4  # in words for screen readers, and below the chart


def test_meshes_are_in_the_page_and_those_that_are_not_there_become_cylinders(tmp_path):
    write_stl(tmp_path / "shapes" / "link.stl")
    visuals = [mesh_visual("link.stl"), mesh_visual("link.stl"), mesh_visual("gone.stl"), ""]
    made = moved(arm(tmp_path, visuals))
    page = view_page(made)
    data = Parsed(page).data
    assert [mesh["kind"] for mesh in data["meshes"]] == ["stl"]  # once, though two links share it
    assert b64decode(data["meshes"][0]["content"]) == (tmp_path / "shapes" / "link.stl").read_bytes()
    urdf = ElementTree.fromstring(data["urdf"])
    drawn = {link.get("name"): [shape[0].tag for shape in link.iter("geometry")] for link in urdf.findall("link")}
    assert drawn == {
        "l0": ["mesh"],
        "l1": ["mesh"],
        "l2": ["cylinder", "sphere", "sphere"],
        "l3": [],
    }  # with round ends
    assert {one.get("filename") for one in urdf.iter("mesh")} == {"0"}
    assert "drawn as cylinders up to the next joint: lower; their meshes are not there" in page


def test_meshes_beyond_the_largest_size_are_left_out(tmp_path, monkeypatch):
    write_stl(tmp_path / "shapes" / "link.stl")
    monkeypatch.setattr(module, "_LARGEST", 100)
    shapes = shapes_of(load(arm(tmp_path, [mesh_visual("link.stl")] * 3 + [""])))
    assert not shapes.meshes
    assert shapes.stand_ins == ("base", "upper", "lower")


def test_an_arm_without_any_shape_is_drawn_as_cylinders(tmp_path):
    shapes = shapes_of(load(arm(tmp_path, [""] * 4)))
    assert shapes.urdf.count("<cylinder") == 3
    assert not shapes.stand_ins  # nothing is missing: the file has no shapes


def test_textures_and_shapes_of_no_size_are_left_out(tmp_path):
    visual = (
        '<visual><geometry><box size="0 0.1 0.1"/></geometry></visual>'
        '<visual><geometry><sphere radius="nan"/></geometry></visual><visual>'
        '<geometry><box size="0.1 0.1 0.1"/></geometry><material name="a"><color rgba="2 0 0 1"/>'
        '<texture filename="http://example.org/a.png"/></material></visual>'
    )
    urdf = shapes_of(load(arm(tmp_path, [visual, "", "", ""]))).urdf
    assert urdf.count("<visual") == 1
    assert 'rgba="1 0 0 1"' in urdf
    assert "texture" not in urdf


def test_long_movements_are_thinned_and_the_page_says_so(tmp_path):
    robot = load(arm(tmp_path))
    t = np.linspace(0, 50, 2000)
    made = move(Trajectory(times=t, positions=0.3 * np.sin(t)[:, None] * np.ones(3)), robot, space="joints", force=True)
    page = view_page(made)
    times = Parsed(page).data["times"]
    assert len(times) == MOST_SAMPLES
    assert (times[0], times[-1]) == (0.0, pytest.approx(made.trajectory.duration, abs=1e-6))
    assert f"{MOST_SAMPLES:,} of {len(made.trajectory):,} samples are in this page" in page


def test_the_page_is_written_whole(tmp_path, panda, page):
    assert write_view(tmp_path / "wave.html", panda).read_text(encoding="utf-8") == page
    assert [path.name for path in tmp_path.iterdir()] == ["wave.html"]
    with pytest.raises(FileNotFoundError, match="create it"):
        write_view(tmp_path / "none" / "wave.html", panda)
