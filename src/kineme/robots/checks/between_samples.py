"""What a controller makes of a trajectory between its samples."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from kineme.robots.checks.check import Check, unit_of
from kineme.robots.execution.between import between
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.models.robot import Robot

SAMPLING = " between samples"  # the end of what these checks are called
_POSITION = 1e-3  # beyond a limit between samples [rad, m]
_VELOCITY, _ACCELERATION = 1.05, 1.15  # times the limit between samples


def between_samples(robot: Robot, trajectory: JointTrajectory) -> Iterator[Check]:
    """Positions and velocities at quarters of the way from sample to sample, mean accelerations of each half of it.

    Between samples lies what `between` says. Its acceleration overshoots where that of the movement is a step, as in
    the fastest timing; the mean over half of the time is then up to 1.125 times as large, for a step from a limit to
    the opposite one.
    """
    times = trajectory.times
    inner = between(trajectory, (times[:-1, None] + np.diff(times)[:, None] * np.arange(4) / 4).ravel())
    halves = np.append(np.arange(0, len(inner), 2), len(inner))
    velocities = np.vstack((inner.velocities, trajectory.velocities[-1:]))
    ends = np.append(inner.times, times[-1])[halves]
    changes = np.diff(velocities[halves], axis=0) / np.diff(ends)[:, None]
    beyond = np.maximum(inner.positions - robot.upper, robot.lower - inner.positions)
    t, j = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    passed = bool(beyond[t, j] <= _POSITION)
    worst = float(inner.positions[t, j])
    limit = float(robot.upper[j] if worst > (robot.upper[j] + robot.lower[j]) / 2 else robot.lower[j])
    yield Check(
        "position" + SAMPLING, robot.joints[j], float(inner.times[t]), worst, limit, unit_of(robot, int(j)), passed,
        1.0 if passed else math.inf,
    )  # fmt: skip
    rates = (
        ("velocity", velocities, robot.velocity * _VELOCITY),
        ("acceleration", changes, robot.acceleration * _ACCELERATION),
    )
    for order, (what, values, limits) in enumerate(rates, 1):
        shares = np.abs(values) / limits
        t, j = np.unravel_index(int(np.argmax(shares)), shares.shape)
        share, limit = float(shares[t, j]), float(limits[j])
        at = float(np.append(inner.times, times[-1])[t * order])
        yield Check(
            what + SAMPLING, robot.joints[j], at, share * limit, limit, unit_of(robot, int(j), order), share <= 1,
            share ** (1 / order),
        )  # fmt: skip
