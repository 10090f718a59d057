"""A joint trajectory as messages of ROS: JointTrajectory, and JointState at each sample for those who play it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np

from kineme.errors import DataError
from kineme.reporting.atomic import whole_file, whole_folder, write_atomically
from kineme.robots.execution.joint_trajectory import JointTrajectory

_WITHOUT_POINT = re.compile(r"(?<=[ \[-])(\d+)(e[-+]\d+)")


TOPIC = "/joint_trajectory_controller/joint_trajectory"  # that of ros2_control
STATES = "/joint_states"

TRAJECTORY, STATE = "trajectory_msgs/msg/JointTrajectory", "sensor_msgs/msg/JointState"
_SECOND = 1_000_000_000  # [ns]


def trajectory_message(types: dict[str, Any], trajectory: JointTrajectory) -> Any:
    """One JointTrajectory; its time stamp is 0, which controllers take as now."""
    points = [
        types["trajectory_msgs/msg/JointTrajectoryPoint"](
            positions=positions,
            velocities=velocities,
            accelerations=accelerations,
            effort=np.zeros(0),
            time_from_start=types["builtin_interfaces/msg/Duration"](**seconds_and_nanoseconds(nanoseconds(time))),
        )
        for time, positions, velocities, accelerations in zip(
            trajectory.times, trajectory.positions, trajectory.velocities, trajectory.accelerations, strict=True
        )
    ]
    return types[TRAJECTORY](header=_header(types, 0), joint_names=list(trajectory.joints), points=points)


def state_messages(types: dict[str, Any], trajectory: JointTrajectory) -> Iterator[tuple[int, Any]]:
    """A JointState for each sample with its time from the start [ns]; discrete channels are further names."""
    names = [*trajectory.joints, *trajectory.steps]
    steps = np.column_stack([np.zeros((len(trajectory), 0)), *trajectory.steps.values()])
    for t, time in enumerate(trajectory.times):
        stamp = nanoseconds(time)
        yield (
            stamp,
            types[STATE](
                header=_header(types, stamp),
                name=names,
                position=np.concatenate((trajectory.positions[t], steps[t])),
                velocity=np.concatenate((trajectory.velocities[t], np.zeros(steps.shape[1]))),
                effort=np.zeros(0),
            ),
        )


def nanoseconds(time: float) -> int:
    """A time [s] in nanoseconds."""
    return round(float(time) * _SECOND)


def seconds_and_nanoseconds(stamp: int) -> dict[str, int]:
    """Nanoseconds as ROS divides them."""
    return {"sec": stamp // _SECOND, "nanosec": stamp % _SECOND}


def _header(types: dict[str, Any], stamp: int) -> Any:
    header = types["std_msgs/msg/Header"]
    counted = {"seq": 0} if "seq" in header.__dataclass_fields__ else {}  # ROS 1 counts messages
    return header(stamp=types["builtin_interfaces/msg/Time"](**seconds_and_nanoseconds(stamp)), frame_id="", **counted)


def write_bag(path: str | Path, trajectory: JointTrajectory, topic: str = TOPIC) -> Path:
    """Write a ``.bag`` of ROS 1, a ``.mcap`` of ROS 2, or, with no ending, a folder of ROS 2 with MCAP in it.

    One JointTrajectory on `topic` at time 0, and a JointState for each sample on /joint_states. The definitions of both
    types in the bag begin with a comment that says the units.

    Raises
    ------
    DataError
        Another ending, the extra ``ros`` is not installed, or a file that cannot be written.
    """
    try:
        import rosbags  # noqa: F401 - so that the message names the extra
    except ImportError as error:
        raise DataError("expected the package rosbags to write bags; pip install 'kineme[ros]'") from error
    path = Path(path)
    if path.suffix == ".bag":
        with whole_file(path) as hidden:
            hidden.unlink(missing_ok=True)
            _write_1(hidden, trajectory, topic)
    elif path.suffix == ".mcap":
        with whole_file(path) as hidden:
            folder = hidden.with_name(hidden.name + ".folder")
            try:
                _write_2(folder, trajectory, topic)
                next(folder.glob("*.mcap")).replace(hidden)
            finally:
                rmtree(folder, ignore_errors=True)
    elif not path.suffix:
        with whole_folder(path) as hidden:
            _write_2(hidden / path.name, trajectory, topic)
            for part in (hidden / path.name).iterdir():
                part.replace(hidden / part.name)
            (hidden / path.name).rmdir()
    else:
        raise DataError(f"expected a bag ending in .bag, .mcap or, for a folder, nothing, got {path.name!r}")
    return path


def _write_1(path: Path, trajectory: JointTrajectory, topic: str) -> None:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(path) as writer:
        _fill(writer, store, store.serialize_ros1, trajectory, topic)


def _write_2(folder: Path, trajectory: JointTrajectory, topic: str) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.LATEST)
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        _fill(writer, store, store.serialize_cdr, trajectory, topic)


def _fill(writer: Any, store: Any, serialize: Any, trajectory: JointTrajectory, topic: str) -> None:
    wanted, states = (
        writer.add_connection(name, kind, **_definition(store, kind, trajectory))
        for name, kind in ((topic, TRAJECTORY), (STATES, STATE))
    )
    writer.write(wanted, 0, serialize(trajectory_message(store.types, trajectory), TRAJECTORY))
    for stamp, message in state_messages(store.types, trajectory):
        writer.write(states, stamp, serialize(message, STATE))


def _definition(store: Any, kind: str, trajectory: JointTrajectory) -> dict[str, str]:
    """The definition of a type with the units in front, which its checksum leaves out, and that checksum."""
    units = ", ".join(f"{name} [{unit}]" for name, unit in zip(trajectory.joints, trajectory.units, strict=True))
    about = f"# positions of {units}; velocities per s, accelerations per s^2\n"
    if "seq" in store.types["std_msgs/msg/Header"].__dataclass_fields__:  # ROS 1
        definition, checksum = store.generate_msgdef(kind)
        return {"msgdef": about + definition, "md5sum": checksum}
    definition, _ = store.generate_msgdef(kind, ros_version=2)
    return {"msgdef": about + definition, "rihs01": store.hash_rihs01(kind)}


def write_action_goal(path: str | Path, trajectory: JointTrajectory) -> Path:
    """Write JSON, which is YAML too: both ``.json`` and ``.yaml`` are read by ROS 2.

    Numbers without a decimal point, as 1e-05, get one: YAML 1.1 takes them for texts.
    """
    goal = action_goal(trajectory)["trajectory"]
    points = _WITHOUT_POINT.sub(r"\1.0\2", json.dumps(goal["points"]))  # there are no texts in them but their keys
    text = f'{{"trajectory": {{"joint_names": {json.dumps(goal["joint_names"])}, "points": {points}}}}}\n'
    return write_atomically(Path(path), text.encode())


def action_goal(trajectory: JointTrajectory) -> dict[str, dict[str, Any]]:
    """The goal as numbers, texts, lists and dicts."""
    points = []
    for time, q, v, a in zip(
        trajectory.times, trajectory.positions, trajectory.velocities, trajectory.accelerations, strict=True
    ):
        points.append(
            {
                "positions": q.tolist(),
                "velocities": v.tolist(),
                "accelerations": a.tolist(),
                "time_from_start": seconds_and_nanoseconds(nanoseconds(time)),
            }
        )
    return {"trajectory": {"joint_names": list(trajectory.joints), "points": points}}
