"""A joint trajectory as an episode of a data set of LeRobot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from kineme.files.lerobot.write_episode import write_episode
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.validation import Array, check_number

_FASTEST = 10_000.0  # frames per second


def write_lerobot(
    folder: str | Path, trajectory: JointTrajectory, task: str, fps: float = 30.0, robot: str = "arm"
) -> int:
    """Write one episode into a new data set of version 3.0, or behind the others of one that is there.

    ``observation.state`` holds the positions of the joints and, under their names, the discrete channels as of a
    gripper, at ``k / fps`` seconds. ``action`` is the state of the next frame, where the arm is told to go; in the last
    frame it is that state itself. Between the samples positions are cubic, with the velocities of the trajectory.

    Parameters
    ----------
    folder : str or Path
    trajectory : JointTrajectory
    task : str
        What is done, as the name of the symbol.
    fps : float, default 30
        Frames per second, at most 10,000.
    robot : str
        Type of the robot, of a new data set.

    Returns
    -------
    int
        Number of the episode.

    Raises
    ------
    DataError
        The extra ``parquet`` is not installed; or a data set of another version, with other features or another rate.
    """
    check_number("fps", fps, above=0.0, most=_FASTEST)
    state = states_at(trajectory, fps)
    action = np.concatenate((state[1:], state[-1:]))
    names = (*trajectory.joints, *trajectory.steps)
    return write_episode(Path(folder), {"action": action, "observation.state": state}, names, fps, task, robot)


def states_at(trajectory: JointTrajectory, fps: float) -> Array:
    """Positions and discrete channels at even times, the end among them or at most a frame behind, shape (T, d)."""
    n = int(np.ceil(trajectory.duration * fps - 1e-6)) + 1
    times = np.minimum(np.arange(n) / fps, trajectory.duration)
    joints = CubicHermiteSpline(trajectory.times, trajectory.positions, trajectory.velocities)(times)
    held = np.searchsorted(trajectory.times, times + 1e-9, "right") - 1
    return np.column_stack((joints, *(values[held] for values in trajectory.steps.values())))
