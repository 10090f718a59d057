"""How fast joints may go in the next step of time, so that they can still stop where they have to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kineme.robots.models.robot import Robot
from kineme.validation import Array

_AT = 1 - 1e-9  # share of a limit from which it counts as met


def brakeable(distance: Array, change: Array, dt: float) -> Array:
    """The fastest velocities (..., n) from which joints stop within distances (..., n).

    Velocities are constant over a step and decrease by `change` (n,) from one to the next. Of one that stops in m steps
    the distance is ``dt (m v - change m (m - 1) / 2)``; m is the least number of steps with
    ``distance <= dt change m (m + 1) / 2``. For short steps that is ``sqrt(2 change / dt distance)``, which alone would
    overshoot by up to a step.

    Parameters
    ----------
    distance : ndarray of shape (..., n)
        What is left, from 0.
    change : ndarray of shape (n,)
        Largest change of velocity in one step.
    dt : float
        Time of a step [s].
    """
    steps = distance / (change * dt)
    m = np.maximum(1.0, np.ceil(0.5 * (np.sqrt(1.0 + 8.0 * steps) - 1.0)))
    return np.asarray(change * (steps + 0.5 * m * (m - 1.0)) / m)


class Range(NamedTuple):
    """Velocities that the joints may have in a step."""

    least: Array  # (n,)
    most: Array  # (n,)

    def nearest(self, velocity: Array) -> Array:
        """The velocities in the range that lie nearest to others (n,)."""
        return np.minimum(np.maximum(velocity, self.least), self.most)


class Reasons(NamedTuple):
    """Which limits a velocity meets, of any joint."""

    position: bool
    velocity: bool
    acceleration: bool


class Braking:
    """The range of velocities from which every later step keeps the limits of position, velocity and acceleration.

    A joint at q with velocity v may go with velocities of [v - a dt, v + a dt] and of [-v_max, v_max], from which it
    can brake before either stop. The range is never empty if the joints began at rest and have kept to it since: from a
    velocity that can be braked, the first step of that braking leads to one that can.

    Sources: F. Flacco, A. De Luca, O. Khatib, "Control of Redundant Robots Under Hard Joint Constraints: Saturation in
    the Null Space", IEEE Transactions on Robotics 31(3), 2015; A. Del Prete, "Joint Position and Velocity Bounds in
    Discrete-Time Acceleration/Torque Control of Robot Arms", IEEE Robotics and Automation Letters 3(1), 2018.

    Parameters
    ----------
    robot : Robot
    dt : float
        Time of a step [s].
    """

    def __init__(self, robot: Robot, dt: float) -> None:
        self.robot, self.dt = robot, dt
        self.change = robot.acceleration * dt  # of velocity in one step

    def range(self, q: Array, velocity: Array) -> Range:
        """The range at joint positions q (n,) after a step with a velocity (n,)."""
        room = np.maximum((q - self.robot.lower, self.robot.upper - q), 0.0)
        down, up = np.minimum(brakeable(room, self.change, self.dt), self.robot.velocity)
        least, most = np.maximum(velocity - self.change, -down), np.minimum(velocity + self.change, up)
        return Range(np.minimum(least, most), most)  # they differ by rounding where only one velocity is left

    def reasons(self, allowed: Range, before: Array, after: Array) -> Reasons:
        """Which limits keep a velocity `after` (n,) one of `before` within the range."""
        at_end = (after >= allowed.most) | (after <= allowed.least)
        changed = np.abs(after - before) >= self.change * _AT
        fastest = np.abs(after) >= self.robot.velocity * _AT
        return Reasons(
            bool((at_end & ~changed & ~fastest).any()), bool((at_end & fastest).any()), bool((at_end & changed).any())
        )
