"""A joint trajectory as messages of ROS: JointTrajectory, and JointState at each sample for those who play it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from kineme.errors import DataError, SpecificationError
from kineme.io.lerobot.write_episode import write_episode
from kineme.io.writing.write_movement import ColumnNames, Columns, encode_movement, write_movement
from kineme.reporting.atomic import whole_file, whole_folder, write_atomically
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.models.robot import Robot
from kineme.robots.planning.roles import DRIVERS, JOINT_UNITS
from kineme.units import UNITS, split_head
from kineme.validation import Array, check_choice, check_number

_FASTEST = 10_000.0  # frames per second

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


def write_joints(path: str | Path, trajectory: JointTrajectory) -> Path:
    """Times, joints and discrete channels under their names, then velocities ``v_NAME`` and accelerations ``a_NAME``.

    The heads of joints end in their units: ``shoulder_pan [rad]``, ``v_shoulder_pan [rad/s]``.

    Raises
    ------
    DataError
        An ending that no writer has, or a file that cannot be written.
    """
    return write_movement(Path(path), *as_columns(trajectory))


def encode_joints(trajectory: JointTrajectory, ending: str = ".csv") -> bytes:
    """The bytes of such a file."""
    columns, names = as_columns(trajectory)
    return encode_movement(columns, ending, names)


def as_columns(trajectory: JointTrajectory) -> tuple[Columns, ColumnNames]:
    """The arrays, and what their columns are called."""
    positions = np.column_stack((trajectory.positions, *trajectory.steps.values()))
    columns = {
        "times": trajectory.times,
        "positions": positions,
        "velocities": trajectory.velocities,
        "accelerations": trajectory.accelerations,
    }
    joints = tuple(f"{name} [{unit}]" for name, unit in zip(trajectory.joints, trajectory.units, strict=True))
    return columns, ColumnNames((*joints, *trajectory.steps), joints)


def write_lerobot(
    folder: str | Path,
    trajectory: JointTrajectory,
    task: str,
    fps: float = 30.0,
    robot: str | Robot = "arm",
    joint_units: str = "deg",
) -> int:
    """Write one episode into a new data set of version 3.0, or behind the others of one that is there.

    ``observation.state`` holds the positions of the joints, as ``shoulder_pan.pos``, and under their names the channels
    beside them as of a gripper, at ``k / fps`` seconds. The names and units of joints are those that LeRobot's drivers
    take; ``units`` beside ``names`` in meta/info.json says them, meters of joints that slide. ``action`` is the state
    of the next frame, where the arm is told to go; in the last frame it is that state itself. Between the samples
    positions are cubic, with the velocities of the trajectory.

    Parameters
    ----------
    folder : str or Path
    trajectory : JointTrajectory
    task : str
        What is done, as the name of the symbol.
    fps : float, default 30
        Frames per second, at most 10,000.
    robot : str or Robot
        Type of the robot, of a new data set; of a `Robot` its name.
    joint_units : {"deg", "rad", "percent"}, default "deg"
        Degrees, which the drivers take unless ``use_degrees`` is False; radians; or, with a `Robot`, -100 to 100
        between the limits of each joint in its URDF: calibrate the arm so that its limits are these.

    Returns
    -------
    int
        Number of the episode.

    Raises
    ------
    SpecificationError
        Another unit; "percent" without a `Robot`, or with joints without limits.
    DataError
        The extra ``parquet`` is not installed; or a data set of another version, with other features or another rate.
    """
    check_number("fps", fps, above=0.0, most=_FASTEST)
    check_choice("joint_units", joint_units, tuple(JOINT_UNITS))
    state = states_at(trajectory, fps)
    n = len(trajectory.joints)
    state[:, :n], units = _in_units(trajectory, state[:, :n], robot, joint_units)
    action = np.concatenate((state[1:], state[-1:]))
    entries = dict(zip((f"{joint}{DRIVERS}" for joint in trajectory.joints), units, strict=True))
    entries |= dict(map(split_head, trajectory.steps))
    features = {"action": action, "observation.state": state}
    return write_episode(Path(folder), features, entries, fps, task, robot.name if isinstance(robot, Robot) else robot)


def _in_units(
    trajectory: JointTrajectory, positions: Array, robot: str | Robot, joint_units: str
) -> tuple[Array, list[str | None]]:
    """Positions of the joints (T, n) in these units, and the unit of each."""
    if joint_units != "percent":
        units = [joint_units if unit == "rad" else unit for unit in trajectory.units]
        sizes = [float(UNITS[unit].size) for unit in units]
        return positions / sizes, [*units]
    if (
        not isinstance(robot, Robot)
        or robot.joints != trajectory.joints
        or not np.isfinite(robot.upper - robot.lower).all()
    ):
        raise SpecificationError(
            "expected the robot of the trajectory, with limits of every joint, to write percent of their ranges, got "
            f"{robot!r:.80}; give robot=, or write joint_units='deg'"
        )
    return 200 * (positions - robot.lower) / (robot.upper - robot.lower) - 100, [JOINT_UNITS["percent"]] * len(
        robot.joints
    )


def states_at(trajectory: JointTrajectory, fps: float) -> Array:
    """Positions and discrete channels at even times, the end among them or at most a frame behind, shape (T, d)."""
    n = int(np.ceil(trajectory.duration * fps - 1e-6)) + 1
    times = np.minimum(np.arange(n) / fps, trajectory.duration)
    joints = CubicHermiteSpline(trajectory.times, trajectory.positions, trajectory.velocities)(times)
    held = np.searchsorted(trajectory.times, times + 1e-9, "right") - 1
    return np.column_stack((joints, *(values[held] for values in trajectory.steps.values())))
