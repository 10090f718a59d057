"""Messages that ROS 2 serialized, in every layout of its bags; and annotated copies of these, which it reads.

The program that records bags is not to be had as a package of Python: its layouts are written by rosbags and mcap.
"""

import json
import sqlite3
from collections import Counter

import numpy as np
import pytest

from bag_files import write_bag, write_mcap
from kineme.io.reading.recordings import read_recordings
from kineme.io.ros.add_topic import copy_with_topic
from ros_programs import ros_2

_WRITE = """
import math
from rclpy.serialization import serialize_message
from geometry_msgs.msg import PoseStamped, TransformStamped, Twist
from nav_msgs.msg import Odometry, Path
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

def show(topic, message):
    name = type(message).__module__.split(".")[0] + "/msg/" + type(message).__name__
    print(topic, name, serialize_message(message).hex())

plan, path = JointTrajectory(joint_names=["a", "longer_name"]), Path()
for k in range(100):
    pose, state = PoseStamped(), JointState(name=["a", "longer_name"], position=[math.sin(k / 20), k / 100])
    odometry, transform, twist = Odometry(), TransformStamped(), Twist()
    for one in (pose, state, odometry, transform):
        one.header.stamp.sec, one.header.stamp.nanosec, one.header.frame_id = 1700000000, k * 10**7, "base"
    for one in (pose.pose, odometry.pose.pose):
        one.position.x, one.orientation.z, one.orientation.w = k / 10, math.sin(k / 99), math.cos(k / 99)
    transform.transform.translation.y, transform.transform.rotation.w = k / 7, 1.0
    twist.angular.z = k / 3
    for topic, one in (("/pose", pose), ("/joint_states", state), ("/odometry", odometry), ("/hand", transform)):
        show(topic, one)
    show("/twist", twist)
    show("/numbers", Float64MultiArray(data=[k / 9, -1.0]))
    show("/chatter", String(data="x" * k))
    point = JointTrajectoryPoint(positions=[float(k), -float(k)])
    point.time_from_start.nanosec = k * 10**7
    plan.points.append(point)
    path.poses.append(pose)
show("/plan", plan)
show("/path", path)
"""

_READ = """
import importlib, json, sys
from rclpy.serialization import deserialize_message

said = {}
for line in sys.stdin:
    topic, name, raw = line.split()
    package, _, kind = name.split("/")
    message = deserialize_message(bytes.fromhex(raw), getattr(importlib.import_module(package + ".msg"), kind))
    said.setdefault(topic, []).append(message.data if kind == "String" else repr(message))
print(json.dumps(said))
"""

LAYOUTS = ("mcap file", "mcap folder", "mcap folder STORAGE", "mcap folder MESSAGE", "sqlite3", "sqlite3 MESSAGE")
START, STEP = 17 * 10**17, 10**6
TEXTS = [(START + 50 * STEP, '{"symbol": "né"}'), (START + 90 * STEP, "second")]


@pytest.fixture(scope="module")
def serialized():
    """Topic, type and bytes of every message."""
    return [(topic, name, bytes.fromhex(raw)) for topic, name, raw in map(str.split, ros_2(_WRITE).splitlines())]


@pytest.fixture(scope="module", params=LAYOUTS)
def bag(request, serialized, tmp_path_factory):
    path = tmp_path_factory.mktemp("ros2") / "session"
    if request.param == "mcap file":
        messages = [(topic, name, START + k * STEP, raw) for k, (topic, name, raw) in enumerate(serialized)]
        return write_mcap(path.with_suffix(".mcap"), messages, chunk_size=2**14)
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    kind, compression = request.param.split()[0], request.param.split()[-1]
    writer = Writer(path, version=9, storage_plugin=StoragePlugin[kind.upper()])
    if compression in CompressionMode.__members__:
        writer.set_compression(CompressionMode[compression], CompressionFormat.ZSTD)
    messages = [(topic, START + k * STEP, (name, raw)) for k, (topic, name, raw) in enumerate(serialized)]
    return write_bag(path.parent, kind, messages, path.name, writer=writer)


def test_messages_of_ros_2(bag):
    k = np.arange(100)
    zero = np.zeros(100)

    def read(topic):
        (movement,) = read_recordings(bag, topic=topic).demonstrations
        return movement

    joints = read("/joint_states")
    np.testing.assert_allclose(joints.recorded, np.column_stack((np.sin(k / 20), k / 100)), atol=1e-15)
    np.testing.assert_allclose(joints.times, 1.7e9 + k / 100, rtol=0, atol=5e-7)
    pose = np.column_stack((k / 10, zero, zero, zero, zero, np.sin(k / 99), np.cos(k / 99)))
    for topic in ("/pose", "/odometry", "/path"):
        np.testing.assert_allclose(read(topic).recorded, pose, atol=1e-15)
    np.testing.assert_array_equal(read("/hand").recorded[:, 1], k / 7)
    np.testing.assert_array_equal(read("/twist").recorded[:, 5], k / 3)
    np.testing.assert_array_equal(read("/numbers").recorded, np.column_stack((k / 9, zero - 1)))
    np.testing.assert_array_equal(read("/plan").recorded, k[:, None] * [1, -1])


def stored(path):
    """Topic, type, time of recording and bytes of all messages, by programs that are not used to read bags here."""
    files = [path] if path.is_file() else [file for file in sorted(path.iterdir()) if file.suffix in (".mcap", ".db3")]
    rows = [row for file in files for row in (in_mcap(file) if file.suffix == ".mcap" else in_sqlite(file))]
    is_each = path.is_dir() and "compression_mode: message" in (path / "metadata.yaml").read_text().lower()
    return [(*row[:3], expanded(row[3]) if is_each else row[3]) for row in rows]


def in_mcap(path):
    from mcap.reader import make_reader

    with path.open("rb") as file:
        read = make_reader(file, validate_crcs=True).iter_messages(log_time_order=False)
        return [(channel.topic, schema.name, message.log_time, message.data) for schema, channel, message in read]


def in_sqlite(path):
    database = sqlite3.connect(path)
    query = "SELECT name, type, timestamp, data FROM messages JOIN topics ON topics.id = topic_id ORDER BY messages.id"
    rows = database.execute(query).fetchall()
    assert database.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    database.close()
    return rows


def expanded(raw):
    from rosbags.rosbag2.storage_mcap import zstd

    return zstd.decompress(raw)


def test_ros_2_reads_a_copy_with_a_topic_more(bag, serialized, tmp_path):
    copy = tmp_path / f"named{bag.suffix}"
    copy_with_topic(bag, copy, "/kineme/annotations", lambda first, last: TEXTS)
    rows = stored(copy)
    before = [(topic, name, START + k * STEP, raw) for k, (topic, name, raw) in enumerate(serialized)]
    assert [row for row in rows if row[0] != "/kineme/annotations"] == before == stored(bag)
    assert [row[2] for row in rows if row[0] == "/kineme/annotations"] == [stamp for stamp, _ in TEXTS]
    said = json.loads(ros_2(_READ, given="".join(f"{row[0]} {row[1]} {row[3].hex()}\n" for row in rows)))
    assert said["/kineme/annotations"] == [text for _, text in TEXTS]
    assert said["/chatter"] == ["x" * k for k in range(100)]
    assert {topic: len(all_of) for topic, all_of in said.items()} == Counter(row[0] for row in rows)
