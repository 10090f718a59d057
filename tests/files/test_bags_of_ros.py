"""Bags that other programs wrote: ROS 1 and ROS 2 themselves, where they are installed, and the package mcap."""

import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

import kineme
from bag_files import Maker, pose_rows, stamps, store, write_mcap
from kineme.files.recordings import read_recordings
from kineme.files.ros.add_topic import copy_with_topic

_ROS_1 = """
import sys, math
import genpy, rosbag
from geometry_msgs.msg import PoseStamped, TransformStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

def transform(stamp, parent, child, x, angle):
    one = TransformStamped()
    one.header.stamp, one.header.frame_id, one.child_frame_id = stamp, parent, child
    one.transform.translation.x = x
    one.transform.rotation.z, one.transform.rotation.w = math.sin(angle / 2), math.cos(angle / 2)
    return one

with rosbag.Bag(sys.argv[1], "w", compression=sys.argv[2]) as bag:
    start = genpy.Time(1700000000, 250)
    bag.write("/tf_static", TFMessage([transform(start, "hand", "tool", 0.1, 0.0)]), start)
    plan = JointTrajectory(joint_names=["a", "b"])
    for k in range(200):
        stamp = start + genpy.Duration.from_sec(k / 100)
        recorded = stamp + genpy.Duration.from_sec(0.002)
        state = JointState(name=["a", "b"], position=[math.sin(k / 20), k / 100])
        state.header.stamp = stamp
        bag.write("/joint_states", state, recorded)
        bag.write("/chatter", String("x" * 5000), recorded)
        bag.write("/tf", TFMessage([transform(stamp, "/base", "/hand", k / 100, k / 200)]), recorded)
        plan.points.append(JointTrajectoryPoint(positions=[k, -k], time_from_start=genpy.Duration.from_sec(k / 50)))
    bag.write("/plan", plan, recorded)
"""

_PYTHON = shutil.which("python3", path="/usr/bin")


