"""A joint trajectory as an episode of a data set of LeRobot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from kineme.errors import SpecificationError
from kineme.io.lerobot.write_episode import write_episode
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.models.robot import Robot
from kineme.robots.planning.roles import DRIVERS, JOINT_UNITS
from kineme.units import UNITS, split_head
from kineme.validation import Array, check_choice, check_number

_FASTEST = 10_000.0  # frames per second


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
