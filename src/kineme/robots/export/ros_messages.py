"""A joint trajectory as messages of ROS: JointTrajectory, and JointState at each sample for those who play it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from kineme.robots.execution.joint_trajectory import JointTrajectory

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
