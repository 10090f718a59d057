"""Bags that ROS 1 wrote, and that it reads."""

import json

import numpy as np
import pytest

import kineme
from kineme.io.reading.recordings import read_recordings
from kineme.io.ros.add_topic import copy_with_topic
from ros_programs import ros_1

_WRITE = """
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


@pytest.fixture(scope="module", params=["none", "lz4", "bz2"])
def bag(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("ros") / f"{request.param}.bag"
    ros_1(_WRITE, path, request.param)
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
    return json.loads(ros_1(_READ, path))


def test_ros_1_reads_a_copy_with_a_topic_more(bag, tmp_path):
    texts = [(1_700_000_001 * 10**9 + 7, '{"symbol": "né"}'), (1_700_000_001 * 10**9 + 9, "b")]
    copy_with_topic(bag, tmp_path / "named.bag", "/kineme/annotations", lambda first, last: texts)
    _, before, counts = _read_by_ros(bag)
    said, after, all_counts = _read_by_ros(tmp_path / "named.bag")
    assert said == [list(text) for text in texts]
    assert after == before
    assert all_counts == {**counts, "/kineme/annotations": 2}


_APPEND = """
import sys, genpy, rosbag
from std_msgs.msg import String
with rosbag.Bag(sys.argv[1], "a") as bag:
    for k in range(20):
        bag.write("/later", String(str(k)), genpy.Time(1700000100 + k))
"""


def in_order_of_roscpp(data):
    """The records of a bag with the fields of their headers in alphabetic order, as those of a map in C++."""
    parts, at = [data[:13]], 13
    while at < len(data):
        size = int.from_bytes(data[at : at + 4], "little")
        end = at + 4 + size
        fields, k = [], at + 4
        while k < end:
            length = 4 + int.from_bytes(data[k : k + 4], "little")
            fields.append(data[k : k + length])
            k += length
        body = end + 4 + int.from_bytes(data[end : end + 4], "little")
        parts += [data[at : at + 4], *sorted(fields, key=lambda field: field[4:]), data[end:body]]
        at = body
    return b"".join(parts)


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("appended", [False, True])
def test_a_copy_of_what_roscpp_recorded_is_read_by_all(bag, tmp_path, appended):
    """Index records of two orders of fields in one bag, where rosbag appended to it; rosbags reads only one order."""
    path, copy = tmp_path / "run.bag", tmp_path / "named.bag"
    path.write_bytes(in_order_of_roscpp(bag.read_bytes()))
    if appended:
        ros_1(_APPEND, path)
    texts = [(1_700_000_001 * 10**9 + 7, "a")]
    copy_with_topic(path, copy, "/kineme/annotations", lambda first, last: texts)
    _, before, counts = _read_by_ros(path)
    said, after, all_counts = _read_by_ros(copy)
    assert said == [list(text) for text in texts]
    assert sorted(after) == sorted(before)
    assert all_counts == {**counts, "/kineme/annotations": 1}
    assert counts.get("/later", 0) == 20 * appended
    from rosbags.highlevel import AnyReader

    with AnyReader([copy]) as reader:
        assert sum(1 for _ in reader.messages()) == len(before) + 1
    assert len(read_recordings(path, topic="/joint_states").demonstrations[0].times) == 200


def test_a_bag_of_ros_1_that_was_cut_off(bag, tmp_path):
    """As of a recorder that was killed: its index was never written."""
    data = bag.read_bytes()
    path = tmp_path / "cut.bag"
    at = data.index(b"index_pos=") + len(b"index_pos=")
    path.write_bytes(data[:at] + bytes(8) + data[at + 8 : len(data) // 2])
    with pytest.raises(kineme.errors.DataError, match=r"cut\.bag: expected .* not indexed.*; .* run rosbag reindex"):
        read_recordings(path)
