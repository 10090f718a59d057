"""Inverse kinematics of an arm that moves: one step of time each, within limits of velocity and acceleration."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from kineme.robots.kinematics.descent import POSTURE_COST
from kineme.robots.kinematics.inverse import InverseKinematics, is_partial
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_AT = 1 - 1e-9  # share of a limit from which it counts as met

_SHARE = 0.5  # of the acceleration with which a gap is closed; the movement itself needs the rest
_CURVED = 0.3  # damping of a step, per distance from the pose: at a stretched arm this is how much the reach bends
_NEAR = 0.01  # gaps far below this are closed without damping [m]
_CLOSED = 1e-6  # gaps below this are closed in one step [m]
_TINY = 1e-300  # no change at all, and no division by it
_LONGEST = 1.0  # farther than this nothing is asked of one step [m]


class LiveKinematics(InverseKinematics):
    """Follows a pose that moves, within limits of position, velocity and acceleration of the joints.

    A step asks for the pose's own motion since the last step, and for that part of the gap to it which the joints can
    still brake at its end. The least squares of `InverseKinematics` are solved within the velocities of `Braking`. Far
    from the pose the step is damped in proportion to the distance, so that an arm stretched towards a pose out of reach
    comes to rest.

    Parameters
    ----------
    robot : Robot
    orientation : {"full", "axis", "free"}
        See `InverseKinematics`.
    time_step : float
        Of a step [s].

    Attributes
    ----------
    velocities, accelerations : ndarray of shape (n,)
        Of the joints in the last step; 0 at first.
    """

    def __init__(self, robot: Robot, orientation: str, time_step: float) -> None:
        self._braking, self._dt = Braking(robot, time_step), time_step
        super().__init__(robot, orientation)
        from qpsolvers import Problem

        self._problem = Problem
        self._weights = np.concatenate((np.ones(3), self.costs))
        self._still = np.zeros(robot.n_joints)
        self._turns = np.zeros(3) if is_partial(robot) else self.costs

    def reset(self, q: Array) -> None:
        """Start from joint positions q (n,), at rest; the pose to follow is that of the tip."""
        super().reset(q)
        self.velocities = self.accelerations = self._before = np.zeros(self.robot.n_joints)
        self._allowed = self._braking.range(self._configuration.q, self.velocities)
        self._at = self._wanted = self._configuration.get_transform_frame_to_world(self.robot.tip)

    def start_from(self, position: Array, rotation: Array) -> None:
        """The pose to follow is there now."""
        self._wanted = self._pose(rotation, position)

    @property
    def error(self) -> float:
        """Distance of the tip from where it was asked to be at the last step [m]."""
        return math.dist(self._at.translation, self._wanted.translation)

    @property
    def turned(self) -> float:
        """Angle of the tip from how it was asked to be turned [rad], of what is followed."""
        return math.hypot(*(self._turns * self._log(self._at.rotation.T @ self._wanted.rotation)))

    @property
    def reasons(self) -> Reasons:
        """Which limits bound the last step."""
        return self._braking.reasons(self._allowed, self._before, self.velocities)

    def step(self, position: Array, rotation: Array) -> Array:
        """Follow the pose to where it is after one more step of time; joint positions (n,) then."""
        last, self._wanted, self._before = self._wanted, self._pose(rotation, position), self.velocities
        self._allowed = self._braking.range(self._configuration.q, self._before)
        change = self._within(self._allowed, *self._asked(last))
        # The solver keeps limits to 1e-6 only; where it finds nothing, the joints brake.
        self.velocities = self._allowed.nearest(self._still if change is None else change / self._dt)
        self.accelerations = (self.velocities - self._before) / self._dt
        q = self._configuration.q + self.velocities * self._dt
        self._configuration.update(np.minimum(np.maximum(q, self.robot.lower), self.robot.upper))
        self._at = self._configuration.get_transform_frame_to_world(self.robot.tip)
        return self.q

    def _asked(self, last: Any) -> tuple[Array, Array]:
        """What this step asks of the joints: ``|A dq|^2 / 2 - b dq`` is least, as `A' A` (n, n) and b (n,)."""
        at, wanted, q = self._at, self._wanted, self._configuration.q
        back = at.rotation.T
        away, turn = _bounded(last.translation - at.translation), self._log(back @ last.rotation)
        gap = self._weights * np.concatenate((back @ away, turn))
        distance = math.hypot(*gap)
        J = self._weights[:, None] * self._configuration.get_frame_jacobian(self.robot.tip)
        curvature = J.T @ J
        curvature.flat[:: len(q) + 1] += _CURVED * distance * distance / (distance + _NEAR) + POSTURE_COST**2
        to_rest = self.robot.rest - q
        closing = np.linalg.solve(curvature, J.T @ gap) if distance > _CLOSED else self._still
        share, share_to_rest = self._shares(np.array((closing, to_rest)))
        moved = back @ (share * away + _bounded(wanted.translation - last.translation))
        turned = self._log(self._exp(share * turn) @ (last.rotation.T @ wanted.rotation))
        way = self._weights * np.concatenate((moved, turned))
        return curvature, J.T @ way + POSTURE_COST**2 * share_to_rest * to_rest

    def _within(self, allowed: Range, curvature: Array, slope: Array) -> Array | None:
        """The change of the joints (n,) that a step asks for, within a range of velocities."""
        problem = self._problem(curvature, -slope, lb=allowed.least * self._dt, ub=allowed.most * self._dt)
        found = self._solve(problem, solver="daqp")
        return np.asarray(found.x) if found.found and found.x is not None else None

    def _shares(self, changes: Array) -> Array:
        """How much of changes of the joints (m, n) one step may take so that it can be braked where they end."""
        sizes = np.abs(changes)
        fastest = brakeable(sizes, _SHARE * self._braking.change, self._dt)
        ways = np.minimum(fastest, self.robot.velocity) * self._dt
        return np.minimum((ways / np.maximum(sizes, _TINY)).min(axis=1), 1.0)


def _bounded(way: Array) -> Array:
    """A way (3,) of at most 1 m in its direction."""
    length = math.hypot(*way)
    return way if length <= _LONGEST else way * (_LONGEST / length)


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
