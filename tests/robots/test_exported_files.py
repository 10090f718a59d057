"""Files of joint trajectories: numbers that YAML takes for texts, paths as texts, rates without end, equal names."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import kineme
from kineme.errors import SpecificationError, TrajectoryError
from kineme.robots import JointTrajectory, load, move, write_action_goal, write_bag, write_joints, write_lerobot


@pytest.fixture
def trajectory():
    q = np.array([[0.0, 1e-05], [1e16, -2e-07], [5e-324, 0.1], [-0.0, 123456789.0]])
    return JointTrajectory(("a 1e-05", "b"), np.arange(4.0), q, q + 1, q - 2, {})


_YAML_FLOAT = re.compile(r"[-+]?[0-9]+\.[0-9]*([eE][-+][0-9]+)?")  # of YAML 1.1, as PyYAML and so ROS 2 read it


def test_numbers_of_a_goal_are_numbers_in_yaml_of_version_1_1_too(trajectory, tmp_path):
    text = write_action_goal(tmp_path / "goal.yaml", trajectory).read_text()
    goal = json.loads(text)["trajectory"]
    assert goal["joint_names"] == ["a 1e-05", "b"]
    for name in ("positions", "velocities", "accelerations"):
        np.testing.assert_array_equal([point[name] for point in goal["points"]], getattr(trajectory, name))
    assert [point["time_from_start"] for point in goal["points"]] == [{"sec": k, "nanosec": 0} for k in range(4)]
    written = re.findall(r'"positions": \[(.*?)\]', text)
    assert len(written) == 4
    assert all(_YAML_FLOAT.fullmatch(number) for row in written for number in row.split(", "))


def test_paths_may_be_texts(trajectory, tmp_path):
    assert write_joints(f"{tmp_path}/joints.csv", trajectory).is_file()
    assert write_action_goal(f"{tmp_path}/goal.json", trajectory).is_file()
    text = (tmp_path / "joints.csv").read_text().splitlines()
    assert text[0] == "time,a 1e-05 [rad],b [rad],v_a 1e-05 [rad/s],v_b [rad/s],a_a 1e-05 [rad/s^2],a_b [rad/s^2]"
    t = trajectory
    columns = np.column_stack((t.times, t.positions, t.velocities, t.accelerations))
    np.testing.assert_array_equal(np.array([line.split(",") for line in text[1:]], dtype=float), columns)


def test_paths_of_bags_and_data_sets_may_be_texts(trajectory, tmp_path):
    pytest.importorskip("rosbags", reason="the extra ros is not installed")
    pytest.importorskip("pyarrow", reason="the extra parquet is not installed")
    assert write_bag(f"{tmp_path}/plan.mcap", trajectory).is_file()
    assert write_bag(f"{tmp_path}/plan", trajectory).is_dir()
    assert write_lerobot(f"{tmp_path}/set", trajectory, "task") == 0


def test_the_trajectory_of_a_bag_is_sent_at_its_beginning_and_states_at_their_times(trajectory, tmp_path):
    rosbags = pytest.importorskip("rosbags.highlevel", reason="the extra ros is not installed")
    with rosbags.AnyReader([write_bag(tmp_path / "plan.bag", trajectory)]) as bag:
        sent = [(connection.msgtype, stamp) for connection, stamp, _ in bag.messages()]
    assert sent[0] == ("trajectory_msgs/msg/JointTrajectory", 0)
    assert [stamp for kind, stamp in sent[1:]] == [0, 10**9, 2 * 10**9, 3 * 10**9]


@pytest.mark.parametrize("name", ["plan.bag", "plan.mcap"])
def test_a_bag_says_the_units_in_the_definitions_of_its_types(trajectory, tmp_path, name):
    rosbags = pytest.importorskip("rosbags.highlevel", reason="the extra ros is not installed")
    slid = replace(trajectory, units=("rad", "m"))
    with rosbags.AnyReader([write_bag(tmp_path / name, slid)]) as bag:
        definitions = [one.msgdef.data for one in bag.connections]
        messages = [bag.deserialize(raw, one.msgtype) for one, _, raw in bag.messages()]
    assert len(definitions) == 2
    assert all(one.startswith("# positions of a 1e-05 [rad], b [m]; velocities per s") for one in definitions)
    np.testing.assert_array_equal(messages[-1].position, slid.positions[-1])


def test_frames_without_end_are_refused_before_they_fill_the_memory(trajectory, tmp_path):
    with pytest.raises(SpecificationError, match=r"fps to be a number .* 10000, got 1000000000000"):
        write_lerobot(tmp_path / "set", trajectory, "task", 10**12)
    assert not (tmp_path / "set").exists()


def test_a_discrete_channel_is_not_called_as_a_joint():
    pytest.importorskip("pinocchio", reason="the extra robot is not installed")
    robot = load("ur5e")
    still = kineme.Trajectory(times=np.linspace(0, 3, 50), positions=np.tile(robot.rest, (50, 1)))
    with pytest.raises(TrajectoryError, match="other names than the joints have, got 'elbow_joint'"):
        move(still, robot, steps={"elbow_joint": np.zeros(50)})
    with pytest.raises(SpecificationError, match="expected steps as a dict"):
        move(still, robot, steps={1: np.zeros(50)})