@pytest.fixture(scope="module", params=["none", "lz4", "bz2"])
def bag(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("ros") / f"{request.param}.bag"
    if _PYTHON is None:
        pytest.skip("no Python of the system, for which Debian packages ROS 1")
    known = subprocess.run(
        [_PYTHON, "-c", "import rosbag, sensor_msgs, trajectory_msgs, tf2_msgs"], capture_output=True, check=False
    )
    if known.returncode:
        pytest.skip("no ROS 1; on Debian: apt-get install python3-rosbag python3-{sensor,trajectory,tf2}-msgs")
    subprocess.run([_PYTHON, "-c", _ROS_1, str(path), request.param], check=True, capture_output=True)
    return path


def test_a_topic_of_ros_1(bag):
    read = read_recordings(bag, topic="/joint_states")
    (movement,) = read.demonstrations
    k = np.arange(200)
    np.testing.assert_allclose(movement.recorded, np.column_stack((np.sin(k / 20), k / 100)), atol=1e-15)
    np.testing.assert_allclose(movement.times, 1.7e9 + 250e-9 + k / 100, rtol=0, atol=5e-7)
    assert read.detected[0][0].time == "header.stamp"
    assert read.problems == ()


def test_frames_of_ros_1(bag):
    (movement,) = read_recordings(bag, frame="base:tool").demonstrations
    k = np.arange(200)
    x = k / 100 + 0.1 * np.cos(k / 200)
    expected = np.column_stack((x, 0.1 * np.sin(k / 200), 0 * k, 0 * k, 0 * k, np.sin(k / 400), np.cos(k / 400)))
    np.testing.assert_allclose(movement.recorded, expected, atol=1e-12)


def test_a_plan_of_ros_1(bag):
    (movement,) = read_recordings(bag, topic="/plan").demonstrations
    np.testing.assert_array_equal(movement.recorded, np.arange(200)[:, None] * [1, -1])
    np.testing.assert_allclose(movement.times, np.arange(200) / 50, atol=1e-8)


_READ = """
import hashlib, json, sys, rosbag
with rosbag.Bag(sys.argv[1]) as bag:
    said = [(t.to_nsec(), m.data) for _, m, t in bag.read_messages("/kineme/annotations")]
    others = [(topic, raw[0], raw[2], hashlib.md5(raw[1]).hexdigest(), t.to_nsec())
              for topic, raw, t in bag.read_messages(raw=True) if topic != "/kineme/annotations"]
    info = bag.get_type_and_topic_info().topics
    print(json.dumps([said, others, {name: one.message_count for name, one in info.items()}]))
"""


def _read_by_ros(path):
    run = subprocess.run([_PYTHON, "-c", _READ, str(path)], capture_output=True, text=True, check=True)
    return json.loads(run.stdout)


def test_ros_1_reads_a_copy_with_a_topic_more(bag, tmp_path):
    texts = [(1_700_000_001 * 10**9 + 7, '{"symbol": "né"}'), (1_700_000_001 * 10**9 + 9, "b")]
    copy_with_topic(bag, tmp_path / "named.bag", "/kineme/annotations", lambda first, last: texts)
    _, before, counts = _read_by_ros(bag)
    said, after, all_counts = _read_by_ros(tmp_path / "named.bag")
    assert said == [list(one) for one in texts]
    assert after == before
    assert all_counts == {**counts, "/kineme/annotations": 2}


def test_a_bag_of_ros_1_that_was_cut_off(bag, tmp_path):
    """As of a recorder that was killed: its index was never written."""
    data = bag.read_bytes()
    path = tmp_path / "cut.bag"
    at = data.index(b"index_pos=") + len(b"index_pos=")
    path.write_bytes(data[:at] + bytes(8) + data[at + 8 : len(data) // 2])
    with pytest.raises(kineme.DataError, match=r"cut\.bag: expected .* not indexed.*; .* run rosbag reindex"):
        read_recordings(path)


def serialized(m, ns, row):
    message = m.pose_stamped(ns, row)
    return bytes(store("mcap").serialize_cdr(message, message.__msgtype__))


def poses(name="geometry_msgs/msg/PoseStamped"):
    m = Maker("mcap")
    return [("/tool", name, ns, serialized(m, ns, row)) for ns, row in zip(stamps(), pose_rows(), strict=True)]


def compressions():
    from mcap.writer import CompressionType

    return [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD]


@pytest.mark.parametrize("name", ["geometry_msgs/msg/PoseStamped", "geometry_msgs/PoseStamped"])
@pytest.mark.parametrize("compression", range(3))
def test_an_mcap_by_the_package_mcap(tmp_path, compression, name):
    pytest.importorskip("mcap")
    path = write_mcap(tmp_path / "a.mcap", poses(name), compression=compressions()[compression], chunk_size=500)
    read = read_recordings(path)
    np.testing.assert_array_equal(read.demonstrations[0].recorded, pose_rows())
    assert read.detected[0][0].format == "MCAP"


def test_an_mcap_without_an_index(tmp_path):
    """It is read where its messages are in the order of time, and refused where they are not."""
    from mcap.writer import IndexType

    unindexed = {"use_chunking": False, "use_statistics": False, "use_summary_offsets": False}
    unindexed |= {"index_types": IndexType.NONE, "repeat_channels": False, "repeat_schemas": False}
    path = write_mcap(tmp_path / "a.mcap", poses(), **unindexed)
    np.testing.assert_array_equal(read_recordings(path).demonstrations[0].recorded, pose_rows())
    messages = poses()
    messages[20], messages[30] = messages[30], messages[20]
    path = write_mcap(tmp_path / "b.mcap", messages, **unindexed)
    with pytest.raises(kineme.DataError, match=r"b\.mcap: topic /tool: after 21 messages: .*not in timestamp order"):
        read_recordings(path)


def test_an_mcap_whose_messages_are_not_in_order(tmp_path):
    messages = poses()
    messages[20], messages[30] = messages[30], messages[20]
    read = read_recordings(write_mcap(tmp_path / "a.mcap", messages, chunk_size=500))
    np.testing.assert_array_equal(read.demonstrations[0].recorded, pose_rows())


def test_an_mcap_of_another_robot_system_is_named(tmp_path):
    path = write_mcap(tmp_path / "a.mcap", poses(), profile="", encoding="protobuf")
    with pytest.raises(kineme.DataError, match=r"a\.mcap: expected a bag of ROS .* got: Profile is not ros2"):
        read_recordings(path)


def test_an_mcap_with_an_encoding_that_rosbags_does_not_know_names_it(tmp_path):
    path = write_mcap(tmp_path / "a.mcap", poses(), encoding="jsonschema")
    with pytest.raises(kineme.DataError, match=r"a\.mcap: expected .*, got: 'jsonschema', which rosbags does not know"):
        read_recordings(path)


_ROS_2 = """
import math
from rclpy.serialization import serialize_message
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

def show(topic, message):
    name = type(message).__module__.split(".")[0] + "/msg/" + type(message).__name__
    print(topic, name, serialize_message(message).hex())

plan = JointTrajectory(joint_names=["a", "longer_name"])
for k in range(100):
    pose, state = PoseStamped(), JointState(name=["a", "longer_name"], position=[math.sin(k / 20), k / 100])
    for one in (pose, state):
        one.header.stamp.sec, one.header.stamp.nanosec, one.header.frame_id = 1700000000, k * 10**7, "base"
    pose.pose.position.x, pose.pose.orientation.z, pose.pose.orientation.w = k / 10, math.sin(k / 99), math.cos(k / 99)
    show("/pose", pose)
    show("/joint_states", state)
    point = JointTrajectoryPoint(positions=[float(k), -float(k)])
    point.time_from_start.nanosec = k * 10**7
    plan.points.append(point)
show("/plan", plan)
"""


@pytest.fixture(scope="module")
def ros_2(tmp_path_factory):
    """Messages that ROS 2 serialized, in an MCAP file; of this Python, or of the one that ROS2_PYTHON names."""
    for python in filter(None, (os.environ.get("ROS2_PYTHON"), sys.executable)):
        done = subprocess.run([python, "-c", _ROS_2], capture_output=True, check=False, text=True)
        if not done.returncode:
            break
    else:
        pytest.skip("no ROS 2: pip install ros-rclpy ros-geometry-msgs ros-sensor-msgs ros-trajectory-msgs")
    rows = [line.split() for line in done.stdout.splitlines()]
    messages = [(topic, name, 17 * 10**17 + k, bytes.fromhex(raw)) for k, (topic, name, raw) in enumerate(rows)]
    return write_mcap(tmp_path_factory.mktemp("ros2") / "session.mcap", messages)


def test_messages_of_ros_2(ros_2):
    k = np.arange(100)
    (joints,) = read_recordings(ros_2, topic="/joint_states").demonstrations
    np.testing.assert_allclose(joints.recorded, np.column_stack((np.sin(k / 20), k / 100)), atol=1e-15)
    np.testing.assert_allclose(joints.times, 1.7e9 + k / 100, rtol=0, atol=5e-7)
    (pose,) = read_recordings(ros_2, topic="/pose").demonstrations
    zero = np.zeros(100)
    expected = np.column_stack((k / 10, zero, zero, zero, zero, np.sin(k / 99), np.cos(k / 99)))
    np.testing.assert_allclose(pose.recorded, expected, atol=1e-15)
    (plan,) = read_recordings(ros_2, topic="/plan").demonstrations
    np.testing.assert_array_equal(plan.recorded, k[:, None] * [1, -1])
