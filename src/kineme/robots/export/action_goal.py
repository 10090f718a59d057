"""A joint trajectory as the goal of the action FollowJointTrajectory, for ``ros2 action send_goal``."""

from __future__ import annotations

import json
from pathlib import Path

from kineme.output.atomic import write_atomically
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.export.ros_messages import nanoseconds, seconds_and_nanoseconds


def write_action_goal(path: Path, trajectory: JointTrajectory) -> Path:
    """Write JSON, which is YAML too: both ``.json`` and ``.yaml`` are read by ROS 2."""
    return write_atomically(path, (json.dumps(action_goal(trajectory)) + "\n").encode())


def action_goal(trajectory: JointTrajectory) -> dict[str, object]:
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
