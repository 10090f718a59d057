"""What a controller makes of a trajectory between its samples."""

from __future__ import annotations

import math
from collections.abc import Iterator

from kineme.robots.checks.check import Check, unit_of
from kineme.robots.execution.between import extreme
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.models.robot import Robot

SAMPLING = " between samples"  # the end of what these checks are called
_POSITION = 1e-6  # beyond a limit between samples [rad, m]
_SLACK = 1.001  # times the limit of velocity and acceleration between samples


def between_samples(robot: Robot, trajectory: JointTrajectory) -> Iterator[Check]:
    """Positions, velocities and accelerations at their worst instant, whether a sample lies there or not.

    Between samples lies what `between` says. Its acceleration overshoots where that of the movement is a step.
    """
    half, middle = (robot.upper - robot.lower) / 2, (robot.upper + robot.lower) / 2
    share, j, time = extreme(trajectory, 0, half, middle)
    beyond = (abs(share) - 1) * float(half[j])
    passed, slower = (True, 1.0) if beyond <= _POSITION else (False, math.inf)
    limit, worst = float((robot.lower if share < 0 else robot.upper)[j]), float(middle[j] + share * half[j])
    yield Check("position" + SAMPLING, robot.joints[j], time, worst, limit, unit_of(robot, j), passed, slower)
    for order, (what, limits) in enumerate((("velocity", robot.velocity), ("acceleration", robot.acceleration)), 1):
        share, j, time = extreme(trajectory, order, limits)
        worst, limit, unit = abs(share), float(limits[j]), unit_of(robot, j, order)
        passed, slower = worst <= _SLACK, worst ** (1 / order)
        yield Check(what + SAMPLING, robot.joints[j], time, worst * limit, limit, unit, passed, slower)
