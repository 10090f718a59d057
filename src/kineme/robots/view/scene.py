"""A movement on an arm as the viewer of Rerun shows it."""

from __future__ import annotations

import numpy as np

from kineme.io.writing.rerun import Scene, Stretch
from kineme.robots.kinematics.descent import kinematics
from kineme.robots.planning.robot_movement import RobotMovement


def robot_scene(movement: RobotMovement, name: str) -> Scene:
    """Return the joints over time, the tip as it is executed and as it is wanted, and when the approach is over.

    Joints are in rad or m, the tip in the frame of the robot's base [m]; `name` is that of the movement.
    """
    robot, trajectory = movement.robot, movement.trajectory
    joints = tuple(f"{joint} [{unit}]" for joint, unit in zip(robot.joints, robot.units, strict=True))
    rates = tuple(f"{joint} [{unit}/s]" for joint, unit in zip(robot.joints, robot.units, strict=True))
    signals = {"joints": trajectory.positions, "velocities": trajectory.velocities}
    names = {"joints": joints, "velocities": rates}
    if trajectory.steps:
        signals["steps"] = np.column_stack([*trajectory.steps.values()])
        names["steps"] = tuple(trajectory.steps)
    paths = {f"tip of {robot.name}": kinematics(robot, trajectory.positions)[0]}
    if movement.path is not None:
        wanted = np.full((len(trajectory.times), 3), np.nan)
        wanted[len(wanted) - len(movement.path.positions) :] = movement.path.positions
        paths["wanted"] = wanted
    begins, ends = float(movement.begins), float(trajectory.times[-1])
    stretches = [Stretch(0.0, begins, "approach")] if begins > 0 else []
    return Scene(name, trajectory.times, signals, names, paths, {"symbols": [*stretches, Stretch(begins, ends, name)]})
