"""``kineme move --lerobot``: episodes named by the symbol, one behind the other."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

import kineme
from kineme.cli import main
from kineme.robots import load
from lerobot_sets import write_so101

pytest.importorskip("pinocchio", reason="the extra robot is not installed")


def test_episodes_are_appended_and_named(tmp_path):
    u = np.linspace(0, 1, 100)
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    path = kineme.write_movement(
        tmp_path / "reach.csv", {"times": 3 * u, "positions": np.column_stack((0.2 * s, 0.1 * s, 0 * s))}
    )
    words = ["move", path, "--robot", "panda", "--at", "0.45,0,0.3", "--lerobot", tmp_path / "set", "--fps", 20]
    for _ in range(2):
        done = CliRunner().invoke(main, [*map(str, words)])
        assert done.exit_code == 0, done.output
    found = kineme.read_recordings(tmp_path / "set")
    assert (found.labels.tolist(), found.problems) == (["reach", "reach"], ())
    assert found.demonstrations.dimensions[0] == "panda_joint1.pos [deg]"
    refused = CliRunner().invoke(main, [*map(str, words[:-1]), "25"])
    assert refused.exit_code
    assert len(kineme.read_recordings(tmp_path / "set").demonstrations) == 2


@pytest.fixture(scope="module")
def placing(tmp_path_factory):
    """A data set of an SO-101 in degrees, as LeRobot records it, and a library that learned it."""
    folder = tmp_path_factory.mktemp("so101")
    u = np.linspace(0, 1, 90)[:, None]
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    ends = [np.array([30, 25, -20, 15, 10, 60]) + k for k in range(3)]
    start = np.array([0, -35, 50, 50, 0, 5])
    write_so101(folder / "set", [start + s * end for end in ends], "place cup")
    done = CliRunner().invoke(main, ["learn", str(folder / "set"), "--library", str(folder / "actions")])
    assert done.exit_code == 0, done.output
    return folder


@pytest.mark.parametrize("units", [[], ["--joint-units", "deg"]])
def test_a_set_of_an_so101_in_degrees_runs_on_its_arm(placing, tmp_path, units):
    words = ["move", "place cup", "--library", placing / "actions", "--robot", "so101", *units]
    done = CliRunner().invoke(main, [*map(str, words), "-o", str(tmp_path / "joints.csv"), "--slow-down"])
    assert done.exit_code == 0, done.output
    assert ("are taken as degrees, as LeRobot's drivers give them" in done.output) == (not units)
    heads = (tmp_path / "joints.csv").read_text().splitlines()[0].split(",")
    assert heads[1:7] == [*(f"{name} [rad]" for name in load("so101").joints), "gripper.pos"]
    assert heads[7] == "v_shoulder_pan [rad/s]"
    last = np.loadtxt(tmp_path / "joints.csv", delimiter=",", skiprows=1)[-1, 1:7]
    np.testing.assert_allclose(np.degrees(last[:5]), [31, -9, 31, 66, 11], atol=1.5)
    assert 64 < last[5] < 68


def test_percent_is_between_the_limits_of_the_arm(placing, tmp_path):
    words = ["move", "place cup", "--library", placing / "actions", "--robot", "so101", "--joint-units", "percent"]
    files = ["-o", tmp_path / "joints.csv", "--lerobot", tmp_path / "set"]
    done = CliRunner().invoke(main, [*map(str, (*words, *files)), "--slow-down"])
    assert done.exit_code == 0, done.output
    robot = load("so101")
    last = np.loadtxt(tmp_path / "joints.csv", delimiter=",", skiprows=1)[-1, 1:6]
    share = (last - robot.lower) / (robot.upper - robot.lower)
    np.testing.assert_allclose(200 * share - 100, [31, -9, 31, 66, 11], atol=1.5)
    states = kineme.read_recordings(tmp_path / "set").demonstrations[0]
    assert [one.name for one in states.channels][:2] == [
        "shoulder_pan.pos [-100..100]",
        "shoulder_lift.pos [-100..100]",
    ]
    np.testing.assert_allclose(states.recorded[-1, :5], 200 * share - 100, atol=1e-3)
    info = json.loads((tmp_path / "set/meta/info.json").read_text())["features"]["observation.state"]
    assert info["names"][4:] == ["wrist_roll.pos", "gripper.pos"]
    assert info["units"][4:] == ["-100..100", None]


def test_degrees_in_radians_are_refused_with_the_option(placing):
    words = ["move", "place cup", "--library", placing / "actions", "--robot", "so101", "--joint-units", "rad"]
    done = CliRunner().invoke(main, [*map(str, words)])
    assert done.exit_code == 1
    assert "if these are degrees, say joint_units='deg'" in done.output
    assert "--joint-units" in done.output


def test_options_of_recordings_are_refused_beside_a_symbol(placing):
    for option in (["--columns", "shoulder_pan.pos"], ["--kind", "gripper.pos=discrete"], ["--index", "0"]):
        words = ["move", "place cup", "--library", placing / "actions", "--robot", "so101", *option]
        done = CliRunner().invoke(main, [*map(str, words)])
        assert done.exit_code == 2
        assert f"say {option[0]} to kineme learn" in done.output


def test_a_file_beside_a_library_is_refused_with_the_option(placing):
    (placing / "a.csv").write_text("t,x\n")
    for command in ("generate", "export", "move"):
        done = CliRunner().invoke(main, [command, str(placing / "a.csv"), "--library", str(placing / "actions"),
                                         *(["--c", str(placing / "a.h")] if command == "export" else []),
                                         *(["--robot", "so101"] if command == "move" else [])])  # fmt: skip
        assert done.exit_code == 2
        assert "leave --library out for a recording" in done.output


def test_the_task_is_the_name_of_the_symbol(tmp_path):
    u = np.linspace(0, 1, 100)
    for k in range(3):
        columns = {"times": 3 * u, "positions": np.column_stack((0.2 * u, (0.1 + k / 90) * u**2, 0 * u))}
        kineme.write_movement(tmp_path / f"{k}.csv", columns)
    with kineme.ActionLibrary(tmp_path / "library", create=True) as library:
        library.learn([kineme.read_recording(tmp_path / f"{k}.csv") for k in range(3)], labels=["pour it"] * 3)
        (symbol,) = library.symbols()
    words = ["--library", tmp_path / "library", "--robot", "panda", "--slow-down", "--lerobot", tmp_path / "set"]
    for source in ("pour it", symbol.id):
        done = CliRunner().invoke(main, ["move", *map(str, (source, *words))])
        assert done.exit_code == 0, done.output
    assert kineme.read_recordings(tmp_path / "set").labels.tolist() == ["pour it", "pour it"]
