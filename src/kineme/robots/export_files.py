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
from kineme.reporting.text import printable
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


def stamp_of(time: float) -> dict[str, int]:
    """A time [s] as ROS divides it."""
    seconds, nanoseconds = divmod(_nanoseconds(time), _SECOND)
    return {"sec": seconds, "nanosec": nanoseconds}


def _nanoseconds(time: float) -> int:
    return round(float(time) * _SECOND)


def write_bag(path: str | Path, trajectory: JointTrajectory, topic: str = TOPIC) -> Path:
    """Write a ``.bag`` of ROS 1, a ``.mcap`` of ROS 2, or, with no ending, a folder of ROS 2 with MCAP in it.

    One JointTrajectory on `topic` at time 0, and a JointState for each sample on /joint_states. The definitions of both
    types in the bag begin with a comment that says the units.

    Raises `DataError`: another ending, the extra ``ros`` is not installed, or a file that cannot be written.
    """
    try:
        from rosbags import rosbag1, rosbag2
    except ImportError as error:
        raise DataError("expected the package rosbags to write bags; pip install 'kineme[ros]'") from error

    def write_2(folder: Path) -> None:
        with rosbag2.Writer(folder, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
            _fill(writer, trajectory, topic, is_ros1=False)

    path = Path(path)
    if path.suffix == ".bag":
        with whole_file(path) as hidden:
            hidden.unlink(missing_ok=True)
            with rosbag1.Writer(hidden) as writer:
                _fill(writer, trajectory, topic, is_ros1=True)
    elif path.suffix == ".mcap":
        with whole_file(path) as hidden:
            folder = hidden.with_name(hidden.name + ".folder")
            try:
                write_2(folder)
                next(folder.glob("*.mcap")).replace(hidden)
            finally:
                rmtree(folder, ignore_errors=True)
    elif not path.suffix:
        with whole_folder(path) as hidden:
            write_2(hidden / path.name)
            for part in (hidden / path.name).iterdir():
                part.replace(hidden / part.name)
            (hidden / path.name).rmdir()
    else:
        raise DataError(f"expected a bag ending in .bag, .mcap or, for a folder, nothing, got {path.name!r}")
    return path


def _fill(writer: Any, trajectory: JointTrajectory, topic: str, *, is_ros1: bool) -> None:
    """Write a JointTrajectory, whose time stamp 0 controllers take as now, and a JointState of each sample."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.LATEST)
    serialize, types = store.serialize_ros1 if is_ros1 else store.serialize_cdr, store.types
    wanted, states = (
        writer.add_connection(name, kind, **_definition(store, kind, trajectory, is_ros1))
        for name, kind in ((topic, TRAJECTORY), (STATES, STATE))
    )

    def header(time: float) -> Any:
        counted = {"seq": 0} if is_ros1 else {}  # ROS 1 counts messages
        stamp = types["builtin_interfaces/msg/Time"](**stamp_of(time))
        return types["std_msgs/msg/Header"](stamp=stamp, frame_id="", **counted)

    points = [
        types["trajectory_msgs/msg/JointTrajectoryPoint"](
            positions=positions,
            velocities=velocities,
            accelerations=accelerations,
            effort=np.zeros(0),
            time_from_start=types["builtin_interfaces/msg/Duration"](**stamp_of(time)),
        )
        for time, positions, velocities, accelerations in samples_of(trajectory)
    ]
    message = types[TRAJECTORY](header=header(0.0), joint_names=list(trajectory.joints), points=points)
    writer.write(wanted, 0, serialize(message, TRAJECTORY))
    names, n_steps = [*trajectory.joints, *trajectory.steps], len(trajectory.steps)
    values = np.column_stack((trajectory.positions, *trajectory.steps.values()))
    rates = np.column_stack((trajectory.velocities, np.zeros((len(trajectory), n_steps))))
    for time, position, velocity in zip(trajectory.times, values, rates, strict=True):
        state = types[STATE](header=header(time), name=names, position=position, velocity=velocity, effort=np.zeros(0))
        writer.write(states, _nanoseconds(time), serialize(state, STATE))


def samples_of(trajectory: JointTrajectory) -> Iterator[tuple[Any, ...]]:
    """Time, positions, velocities and accelerations of each sample."""
    return zip(trajectory.times, trajectory.positions, trajectory.velocities, trajectory.accelerations, strict=True)


def _definition(store: Any, kind: str, trajectory: JointTrajectory, is_ros1: bool) -> dict[str, str]:
    """The definition of a type with the units in front, which its checksum leaves out, and that checksum."""
    units = ", ".join(f"{name} [{unit}]" for name, unit in zip(trajectory.joints, trajectory.units, strict=True))
    about = f"# positions of {units}; velocities per s, accelerations per s^2\n"
    if is_ros1:
        definition, checksum = store.generate_msgdef(kind)
        return {"msgdef": about + definition, "md5sum": checksum}
    definition, _ = store.generate_msgdef(kind, ros_version=2)
    return {"msgdef": about + definition, "rihs01": store.hash_rihs01(kind)}


def write_action_goal(path: str | Path, trajectory: JointTrajectory) -> Path:
    """Write JSON, which is YAML too: both ``.json`` and ``.yaml`` are read by ROS 2.

    Numbers without a decimal point, as 1e-05, get one: YAML 1.1 takes them for texts.
    """
    rows = [
        {
            "positions": positions.tolist(),
            "velocities": velocities.tolist(),
            "accelerations": accelerations.tolist(),
            "time_from_start": stamp_of(time),
        }
        for time, positions, velocities, accelerations in samples_of(trajectory)
    ]
    points = _WITHOUT_POINT.sub(r"\1.0\2", json.dumps(rows))  # there are no texts in them but their keys
    text = f'{{"trajectory": {{"joint_names": {json.dumps(trajectory.joints)}, "points": {points}}}}}\n'
    return write_atomically(Path(path), text.encode())


def not_in_goal(trajectory: JointTrajectory) -> str:
    """Say which channels beside the joints an action goal does not hold; empty where there are none."""
    if not trajectory.steps:
        return ""
    names = json.dumps(printable(", ".join(trajectory.steps)), ensure_ascii=False)  # of a library: data, in quotes
    return f"the steps of {names} are not in an action goal, which is of joints alone; send them yourself"


def write_joints(path: str | Path, trajectory: JointTrajectory) -> Path:
    """Times, joints and discrete channels under their names, then velocities ``v_NAME`` and accelerations ``a_NAME``.

    The heads of joints end in their units: ``shoulder_pan [rad]``, ``v_shoulder_pan [rad/s]``.

    Raises `DataError`: an ending that no writer has, or a file that cannot be written.
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
    """Write an episode into a new data set of version 3.0, or behind others of one that is there; return its number.

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
    percent = 200 * (positions - robot.lower) / (robot.upper - robot.lower) - 100
    return percent, [JOINT_UNITS["percent"]] * len(robot.joints)


def states_at(trajectory: JointTrajectory, fps: float) -> Array:
    """Positions and discrete channels at even times, the end among them or at most a frame behind, shape (T, d)."""
    n = int(np.ceil(trajectory.duration * fps - 1e-6)) + 1
    times = np.minimum(np.arange(n) / fps, trajectory.duration)
    joints = CubicHermiteSpline(trajectory.times, trajectory.positions, trajectory.velocities)(times)
    held = np.searchsorted(trajectory.times, times + 1e-9, "right") - 1
    return np.column_stack((joints, *(values[held] for values in trajectory.steps.values())))
