"""``kineme move``: joints for an arm, checked before they are written."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import kineme
from arm_samples import standing
from kineme.cli import main

ROOT = Path(__file__).parents[2]

pytest.importorskip("pinocchio", reason="the extra robot is not installed")


@pytest.fixture
def wave(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    u = np.linspace(0, 1, 120)
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    columns = (2 * u, 0.3 * s, 0.05 * np.sin(2 * np.pi * s), 0.1 * np.sin(2 * np.pi * s), u > 0.5)
    np.savetxt("wave.csv", np.column_stack(columns), delimiter=",", header="time,x,y,z,gripper", comments="")
    return tmp_path


def run(*words):
    return CliRunner().invoke(main, ["move", *map(str, words)])


def test_joints_are_written_with_their_names_and_the_gripper_steps(wave):
    result = run("wave.csv", "--robot", "panda", "--at", "0.45,-0.2,0.3", "--slow-down", "-o", "joints.csv")
    assert result.exit_code == 0, result.output
    assert "self-collision" in result.output
    heads = (wave / "joints.csv").read_text().splitlines()[0].split(",")
    assert heads[:9] == ["time", *(f"panda_joint{k} [rad]" for k in range(1, 8)), "gripper"]
    gripper = np.loadtxt(wave / "joints.csv", delimiter=",", skiprows=1)[:, 8]
    assert set(gripper) == {0.0, 1.0}
    assert np.count_nonzero(np.diff(gripper)) == 1


def test_examples_of_pages_and_of_the_help_pass_with_the_wave_of_the_tutorial(tmp_path, monkeypatch):
    sines = [replace(one, positions=one.positions[::5] / 100 + [0.5, 0.0], times=one.times[::5])
             for one in kineme.load_lasa(["Sine"])[:5]]  # fmt: skip
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(sines, labels=["wave"] * 5)
    pages = [
        path.read_text() for path in (ROOT / "README.md", ROOT / "docs" / "index.md", *ROOT.glob("docs/guide/*.md"))
    ]
    pages.append(main.commands["move"].help)
    examples = {
        match for page in pages for match in re.findall(r"kineme move (wave .*--robot panda( --[agls].*?)?) -o", page)
    }
    assert len(examples) == 3
    monkeypatch.chdir(tmp_path)
    for words, _ in examples:
        result = run(*words.split())
        assert result.exit_code == 0, f"{words}: {result.output[:300]}"


def test_what_fails_a_check_is_not_written_without_force(wave):
    words = ("wave.csv", "--robot", "ur5e", "--duration", "0.3", "-o", "joints.csv")
    result = run(*words)
    assert result.exit_code == 1
    assert "FAILED" in result.output
    assert "--slow-down" in result.output
    assert not (wave / "joints.csv").exists()
    assert run(*words, "--force").exit_code == 0
    assert (wave / "joints.csv").exists()


def test_the_order_of_the_axes_in_a_file_moves_no_joint_otherwise(wave):
    t, x, y, z, _ = np.loadtxt("wave.csv", delimiter=",", skiprows=1).T
    written = []
    for name, columns in (("x,y,z", (x, y, z)), ("z,x,y", (z, x, y))):
        np.savetxt("order.csv", np.column_stack((t, *columns)), delimiter=",", header=f"time,{name}", comments="")
        result = run("order.csv", "--robot", "panda", "--at", "0.45,-0.2,0.3", "--slow-down", "-o", f"{name[0]}.csv")
        assert result.exit_code == 0, result.output
        written.append(np.loadtxt(f"{name[0]}.csv", delimiter=",", skiprows=1))
    np.testing.assert_allclose(*written, atol=1e-6)


def test_a_goal_needs_a_start(wave):
    result = run("wave.csv", "--robot", "panda", "--goal", "0.5,0,0.4")
    assert result.exit_code == 2
    assert "expected --at with --goal" in result.output
    assert "--joints" in result.output  # whose columns do not say that they are joints


def test_the_tip_ends_at_the_goal(wave):
    from kineme.robots import load

    words = ("--robot", "wam", "--at", "0.45,-0.2,0.3", "--goal", "0.5,0.2,0.4", "--duration", "6", "-o", "joints.csv")
    result = run("wave.csv", *words)
    assert result.exit_code == 0, result.output
    q = np.loadtxt(wave / "joints.csv", delimiter=",", skiprows=1)[-1, 1:8]
    np.testing.assert_allclose(standing(load("wam"), q).tip_positions[0], [0.5, 0.2, 0.4], atol=5e-3)


def test_bags_and_goals_hold_the_same_joints(wave):
    pytest.importorskip("rosbags", reason="the extra ros is not installed")
    words = ("--at", "0.45,-0.2,0.3", "--slow-down", "-o", "j.csv", "--ros1", "w.bag", "--ros2", "w.mcap")
    result = run("wave.csv", "--robot", "panda", *words, "--action-goal", "goal.yaml")
    assert result.exit_code == 0, result.output
    assert 'note: the steps of "gripper" are not in an action goal' in result.output
    from pathlib import Path

    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    joints = np.loadtxt("j.csv", delimiter=",", skiprows=1)[:, 1:8]
    for name, version in (("w.bag", Stores.ROS1_NOETIC), ("w.mcap", Stores.LATEST)):
        with AnyReader([Path(name)], default_typestore=get_typestore(version)) as reader:
            found = {c.topic: reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages()}
        points = found["/joint_trajectory_controller/joint_trajectory"].points
        np.testing.assert_array_equal([point.positions for point in points], joints)
    goal = json.loads(Path("goal.yaml").read_text())["trajectory"]
    np.testing.assert_array_equal([point["positions"] for point in goal["points"]], joints)


def test_an_input_is_never_written_over(wave):
    assert run("wave.csv", "--robot", "panda", "-o", "wave.csv", "--force").exit_code == 2


def test_a_page_in_which_the_arm_moves_is_written(wave):
    words = ("wave.csv", "--robot", "panda", "--at", "0.45,-0.2,0.3", "--slow-down", "--view", "wave.html")
    assert run(*words).exit_code == 0
    assert "panda_joint7 over time" in (wave / "wave.html").read_text(encoding="utf-8")
    assert "wave.html" in run(*words).output  # is there already
    assert run(*words, "--force").exit_code == 0


def test_to_write_over_a_file_does_not_need_what_lets_failed_checks_pass(wave):
    words = ("wave.csv", "--robot", "panda", "--at", "0.45,-0.2,0.3", "-o", "joints.csv")
    assert run(*words, "--slow-down").exit_code == 0
    before = (wave / "joints.csv").read_bytes()
    again = run(*words)
    assert again.exit_code == 2
    assert "write over it with --overwrite" in again.output
    assert run(*words, "--duration", "0.3", "--overwrite").exit_code == 1  # fails a check
    assert (wave / "joints.csv").read_bytes() == before
    assert run(*words, "--slow-down", "--duration", "3", "--overwrite").exit_code == 0
    assert (wave / "joints.csv").read_bytes() != before


def test_what_was_assumed_is_said_of_what_is_refused_too(wave):
    result = run("wave.csv", "--robot", "wam", "--duration", "0.2")
    assert result.exit_code == 1
    assert "note: its maker publishes no limits of velocity" in result.output


def test_what_is_written_although_it_failed_is_said(wave):
    result = run("wave.csv", "--robot", "panda", "--duration", "0.3", "-o", "joints.csv", "--force")
    assert result.exit_code == 0
    assert "written because of --force" in result.output


@pytest.mark.parametrize(
    ("option", "name", "expected"),
    [
        ("--ros1", "w.mcap", ".bag"),
        ("--ros2", "w.bag", ".mcap, a folder"),
        ("--ros2", "w.db3", ".mcap, a folder"),
        ("--view", "w.txt", ".html"),
        ("--plot", "w", ".png"),
        ("--action-goal", "w.csv", ".yaml"),
        ("-o", "w.xlsx", ".csv"),
    ],
)
def test_a_file_of_another_kind_is_refused_before_anything_is_read(wave, option, name, expected):
    result = run("wave.csv", "--robot", "no such arm", option, name)
    assert result.exit_code == 2, result.output
    assert f"expected {expected}" in result.output


def test_a_folder_that_is_there_is_refused_with_what_to_do(wave):
    (wave / "bag").mkdir()
    result = run("wave.csv", "--robot", "no such arm", "--ros2", "bag", "--force")
    assert result.exit_code == 2, result.output
    assert "the folder bag is there, and no option writes over folders; choose another name" in result.output


def test_an_arm_at_rest_elsewhere_turns_its_tip_as_there(wave):
    words = ("wave.csv", "--robot", "ur5e", "--slow-down", "-o")
    assert run(*words, "a.csv").exit_code == 0
    result = run(*words, "b.csv", "--rest", "0,-1.2,1.4,-1.8,-1.5708,0")
    assert result.exit_code == 0, result.output
    first = np.loadtxt(wave / "b.csv", delimiter=",", skiprows=1)[0, 1:7]
    np.testing.assert_allclose(first, [0, -1.2, 1.4, -1.8, -1.5708, 0])


def test_a_movement_in_millimeters_is_asked_for_its_unit(wave):
    columns = np.loadtxt("wave.csv", delimiter=",", skiprows=1) * [1, 1000, 1000, 1000, 1]
    np.savetxt("mm.csv", columns, delimiter=",", header="time,x,y,z,gripper", comments="")
    result = run("mm.csv", "--robot", "panda")
    assert result.exit_code == 1
    assert "--scale 0.001" in result.output
    assert run("mm.csv", "--robot", "panda", "--scale", "0.001", "--slow-down").exit_code == 0


def test_what_takes_as_long_as_generated_is_not_said_to_take_once_as_long(wave):
    result = run("wave.csv", "--robot", "panda", "--duration", "3")
    assert result.exit_code == 0, result.output
    assert "as long as generated" not in result.output


def test_the_last_line_says_what_was_written_or_that_nothing_was(wave):
    words = ("wave.csv", "--robot", "panda", "--slow-down")
    assert run(*words).output.splitlines()[-1].startswith("checked only, nothing written")
    assert run(*words, "-o", "j.csv", "--view", "v.html").output.splitlines()[-1] == "wrote j.csv, v.html"
    assert "wrote" not in run(*words, "-o", "-").output


@pytest.mark.parametrize("path", ["none/j.csv", "there.csv"])
def test_what_cannot_be_written_is_refused_before_anything_else_is(wave, path):
    (wave / "there.csv").mkdir()
    result = run("wave.csv", "--robot", "no such arm", "--view", "v.html", "-o", path, "--overwrite")
    assert result.exit_code == 2
    assert path in result.output
