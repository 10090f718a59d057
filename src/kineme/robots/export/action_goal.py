"""A joint trajectory as the goal of the action FollowJointTrajectory, for ``ros2 action send_goal``."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from kineme.reporting.atomic import write_atomically
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.export.ros_messages import nanoseconds, seconds_and_nanoseconds

_WITHOUT_POINT = re.compile(r"(?<=[ \[-])(\d+)(e[-+]\d+)")


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
