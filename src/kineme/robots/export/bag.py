"""A joint trajectory in a bag of ROS 1 or ROS 2."""

from __future__ import annotations

from pathlib import Path
from shutil import rmtree
from typing import Any

from kineme.errors import DataError
from kineme.reporting.atomic import whole_file, whole_folder
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.export.ros_messages import STATE, TRAJECTORY, state_messages, trajectory_message

TOPIC = "/joint_trajectory_controller/joint_trajectory"  # that of ros2_control
STATES = "/joint_states"


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
