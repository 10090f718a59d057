"""Bags of ROS 1 and ROS 2, written by rosbags."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np

SECOND = 10**9
START = 1_700_000_000 * SECOND
KINDS = ("ros1", "sqlite3", "mcap")


@cache
def store(kind):
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    known = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.LATEST)
    if kind == "ros1":
        known.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", "tf2_msgs/msg/TFMessage"))
    return known


class Maker:
    """Messages of one version of ROS."""

    def __init__(self, kind):
        self.kind, self.types = kind, store(kind).types

    def make(self, typename, /, **fields):
        return self.types[typename](**fields)

    def time(self, ns):
        return self.make("builtin_interfaces/msg/Time", sec=int(ns // SECOND), nanosec=int(ns % SECOND))

    def duration(self, ns):
        return self.make("builtin_interfaces/msg/Duration", sec=int(ns // SECOND), nanosec=int(ns % SECOND))

    def header(self, ns, frame="base"):
        seq = {"seq": 0} if self.kind == "ros1" else {}
        return self.make("std_msgs/msg/Header", stamp=self.time(ns), frame_id=frame, **seq)

    def vector(self, x, name="geometry_msgs/msg/Vector3"):
        return self.make(name, x=float(x[0]), y=float(x[1]), z=float(x[2]))

    def quaternion(self, q):
        return self.make("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", map(float, q), strict=True)))

    def pose(self, row):
        point = self.vector(row[:3], "geometry_msgs/msg/Point")
        return self.make("geometry_msgs/msg/Pose", position=point, orientation=self.quaternion(row[3:]))

    def pose_stamped(self, ns, row):
        return self.make("geometry_msgs/msg/PoseStamped", header=self.header(ns), pose=self.pose(row))

    def transform_stamped(self, ns, parent, child, row):
        transform = self.make(
            "geometry_msgs/msg/Transform", translation=self.vector(row[:3]), rotation=self.quaternion(row[3:])
        )
        return self.make(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(ns, parent),
            child_frame_id=child,
            transform=transform,
        )

    def tf(self, *transforms):
        return self.make("tf2_msgs/msg/TFMessage", transforms=list(transforms))

    def joint_state(self, ns, names, positions):
        none = np.zeros(0)
        return self.make(
            "sensor_msgs/msg/JointState",
            header=self.header(ns),
            name=list(names),
            position=np.asarray(positions, float),
            velocity=none,
            effort=none,
        )

    def twist(self, row):
        return self.make("geometry_msgs/msg/Twist", linear=self.vector(row[:3]), angular=self.vector(row[3:]))

    def string(self, text):
        return self.make("std_msgs/msg/String", data=text)

    def joint_trajectory(self, names, times, rows):
        none = np.zeros(0)
        points = [
            self.make(
                "trajectory_msgs/msg/JointTrajectoryPoint",
                positions=np.asarray(row, float),
                velocities=none,
                accelerations=none,
                effort=none,
                time_from_start=self.duration(ns),
            )
            for ns, row in zip(times, rows, strict=True)
        ]
        return self.make(
            "trajectory_msgs/msg/JointTrajectory", header=self.header(0), joint_names=list(names), points=points
        )

    def path(self, stamps, rows):
        poses = [self.pose_stamped(ns, row) for ns, row in zip(stamps, rows, strict=True)]
        return self.make("nav_msgs/msg/Path", header=self.header(0), poses=poses)

    def numbers(self, row):
        layout = self.make("std_msgs/msg/MultiArrayLayout", dim=[], data_offset=0)
        return self.make("std_msgs/msg/Float64MultiArray", layout=layout, data=np.asarray(row, float))


def write_bag(folder, kind, messages, name="run", compress=False, writer=None):
    """Write (topic, time of recording [ns], message or bytes with their type) as a bag; its path.

    A topic with None for the message is there without messages, and of the type that stands for the time.
    """
    known = store(kind)
    path = Path(folder) / (f"{name}.bag" if kind == "ros1" else name)
    with writer or _writer(path, kind, compress) as open_writer:
        connections = {}
        for topic, recorded, message in messages:
            typename = recorded if message is None else message[0] if _is_raw(message) else message.__msgtype__
            if (topic, typename) not in connections:
                connections[topic, typename] = open_writer.add_connection(topic, typename, typestore=known)
            if message is None:
                continue
            if _is_raw(message):
                raw = message[1]
            elif kind == "ros1":
                raw = known.serialize_ros1(message, typename)
            else:
                raw = known.serialize_cdr(message, typename)
            open_writer.write(connections[topic, typename], recorded, raw)
    return path


def write_mcap(path, messages, profile="ros2", encoding="ros2msg", **options):
    """Write (topic, type, time of recording [ns], bytes) as one file by the package mcap; its path."""
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file, **options)
        writer.start(profile=profile, library="test")
        channels = {}
        for topic, name, recorded, raw in messages:
            if topic not in channels:
                schema = writer.register_schema(name, encoding, b"# of the test")
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], recorded, raw, recorded)
        writer.finish()
    return path


def _is_raw(message):
    return isinstance(message, tuple)


def _writer(path, kind, compress):
    if kind == "ros1":
        from rosbags.rosbag1 import Writer

        writer = Writer(path)
        if compress:
            writer.set_compression(Writer.CompressionFormat.LZ4)
        return writer
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    writer = Writer(path, version=9, storage_plugin=plugin)
    if compress:
        mode = CompressionMode.STORAGE if kind == "mcap" else CompressionMode.MESSAGE
        writer.set_compression(mode, CompressionFormat.ZSTD)
    return writer


def pose_rows(n=50, seed=0):
    """Poses along a curve, with unit quaternions (n, 7)."""
    t = np.linspace(0, 1, n)[:, None]
    phase = np.random.default_rng(seed).normal(size=(2, 3))
    angle = 1.5 * t
    axis = phase[1] / np.linalg.norm(phase[1])
    return np.hstack((np.sin(3 * t + phase[0]), np.sin(angle / 2) * axis, np.cos(angle / 2)))


def stamps(n=50, rate=100.0, start=START):
    return [start + round(k * SECOND / rate) for k in range(n)]


def write_json_mcap(path, topics, **options):
    """An MCAP file of topics -> their messages in JSON, 20 a second."""
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file, **options)
        writer.start()
        schema = writer.register_schema("Pose", "jsonschema", b'{"type": "object"}')
        channels = {name: writer.register_channel(name, "json", schema) for name in topics}
        for name, messages in topics.items():
            for k, message in enumerate(messages):
                stamp = START + k * 50_000_000
                writer.add_message(channels[name], stamp, json.dumps(message).encode(), stamp)
        writer.finish()
    return path
