"""Arms in the studio."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from studio_samples import drawing

from kineme import ActionLibrary, Trajectory, read_recordings
from kineme.errors import DataError
from kineme.io.writing.write_movement import WRITERS
from kineme.robots import load
from kineme.robots.kinematics import descent as reach
from kineme.robots.kinematics.descent import kinematics
from kineme.robots.models.robot import MODELS
from kineme.robots.planning import robot_movement as refusal
from kineme.studio.server import robot_routes
from kineme.studio.server.refusals import in_studio_words

SIZE = 0.15  # meters on the arm


@pytest.fixture
def symbol(client):
    return client.get("/api/library").json()["symbols"][0]["id"]


@pytest.fixture
def arms(client):
    pytest.importorskip("pinocchio")
    answer = client.get("/api/robots").json()
    assert (answer["available"], answer["why"]) == (True, None)
    return answer["robots"]


def _move(client, symbol, **wanted):
    body = {"what": {"symbol": symbol}, "robot": "panda", "size": SIZE, "slow_down": True, **wanted}
    return client.post("/api/robots/move", json=body)


def test_an_arm_executes_a_symbol_with_its_checks_and_what_draws_it(client, symbol, arms):
    assert "panda" in arms
    moved = _move(client, symbol)
    assert moved.status_code == 200, moved.text
    moved = moved.json()
    assert (moved["passed"], moved["refusal"]) == (True, None)
    assert {"velocity", "acceleration", "position"} <= {check["what"] for check in moved["checks"]}
    assert all(check["passed"] for check in moved["checks"])
    assert len(moved["joints"]) == 7
    assert moved["joints"][0]["low"] < moved["joints"][0]["high"]
    scene = moved["scene"]
    assert len(scene["times"]) == len(scene["positions"]) == len(scene["executed"])
    assert "<robot" in scene["urdf"]
    without = _move(client, symbol, shapes=False).json()["scene"]
    assert without == {**scene, "urdf": "", "meshes": []}


def test_what_an_arm_must_not_do_is_refused_with_the_checks_that_failed(client, symbol, arms):
    moved = _move(client, symbol, duration=0.2, slow_down=False).json()
    assert (moved["passed"], moved["scene"]) == (False, None)
    assert "cannot execute" in moved["refusal"] or "expected" in moved["refusal"]
    assert not moved["checks"] or not all(check["passed"] for check in moved["checks"])
    assert "tick 'Slow down where limits need it'" in moved["refusal"]
    assert "--" not in moved["refusal"]


def test_what_to_do_about_a_refusal_is_there_in_the_studio(client, symbol, arms):
    large = _move(client, symbol, size=3.0).json()["error"]
    assert large.endswith("m away; make the movement smaller")
    for text in (reach._REMEDY, reach._MILLIMETERS, refusal._ELSEWHERE, refusal.OTHER_JOINTS):
        assert "--" not in in_studio_words(text)


@pytest.mark.parametrize("d", [1, 4])
def test_an_arm_that_has_nowhere_to_go_says_which_movements_it_needs(open_studio, tmp_path, arms, d):
    with ActionLibrary(tmp_path / "other", create=True) as library:
        t, x = drawing(0)
        library.learn([Trajectory(t, np.tile(x, 2)[:, :d])], ["other"])
    other = open_studio(tmp_path / "other")
    refused = _move(other, other.get("/api/library").json()["symbols"][0]["id"]).json()["error"]
    assert f"of 2 or 3 dimensions, got {d}; make a library" in refused
    assert "make a library of movements in the plane or in space" in refused


@pytest.mark.parametrize("robot", ["/etc/passwd", "x.urdf", "", "../panda.urdf"])
def test_no_file_of_the_server_is_an_arm(client, symbol, robot):
    answer = _move(client, symbol, robot=robot)
    assert answer.status_code == 400
    assert "expected one of the arms panda" in answer.json()["error"]


def test_a_goal_without_a_start_is_refused(client, symbol, arms):
    assert _move(client, symbol, goal=[0.5, 0.0, 0.4]).status_code == 400
    assert _move(client, symbol, displacement=[0.5, 0.0, 0.4]).status_code == 400  # the library is in the plane


def test_the_goal_may_be_where_it_was_dragged_to_in_the_library_s_unit(client, symbol, arms):
    shown = client.post("/api/rollout", json={"what": {"symbol": symbol}}).json()["positions"]
    way = np.subtract(shown[-1], shown[0]) * [1.2, -1.0]
    wanted = np.array(_move(client, symbol, displacement=way.tolist()).json()["scene"]["wanted"])
    scale = SIZE / np.ptp(shown, axis=0).max()
    np.testing.assert_allclose((wanted[-1] - wanted[0])[:2], way * scale, rtol=0.02, atol=0.002)


def test_without_the_extra_it_says_what_to_install(client, monkeypatch):
    def load(name):
        raise DataError("expected the package pin for arms; pip install 'kineme[robot]'")

    monkeypatch.setattr(robot_routes, "load", load)
    answer = client.get("/api/robots").json()
    assert (answer["available"], answer["robots"]) == (False, [])
    assert "kineme[robot]" in answer["why"]


def test_an_arm_stands_at_rest_before_it_has_moved(client, arms):
    for name in arms:
        answer = client.get(f"/api/robots/{name}").json()
        scene, robot = answer["scene"], load(name)
        np.testing.assert_allclose(scene["positions"], [robot.rest], atol=1e-6)
        assert (scene["times"], answer["checks"], answer["table"]) == ([0.0], [], [])
    assert client.get("/api/robots/other").status_code == 400


def test_the_table_says_what_the_checks_say(client, symbol, arms):
    moved = _move(client, symbol).json()
    assert all(row[0].startswith(check["what"]) for row, check in zip(moved["table"], moved["checks"], strict=True))
    assert {row[-1] for row in moved["table"]} <= {"ok", ""}


def test_the_joints_are_saved_in_each_format_of_the_page(client, symbol, arms, tmp_path):
    page = (Path(robot_routes.__file__).parents[1] / "web" / "index.html").read_text()
    formats = re.findall(r'value="(\w+)"', page[page.index('id="robot-format"') : page.index('id="robot-save"')])
    assert [f".{each}" for each in formats] == [".csv", ".json", ".npz", ".parquet", ".yaml", ".mcap", ".bag"]
    drawn = re.findall(r'value="(\w+)"', page[page.index('id="export-format"') : page.index('id="export"')])
    assert sorted(f".{each}" for each in drawn) == sorted(WRITERS)
    moved = _move(client, symbol).json()["scene"]
    body = {"what": {"symbol": symbol}, "robot": "panda", "size": SIZE, "slow_down": True}
    for each in formats:
        saved = client.post("/api/robots/export", json={**body, "format": each})
        assert saved.status_code == 200, saved.text
        assert f"kind_0_on_panda.{each}" in saved.headers["Content-Disposition"]
        (tmp_path / f"joints.{each}").write_bytes(saved.content)
    goal = json.loads((tmp_path / "joints.yaml").read_text())["trajectory"]
    np.testing.assert_allclose([point["positions"] for point in goal["points"]], moved["positions"], atol=1e-5)
    table = np.loadtxt(tmp_path / "joints.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(table[:, 1:8], moved["positions"], atol=1e-5)
    assert client.post("/api/robots/export", json={**body, "format": "exe"}).status_code == 400
    refused = client.post("/api/robots/export", json={**body, "duration": 0.2, "slow_down": False, "format": "csv"})
    assert refused.status_code == 400  # what must not be executed is not saved


@pytest.mark.parametrize("name", MODELS)
def test_the_tip_follows_a_hand(client, arms, name):
    robot, joints = load(name), None
    home = kinematics(robot, robot.rest[None])[0][0]
    for hand in ([0.0, 0.0], [0.3, 0.0], [0.6, 0.3], [0.6, 0.6], [9.0, -0.2]):
        answer = client.post("/api/robots/follow", json={"robot": name, "hand": hand, "joints": joints}).json()
        joints = answer["joints"]
        tip = kinematics(robot, np.array([joints]))[0][0]
        across, up = np.clip(hand, -1, 1) * 0.4 * np.linalg.norm(home)
        wanted = np.add(home, [0.0, across, up])
        assert answer["distance"] == pytest.approx(np.linalg.norm(tip - wanted), abs=1e-9)
        assert answer["distance"] < 0.005 or hand[0] == 9.0
        assert (robot.lower <= joints).all()
        assert (robot.upper >= joints).all()
    assert client.post("/api/robots/follow", json={"robot": name, "hand": [0, 0], "joints": [0.0]}).status_code == 400


def test_a_start_and_a_goal_may_be_where_they_were_dragged_on_the_arm(client, symbol, arms):
    scene = _move(client, symbol).json()["scene"]
    at, goal = np.array(scene["start"]), np.add(scene["goal"], [0.02, -0.03, 0.0])
    goal[2] = at[2]
    wanted = np.array(_move(client, symbol, at=at.tolist(), goal=goal.tolist()).json()["scene"]["wanted"])
    np.testing.assert_allclose(wanted[[0, -1]], [at, goal], atol=1e-5)


@pytest.fixture
def poses(tmp_path, open_studio):
    """A studio of movements of a tip with its orientation and a gripper in millimeters, and its symbol."""
    s, t = 0.5 - 0.5 * np.cos(np.linspace(0, np.pi, 100)), np.linspace(0, 4, 100)
    path = np.column_stack((0.3 + 0.1 * s, 0.05 * np.sin(np.pi * s), 0.4 - 0.05 * s))
    turned = np.column_stack((np.cos(0.2 * s), np.zeros((100, 2)), np.sin(0.2 * s)))
    table = np.column_stack((t, turned, path, np.where(s > 0.9, 0.0, 85.0)))
    head = "time,qw,qx,qy,qz,x [m],y [m],z [m],gripper"
    np.savetxt(tmp_path / "pick.csv", table, delimiter=",", header=head, comments="")
    with ActionLibrary(tmp_path / "poses", create=True) as library:
        library.learn(read_recordings(tmp_path / "pick.csv").demonstrations, ["pick"])
    client = open_studio(tmp_path / "poses")
    return client, client.get("/api/library").json()["symbols"][0]["id"]


def test_the_size_is_that_of_the_path_of_the_tip(poses, arms):
    wanted = np.array(_move(*poses, at=[0.45, 0.0, 0.45]).json()["scene"]["wanted"])
    assert np.ptp(wanted, axis=0).max() == pytest.approx(SIZE, rel=1e-3)


def test_a_goal_for_an_arm_says_that_the_gripper_is_not_in_it(poses, arms):
    client, symbol = poses
    body = {"what": {"symbol": symbol}, "robot": "panda", "size": 0.1, "at": [0.45, 0.0, 0.45], "slow_down": True}
    note, goal = client.post("/api/robots/export", json={**body, "format": "yaml"}).text.splitlines()
    assert note == '# the steps of "gripper" are not in an action goal, which is of joints alone; send them yourself'
    assert "points" in json.loads(goal)["trajectory"]


def test_a_goal_that_was_dragged_is_met_by_what_has_an_orientation(poses, arms):
    client, symbol = poses
    shown = client.post("/api/rollout", json={"what": {"symbol": symbol}}).json()
    way = np.subtract(shown["goal"], shown["start"])
    assert len(way) == 7
    positions = [shown["columns"].index(f"{axis} [m]") for axis in "xyz"]
    way[positions] += [0.02, 0.01, 0.0]
    at = [0.45, 0.0, 0.45]
    of_all, of_positions = (
        np.array(_move(client, symbol, at=at, size=0.1, displacement=each.tolist()).json()["scene"]["wanted"])
        for each in (way, way[positions])
    )
    np.testing.assert_allclose(of_all, of_positions)
    np.testing.assert_allclose(of_all[-1] - of_all[0], way[positions], atol=1e-4)
    way[shown["columns"].index("qz")] += 0.1
    assert "a displacement of x [m], y [m], z [m] alone" in _move(client, symbol, displacement=way.tolist()).text


def test_a_displacement_is_that_of_its_columns_in_whichever_order_they_are(tmp_path, open_studio, arms):
    s = np.linspace(0, 1, 100)
    table = np.column_stack((2 * s, 0.4 - 0.05 * s, 0.05 * np.sin(np.pi * s), 0.3 + 0.1 * s))
    np.savetxt(tmp_path / "pick.csv", table, delimiter=",", header="time,z [m],y [m],x [m]", comments="")
    with ActionLibrary(tmp_path / "heights", create=True) as library:
        library.learn(read_recordings(tmp_path / "pick.csv").demonstrations, ["pick"])
    client = open_studio(tmp_path / "heights")
    symbol = client.get("/api/library").json()["symbols"][0]["id"]
    moved = _move(client, symbol, at=[0.45, 0.0, 0.45], size=0.1, displacement=[-0.04, 0.01, 0.1])
    wanted = np.array(moved.json()["scene"]["wanted"])
    np.testing.assert_allclose(wanted[-1] - wanted[0], [0.1, 0.01, -0.04], atol=1e-4)
