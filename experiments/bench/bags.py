"""Bags of a gigabyte, most of it pictures: processor time beside the bare deserialization by rosbags, and memory."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from bench.rows import Row

_SECOND = 10**9
_START = 1_700_000_000 * _SECOND
_LINKS = 10  # moving frames, one behind the other
_JOINTS = 14
_PICTURE = 640 * 480 * 3  # bytes
_SHARE = {"joints": 0.08, "frames": 0.12}  # of the bytes, about
_TRANSFORM, _STATE = 96, 420  # bytes of a message, about

# Each is a process of its own, so that its peak of memory is that of what it does. Linux tells it in /proc; getrusage
# would count what the parent took.
_OURS = """
import json, sys, time
from kineme.io.reading.recordings import read_recordings
begin = time.process_time()
read = read_recordings(sys.argv[1], **json.loads(sys.argv[2]))
seconds = time.process_time() - begin
n = len(read.demonstrations.positions)
peak = next(line for line in open("/proc/self/status") if line.startswith("VmHWM"))
print(json.dumps({"seconds": seconds, "n": n, "mib": int(peak.split()[1]) / 1024}))
"""
_THEIRS = """
import json, sys, time
from pathlib import Path
from rosbags.highlevel import AnyReader
begin = time.process_time()
n = 0
with AnyReader([Path(sys.argv[1])]) as reader:
    chosen = [one for one in reader.connections if one.topic in json.loads(sys.argv[2])]
    for connection, _, raw in reader.messages(connections=chosen):
        reader.deserialize(raw, connection.msgtype)
        n += 1
seconds = time.process_time() - begin
peak = next(line for line in open("/proc/self/status") if line.startswith("VmHWM"))
print(json.dumps({"seconds": seconds, "n": n, "mib": int(peak.split()[1]) / 1024}))
"""


def measure(quick: bool) -> list[Row]:
    n_bytes = 10**8 if quick else 10**9
    wanted: dict[str, tuple[dict[str, Any], list[str]]] = {
        "states of 14 joints": ({"topic": "/joint_states"}, ["/joint_states"]),
        f"a pose over {_LINKS} frames": ({"frame": f"link0:link{_LINKS}"}, ["/tf"]),
    }
    rows = []
    for kind, name in (("ros1", "ROS 1"), ("sqlite3", "ROS 2 in SQLite"), ("mcap", "ROS 2 in MCAP")):
        with tempfile.TemporaryDirectory() as folder:
            small = _write(Path(folder), kind, 10**6, "small")
            path = _write(Path(folder), kind, n_bytes, "large")
            size = sum(one.stat().st_size for one in ([path] if path.is_file() else path.iterdir()))
            for what, (options, topics) in wanted.items():
                library = _run(_OURS, small, options)
                ours, theirs = (_run(program, path, arguments) for program, arguments in _both(options, topics))
                details = {"bytes": size, "messages": theirs["n"], "samples": ours["n"], "peer_mib": theirs["mib"]}
                said = f"{name}, {size / 1e6:,.0f} MB, {what}"
                ratio = theirs["seconds"] / ours["seconds"]
                rows.append(
                    Row(said, "s", ours["seconds"], theirs["seconds"], "rosbags", ratio, (">=", 1 / 3), details)
                )
                more = ours["mib"] - library["mib"]
                rows.append(Row(f"{said}: memory", "MiB", more, target=("<=", 300.0), details=details))
    return rows


def _both(options: dict[str, Any], topics: list[str]) -> list[tuple[str, Any]]:
    return [(_OURS, options), (_THEIRS, topics)]


def _run(program: str, path: Path, arguments: Any) -> dict[str, float]:
    command = [sys.executable, "-c", program, str(path), json.dumps(arguments)]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE)
    answer: dict[str, float] = json.loads(done.stdout)
    return answer


def _write(folder: Path, kind: str, n_bytes: int, name: str) -> Path:
    """Pictures, states of joints and transforms, by the writer of rosbags."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.LATEST)
    tf = "tf2_msgs/msg/TFMessage"
    if kind == "ros1":
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", tf))
    path = folder / (f"{name}.bag" if kind == "ros1" else name)
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    n_states = max(10, int(_SHARE["joints"] * n_bytes / _STATE))
    n_moves = max(10, int(_SHARE["frames"] * n_bytes / (_TRANSFORM * _LINKS)))
    n_pictures = int((1 - sum(_SHARE.values())) * n_bytes / _PICTURE)
    make = _Messages(store, kind)
    with Writer1(path) if kind == "ros1" else Writer2(path, version=9, storage_plugin=plugin) as writer:
        types = {
            "/joint_states": "sensor_msgs/msg/JointState",
            "/tf": tf,
            "/camera/image_raw": "sensor_msgs/msg/Image",
        }
        connections = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in types.items()}
        duration = 600 * _SECOND
        plan = [(k * duration // n_states, "/joint_states", k) for k in range(n_states)]
        plan += [(k * duration // n_moves, "/tf", k) for k in range(n_moves)]
        plan += [(k * duration // n_pictures, "/camera/image_raw", k) for k in range(n_pictures)]
        for at, topic, k in sorted(plan):
            message = make.of(topic, _START + at, k)
            raw = (store.serialize_ros1 if kind == "ros1" else store.serialize_cdr)(message, types[topic])
            writer.write(connections[topic], _START + at, raw)
    return path


class _Messages:
    """Messages of the three topics."""

    def __init__(self, store: Any, kind: str) -> None:
        self.types, self.seq = store.types, {"seq": 0} if kind == "ros1" else {}
        self.names = [f"joint{k}" for k in range(_JOINTS)]
        self.picture = np.random.default_rng(0).integers(0, 256, _PICTURE, dtype=np.uint8)

    def of(self, topic: str, ns: int, k: int) -> Any:
        if topic == "/joint_states":
            x = np.sin(0.001 * k + np.arange(_JOINTS))
            state = self.types["sensor_msgs/msg/JointState"]
            return state(self._header(ns), name=self.names, position=x, velocity=x, effort=np.zeros(0))
        if topic == "/tf":
            links = [self._transform(ns, i, 0.01 * k + i) for i in range(_LINKS)]
            return self.types["tf2_msgs/msg/TFMessage"](transforms=links)
        picture = self.types["sensor_msgs/msg/Image"]
        return picture(self._header(ns), 480, 640, "rgb8", 0, 640 * 3, self.picture)

    def _header(self, ns: int, frame: str = "") -> Any:
        time = self.types["builtin_interfaces/msg/Time"](sec=ns // _SECOND, nanosec=ns % _SECOND)
        return self.types["std_msgs/msg/Header"](stamp=time, frame_id=frame, **self.seq)

    def _transform(self, ns: int, i: int, angle: float) -> Any:
        part = "geometry_msgs/msg/"
        rotation = self.types[f"{part}Quaternion"](0.0, 0.0, float(np.sin(angle / 2)), float(np.cos(angle / 2)))
        transform = self.types[f"{part}Transform"](self.types[f"{part}Vector3"](0.1, 0.0, 0.05), rotation)
        return self.types[f"{part}TransformStamped"](self._header(ns, f"link{i}"), f"link{i + 1}", transform)
