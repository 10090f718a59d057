"""A trajectory between its samples, as controllers interpolate it."""

from __future__ import annotations

import numpy as np

from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_APART = 0.05  # between two postures that are looked at no joint moves farther [rad, m]


def between(trajectory: JointTrajectory, times: Array) -> JointTrajectory:
    """The trajectory at other times (m,) within its own.

    Between two samples lies the polynomial of the fifth order that has the positions, velocities and accelerations of
    both at its ends: that is how the joint_trajectory_controller of ROS interpolates. Discrete channels hold.
    """
    held = np.searchsorted(trajectory.times, times, "right") - 1
    k = np.clip(held, 0, len(trajectory) - 2)
    h = np.diff(trajectory.times)[k, None]
    u = (times - trajectory.times[k])[:, None] / h
    q, v, a = trajectory.positions, h * trajectory.velocities[k], h**2 * trajectory.accelerations[k]
    distance = q[k + 1] - q[k] - v - a / 2
    more = h * trajectory.velocities[k + 1] - v - a
    most = h**2 * trajectory.accelerations[k + 1] - a
    c3, c4, c5 = (
        10 * distance - 4 * more + most / 2,
        -15 * distance + 7 * more - most,
        6 * distance - 3 * more + most / 2,
    )
    return JointTrajectory(
        trajectory.joints,
        times,
        q[k] + u * (v + u * (a / 2 + u * (c3 + u * (c4 + u * c5)))),
        (v + u * (a + u * (3 * c3 + u * (4 * c4 + u * 5 * c5)))) / h,
        (a + u * (6 * c3 + u * (12 * c4 + u * 20 * c5))) / h**2,
        {name: values[held] for name, values in trajectory.steps.items()},
    )


def dense_times(robot: Robot, trajectory: JointTrajectory) -> Array:
    """The times of the samples, and evenly between them so many that no joint moves farther than 0.05 rad or m."""
    times = trajectory.times
    gaps = np.diff(times)[:, None]
    speeds = np.maximum(np.abs(trajectory.velocities[1:]), np.abs(trajectory.velocities[:-1]))
    speeds = np.maximum(speeds, np.abs(np.diff(trajectory.positions, axis=0)) / gaps)
    moved = (gaps * np.minimum(np.nan_to_num(speeds), robot.velocity)).max(axis=1)
    parts = np.maximum(1, np.ceil(moved / _APART)).astype(int)
    first = np.repeat(np.arange(len(parts)), parts)
    share = (np.arange(len(first)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[first]
    return np.append(times[first] + share * gaps[first, 0], times[-1])
