"""Trajectories of joints as ROS itself takes them: a node that receives one, messages filled from a goal, a bag."""

import json

import numpy as np
import pytest

from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.export_files import STATES, TOPIC, write_action_goal, write_bag
from ros_programs import ros_1, ros_2

_AS_SAID = """
def as_said(message, seconds):
    return {
        "names": list(message.joint_names),
        "times": [seconds(p.time_from_start) for p in message.points],
        "positions": [list(p.positions) for p in message.points],
        "velocities": [list(p.velocities) for p in message.points],
        "accelerations": [list(p.accelerations) for p in message.points],
    }

"""

_RECEIVE = (
    _AS_SAID
    + """
import json, sys, time
import rclpy
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

goal = json.load(open(sys.argv[1]))["trajectory"]
message = JointTrajectory(joint_names=goal["joint_names"])
for point in goal["points"]:
    since = point.pop("time_from_start")
    made = JointTrajectoryPoint(**point)
    made.time_from_start.sec, made.time_from_start.nanosec = since["sec"], since["nanosec"]
    message.points.append(made)
rclpy.init()
arm, sender = rclpy.create_node("arm"), rclpy.create_node("sender")
received = []
arm.create_subscription(JointTrajectory, sys.argv[2], received.append, 10)
publisher = sender.create_publisher(JointTrajectory, sys.argv[2], 10)
until = time.monotonic() + 20
while not received and time.monotonic() < until:
    if publisher.get_subscription_count():
        publisher.publish(message)
    rclpy.spin_once(arm, timeout_sec=0.1)
rclpy.shutdown()
one = received[0]
print(json.dumps(as_said(one, lambda since: since.sec + since.nanosec / 1e9)))
"""
)

_READ_2 = (
    _AS_SAID
    + """
import json, sys
from rclpy.serialization import deserialize_message
from trajectory_msgs.msg import JointTrajectory

one = deserialize_message(bytes.fromhex(sys.stdin.read()), JointTrajectory)
print(json.dumps(as_said(one, lambda since: since.sec + since.nanosec / 1e9)))
"""
)

_READ_1 = (
    _AS_SAID
    + """
import json, sys
import rosbag

with rosbag.Bag(sys.argv[1]) as bag:
    one = [m for _, m, _ in bag.read_messages(sys.argv[2])][0]
    states = [m for _, m, _ in bag.read_messages(sys.argv[3])]
print(json.dumps(as_said(one, lambda since: since.to_sec()) | {
    "states": [list(m.position) for m in states],
    "stamps": [m.header.stamp.to_sec() for m in states],
    "state_names": states[0].name,
}))
"""
)


@pytest.fixture
def trajectory():
    t = np.arange(80) / 50
    q = np.column_stack((np.sin(t), t**2, np.cos(3 * t)))
    grip = np.where(t < 0.8, 0.0, 1.0)
    return JointTrajectory(("a", "longer_name", "c"), t, q, np.gradient(q, t, axis=0), -q, {"grip": grip})


def check(said, trajectory):
    assert said["names"] == list(trajectory.joints)
    np.testing.assert_allclose(said["times"], trajectory.times, atol=1e-9)
    for name in ("positions", "velocities", "accelerations"):
        np.testing.assert_array_equal(said[name], getattr(trajectory, name))


def test_a_node_receives_the_goal_over_the_network_of_this_machine(trajectory, tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    path = write_action_goal(tmp_path / "goal.yaml", trajectory)
    check(json.loads(ros_2(_RECEIVE, path, TOPIC)), trajectory)


def test_a_bag_holds_what_ros_2_deserializes(trajectory, tmp_path):
    rosbags = pytest.importorskip("rosbags.rosbag2")
    write_bag(tmp_path / "plan", trajectory)
    with rosbags.Reader(tmp_path / "plan") as bag:
        (raw,) = [bytes(data) for connection, _, data in bag.messages() if connection.topic == TOPIC]
    check(json.loads(ros_2(_READ_2, given=raw.hex())), trajectory)


def test_a_bag_is_read_by_ros_1(trajectory, tmp_path):
    pytest.importorskip("rosbags")
    said = json.loads(ros_1(_READ_1, write_bag(tmp_path / "plan.bag", trajectory), TOPIC, STATES))
    check(said, trajectory)
    assert said["state_names"] == [*trajectory.joints, "grip"]
    np.testing.assert_array_equal(said["states"], np.column_stack((trajectory.positions, trajectory.steps["grip"])))
    np.testing.assert_allclose(said["stamps"], trajectory.times, atol=1e-9)
