"""Numbers of messages of any type: as rosbags decodes them by the same definition."""

import struct
from contextlib import suppress
from types import SimpleNamespace

import numpy as np
import pytest

import kineme
from bag_files import KINDS, SECOND, START, Maker, pose_rows, stamps, write_bag
from kineme.io.ros.choose import bag_contents
from kineme.io.ros.number_fields import NumberFields, Step, number_fields

pytest.importorskip("rosbags")

GRIP = """std_msgs/Header header
string name
bool closed
float64 force
int8[] codes
my_msgs/Finger[2] fingers
my_msgs/Finger[] others
uint16 count
float32[3] wrench
string[] notes
geometry_msgs/Vector3 axis
================================================================================
MSG: my_msgs/Finger
string name
uint8 id
float64 angle
float32[2] tip
"""


def typed(kind):
    """A store of rosbags that knows the types of its own."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.LATEST)
    types.register(get_types_from_msg(GRIP, "my_msgs/msg/Grip"))
    return types


def grip(types, header, k):
    make = types.types
    finger = make["my_msgs/msg/Finger"]
    fingers = [finger("f" * (i + k % 3), i, k + i / 7, np.array([k, -i], np.float32)) for i in range(4)]
    return make["my_msgs/msg/Grip"](
        header=header, name="é" * (k % 4), closed=k > 5, force=k / 3, codes=np.arange(k % 5, dtype=np.int8),
        fingers=fingers[:2], others=fingers[: k % 3], count=1000 + k, wrench=np.array([k, 0.5, -k], np.float32),
        notes=["a" * (k % 2)] * (k % 3), axis=make["geometry_msgs/msg/Vector3"](x=k / 2, y=1.0, z=-1.0),
    )  # fmt: skip


def recorded(tmp_path, kind, n=20, others=()):
    types, m = typed(kind), Maker(kind)
    serialize = types.serialize_ros1 if kind == "ros1" else types.serialize_cdr
    path = tmp_path / ("run.bag" if kind == "ros1" else "run")
    from bag_files import _writer

    with _writer(path, kind, False) as writer:
        topic = writer.add_connection("/grip", "my_msgs/msg/Grip", typestore=types)
        for k, ns in enumerate(stamps(n)):
            writer.write(topic, ns + 7, serialize(grip(types, m.header(ns), k), "my_msgs/msg/Grip"))
        for name, kind_of, messages in others:
            connection = writer.add_connection(name, kind_of, typestore=types)
            for ns, message in messages:
                writer.write(connection, ns, serialize(message, kind_of))
    return path


@pytest.mark.parametrize("kind", KINDS)
def test_fields_of_a_type_of_ones_own_are_columns_by_their_path(tmp_path, kind):
    path = recorded(tmp_path, kind)
    read = kineme.read_recordings(path, topic="/grip")
    (movement,) = read.demonstrations
    heads = ["closed", "force"]
    heads += [f"fingers.{k}.{name}" for k in range(2) for name in ("angle", "tip.0", "tip.1")]
    heads += ["count", "wrench.0", "wrench.1", "wrench.2", "axis.x", "axis.y", "axis.z"]
    assert [column for channel in movement.channels for column in channel.columns] == heads
    expected = [
        [k > 5, k / 3, *(x for i in range(2) for x in (k + i / 7, k, -i)), 1000 + k, k, 0.5, -k, k / 2, 1, -1]
        for k in range(20)
    ]
    np.testing.assert_array_equal(movement.recorded, np.array(expected, dtype=float))
    np.testing.assert_allclose(movement.times, np.array(stamps(20)) / SECOND, rtol=0, atol=5e-7)
    assert read.detected[0][0].time == "header.stamp"
    assert read.detected[0][0].ignored == ("fingers.0.id", "fingers.1.id")
    (topics, *_) = bag_contents(path)
    assert ("/grip", "my_msgs/msg/Grip", 20, "17 numbers: a movement, by --topic") in topics.rows
    chosen = kineme.read_recordings(path, topic="/grip", columns=["force", "axis"]).demonstrations[0]
    np.testing.assert_array_equal(chosen.positions[:, :2], movement.recorded[:, [1, 12]])


@pytest.mark.parametrize("kind", KINDS)
def test_imu(tmp_path, kind):
    m = Maker(kind)
    rows = pose_rows()
    messages = [
        m.make(
            "sensor_msgs/msg/Imu", header=m.header(ns), orientation=m.quaternion(row[3:]),
            orientation_covariance=np.arange(9.0), angular_velocity=m.vector(row[:3]),
            angular_velocity_covariance=np.zeros(9), linear_acceleration=m.vector(2 * row[:3]),
            linear_acceleration_covariance=np.full(9, -1.0),
        )
        for ns, row in zip(stamps(), rows, strict=True)
    ]  # fmt: skip
    path = write_bag(
        tmp_path, kind, [("/imu", ns + 3, message) for ns, message in zip(stamps(), messages, strict=True)]
    )
    (movement,) = kineme.read_recordings(path).demonstrations  # the only topic with numbers
    assert next((channel.name, channel.kind) for channel in movement.channels) == ("orientation", "orientation")
    np.testing.assert_allclose(movement.recorded, np.hstack((rows[:, 3:], rows[:, :3], 2 * rows[:, :3])), atol=1e-12)
    np.testing.assert_allclose(movement.times, np.array(stamps()) / SECOND, rtol=0, atol=5e-7)
    covariance = kineme.read_recordings(path, columns="orientation_covariance").demonstrations[0]
    np.testing.assert_array_equal(covariance.recorded[3], np.arange(9.0))


def test_movements_come_before_numbers_and_those_of_ros_itself_are_left_aside(tmp_path):
    m = Maker("mcap")
    poses = [(ns, m.pose_stamped(ns, row)) for ns, row in zip(stamps(), pose_rows(), strict=True)]
    logs = [(ns, m.make("rosgraph_msgs/msg/Clock", clock=m.time(ns))) for ns in stamps()]
    others = [("/tool", "geometry_msgs/msg/PoseStamped", poses), ("/clock", "rosgraph_msgs/msg/Clock", logs)]
    read = kineme.read_recordings(recorded(tmp_path, "mcap", others=others))
    assert read.detected[0][0].layout == "topic /tool of geometry_msgs/msg/PoseStamped"
    (tmp_path / "b").mkdir()
    read = kineme.read_recordings(recorded(tmp_path / "b", "mcap", others=others[1:]))
    assert read.detected[0][0].layout == "topic /grip of my_msgs/msg/Grip"


def test_bytes_in_the_other_order(tmp_path):
    raw = b"\x00\x00\x00\x00" + struct.pack(">i", 7)
    messages = [("/n", ns, ("std_msgs/msg/Int32", raw)) for ns in stamps(5)]
    messages += [("/n", START + SECOND, ("std_msgs/msg/Int32", b"\x00\x01\x00\x00" + struct.pack("<i", 9)))]
    (movement,) = kineme.read_recordings(write_bag(tmp_path, "mcap", messages)).demonstrations
    assert movement.recorded[:, 0].tolist() == [7] * 5 + [9]


def test_a_sequence_of_none_is_not_aligned_and_one_that_is_cut_off_is_damaged():
    doubles, number = Step(element=(Step("d", ("x",)),)), Step("I", ("n",))
    first = NumberFields.of("my_msgs/msg/A", 2, (doubles, number))
    for count in (0, 1, 3):
        raw = (
            struct.pack("<4xI4x", count) + struct.pack(f"<{count}d", *range(count)) if count else struct.pack("<4xI", 0)
        )
        assert first.decode(b"\0\1\0\0" + raw[4:] + struct.pack("<I", 7)).row == [7]
    last = NumberFields.of("my_msgs/msg/B", 2, (number, doubles))
    raw = struct.pack("<II2d", 7, 2, 0.0, 0.0)
    assert last.decode(b"\0\1\0\0" + raw).row == [7]
    with pytest.raises(ValueError, match="expected 28 bytes, got 27"):
        last.decode(b"\0\1\0\0" + raw[:-1])


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_messages_are_named_and_the_others_read(tmp_path, kind):
    """Cut off, or with a sequence of billions; any bytes are read or refused."""
    m, random = Maker(kind), np.random.default_rng(0)
    good = [("/n", ns, m.make("std_msgs/msg/Float64", data=k / 2)) for k, ns in enumerate(stamps(9))]
    cut = [("/n", START + SECOND, ("std_msgs/msg/Float64", b"\x00\x01\x00\x00" + bytes(3)))]
    path = write_bag(tmp_path, kind, [*good, *cut])
    assert len(kineme.read_recordings(path, skip="sample").demonstrations[0]) == 9
    with pytest.raises(kineme.errors.DataError, match=r"topic /n: message 9: expected a std_msgs/msg/Float64"):
        kineme.read_recordings(path)
    from kineme.io.ros.bags import open_bag
    from kineme.io.ros.number_fields import number_fields

    types = typed(kind)
    data = (types.serialize_ros1 if kind == "ros1" else types.serialize_cdr)(
        grip(types, m.header(START), 8), "my_msgs/msg/Grip"
    )
    (tmp_path / "g").mkdir()
    with open_bag(recorded(tmp_path / "g", kind)) as bag:
        fields = number_fields(bag, bag.topics[0])
    for _ in range(500):
        spoiled = np.frombuffer(data, np.uint8).copy()
        spoiled[random.integers(0, len(spoiled), 4)] = random.integers(0, 256, 4)
        with suppress(ValueError):
            assert len(fields.decode(spoiled.tobytes()[: random.integers(1, len(data) + 1)]).row) == len(fields.heads)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("wstring name\nfloat64 x", "wstring"),
        ("string name", "expected numbers in messages of my_msgs/msg/Odd, got none"),
        ("my_msgs/Lost[2] x", "Lost"),
        ("float64 x\n" * 20_001, "of at most 200,000 characters"),
        ("my_msgs/Odd[2] x\nfloat64 y", "deep"),
        ("float64[ x", "expected the definition of my_msgs/msg/Odd"),
    ],
)
def test_definitions_that_say_no_numbers_are_refused(tmp_path, text, words):
    from rosbags.rosbag2 import StoragePlugin, Writer

    with Writer(tmp_path / "run", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/odd", "my_msgs/msg/Odd", msgdef=text, rihs01="RIHS01_" + "0" * 64)
        for ns in stamps(9):
            writer.write(connection, ns, b"\x00\x01\x00\x00" + bytes(64))
    with pytest.raises(kineme.errors.DataError, match=words):
        kineme.read_recordings(tmp_path / "run", topic="/odd")
    assert bag_contents(tmp_path / "run")[0].rows[0][3] == "nothing: no numbers"


def test_definitions_that_differ_are_refused():
    said = SimpleNamespace(name="MSG")
    kinds = [SimpleNamespace(msgdef=SimpleNamespace(data=f"{kind} x", format=said)) for kind in ("float64", "float32")]
    topic = SimpleNamespace(name="/a", type="my_msgs/msg/A", connections=kinds)
    with pytest.raises(kineme.errors.DataError, match="got several that differ; convert the topic to CSV"):
        number_fields(SimpleNamespace(version=2), topic)
    topic.connections = kinds[:1]
    assert number_fields(SimpleNamespace(version=2), topic).heads == ("x",)


def test_arrays_of_fixed_size_are_columns_up_to_a_thousand():
    text = "float64[1000] short\nfloat64[1001] long\nfloat64 last"
    said = SimpleNamespace(msgdef=SimpleNamespace(data=text, format=SimpleNamespace(name="MSG")))
    topic = SimpleNamespace(name="/a", type="my_msgs/msg/A", connections=[said])
    fields = number_fields(SimpleNamespace(version=2), topic)
    assert fields.heads == (*(f"short.{k}" for k in range(1000)), "last")
    raw = b"\x00\x01\x00\x00" + struct.pack("<2002d", *range(2002))
    assert fields.decode(raw).row == [*range(1000), 2001]


def test_no_program_is_made_of_a_definition(tmp_path, monkeypatch):
    path = recorded(tmp_path, "ros1")
    from rosbags.typesys import store as module

    monkeypatch.setattr(module, "generate_python_code", lambda *_: pytest.fail("a definition became a program"))
    assert len(kineme.read_recordings(path, topic="/grip").demonstrations[0]) == 20
