"""A movement under live control on the joints of an arm: the controller of a primitive, and inverse kinematics."""

from __future__ import annotations

import math
from enum import Flag, auto
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.dmp.control.controller import Controller
from kineme.dmp.control.state import State
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.rotations import matrices_of, matrix_one
from kineme.robots.checks.tracking import TRACKED, TURNED
from kineme.robots.execution.timing import Torques
from kineme.robots.kinematics.reach import point_in_words, reaching_postures
from kineme.robots.live.live_kinematics import LiveKinematics
from kineme.robots.models.robot import Robot, check_robot
from kineme.validation import Array, as_numbers


class ArmStatus(Flag):
    """Whether an arm follows its movement, and what holds it back; members combine. ``ArmStatus(0)``: it follows.

    The limits are those that bound some joint in this step, named while the arm lags. Limits of position, velocity and
    acceleration are kept; a torque is reported and not changed.
    """

    LAGS = auto()
    POSITION_LIMIT = auto()
    VELOCITY_LIMIT = auto()
    ACCELERATION_LIMIT = auto()
    TORQUE_LIMIT = auto()

    @property
    def messages(self) -> tuple[str, ...]:
        """One sentence for each member that is set."""
        return tuple(MESSAGES[member] for member in self)


MESSAGES = {
    ArmStatus.LAGS: "the tip is more than 1 mm or 1 degree from where the movement is",
    ArmStatus.POSITION_LIMIT: "a joint brakes before its stop, or stands at it",
    ArmStatus.VELOCITY_LIMIT: "a joint moves as fast as it may",
    ArmStatus.ACCELERATION_LIMIT: "a joint accelerates or brakes as hard as it may",
    ArmStatus.TORQUE_LIMIT: "a joint would need more torque than it has; the step was not changed",
}


class ArmState(NamedTuple):
    """An arm after one step of live control.

    Attributes
    ----------
    joints : ndarray of shape (n,)
        What to send now [rad, m].
    velocities : ndarray of shape (n,)
        Of the joints during this step, per second: constant in it.
    accelerations : ndarray of shape (n,)
        Change of the velocities since the last step, per second squared.
    torques : ndarray of shape (n,)
        What that takes by the model [Nm, N], without friction and load; nan where it knows no masses.
    distance : float
        Of the tip from where the movement is [m]: above 0 where limits of the joints hold it back.
    status : ArmStatus
        Whether the arm follows, and which limits hold it back.
    movement : State
        Of the movement; see `kineme.control.State`.
    """

    joints: Array
    velocities: Array
    accelerations: Array
    torques: Array
    distance: float
    status: ArmStatus
    movement: State


_TURNED = math.radians(TURNED)
_FOLLOWS = ArmStatus(0)
_LIMITS = (ArmStatus.POSITION_LIMIT, ArmStatus.VELOCITY_LIMIT, ArmStatus.ACCELERATION_LIMIT)  # as in `Reasons`


class ArmController:
    """Moves an arm step by step as the controller of a primitive says, within the limits of its joints.

    In each step the controller moves on, and inverse kinematics follows it within the limits of position, velocity and
    acceleration: joints go only as fast as they can brake before their stops, whatever the goal does. An arm that they
    hold back lags, says so in `ArmState.status`, and closes the gap without overshooting. With ``feedback="phase"`` the
    controller is told where the tip is, so that the movement waits for it. Torques are reported; self-collision is not
    looked at.

    Parameters
    ----------
    robot : Robot
    controller : Controller
        Of a primitive of the tip: three positions in the frame of the robot [m], or poses (7 columns).
    start : array_like of shape (n,), optional
        Where the joints stand; by default in the posture, of those that reach the start of the movement, that is
        nearest to the rest posture.
    orientation : array_like of shape (4,), optional
        Unit quaternion w, x, y, z of the tip, for movements without orientations; by default that at rest.
    follow : {"full", "axis", "free"}, default "full"
        How much of the orientation is followed; see `InverseKinematics`.

    Attributes
    ----------
    state : ArmState
        After the last step; at first the start.

    Raises
    ------
    TrajectoryError
        A movement of other columns, an orientation that is no unit quaternion, or a start out of reach.
    SpecificationError
        Joints that stand outside their limits, or as many as the arm does not have.
    DataError
        The extra ``robot`` is not installed.
    """

    state: ArmState

    def __init__(
        self,
        robot: Robot,
        controller: Controller,
        *,
        start: ArrayLike | None = None,
        orientation: ArrayLike | None = None,
        follow: str = "full",
    ) -> None:
        check_robot(robot)
        d = len(controller.state.position)
        if d not in (3, 7):
            raise TrajectoryError(
                f"expected a controller of three positions, or of poses of seven columns, got {d} columns"
            )
        self.robot, self.controller = robot, controller
        self._ik, self._torques = LiveKinematics(robot, follow, controller.dt), Torques(robot)
        self._rotation = self._ik.tip_rotation if orientation is None else _rotation(orientation)
        controller.reset()
        self._start = self._nearest_start() if start is None else as_numbers(start, "start")
        if self._start.shape != (robot.n_joints,):
            raise SpecificationError(f"expected start as {robot.n_joints} joints, got shape {self._start.shape}")
        self._waits = controller.options.feedback == "phase"
        self.reset()

    def reset(self) -> ArmState:
        """Back to the start, movement and joints; returns the state there."""
        self._ik.reset(self._start)
        movement = self.controller.reset()
        self._ik.start_from(*self._pose(movement))
        self.state = self._report(movement)
        return self.state

    def step(self, **told: Any) -> ArmState:
        """Move on by the controller's dt.

        Parameters
        ----------
        **told
            As to `kineme.control.Controller.step`: goal, goal_velocity, obstacles, tempo, ...; but for dt. Where the
            controller has ``feedback="phase"``, position is by default that of the tip.

        Raises
        ------
        SpecificationError
            A dt.
        """
        if "dt" in told:
            raise SpecificationError("expected no dt: an arm moves in steps of its controller's dt")
        if self._waits and "position" not in told:
            told["position"] = self._tip()
        movement = self.controller.step(**told)
        self._ik.step(*self._pose(movement))
        self.state = self._report(movement)
        return self.state

    def _report(self, movement: State) -> ArmState:
        ik = self._ik
        q, distance = ik.q, ik.error
        torques = self._torques.of(q, ik.velocities, ik.accelerations)
        status = ArmStatus.TORQUE_LIMIT if self._torques.exceeded(torques) else _FOLLOWS
        if distance > TRACKED or ik.turned > _TURNED:
            status |= ArmStatus.LAGS
            for limit, bounds in zip(_LIMITS, ik.reasons, strict=True):
                status |= limit if bounds else _FOLLOWS
        return ArmState(q, ik.velocities, ik.accelerations, torques, distance, status, movement)

    def _pose(self, movement: State) -> tuple[Array, Array]:
        """Position (3,) and rotation (3, 3) of the tip that the movement asks for."""
        columns = movement.position
        return columns[:3], self._rotation if len(columns) == 3 else np.array(matrix_one(columns[3:].tolist()))

    def _tip(self) -> Array:
        """Where the tip is, in the columns of the movement."""
        return self._ik.tip_pose[: len(self.state.movement.position)]

    def _nearest_start(self) -> Array:
        position, rotation = self._pose(self.controller.state)
        what = f"the start of the movement, {point_in_words(position)} m"
        found = reaching_postures(self.robot, position, rotation, self._ik.costs, what)
        away = np.abs(found - self.robot.rest).max(axis=1)
        return np.asarray(found[int(np.argmin(away))])


def _rotation(orientation: ArrayLike) -> Array:
    q = as_numbers(orientation, "orientation")
    if q.shape != (4,):
        raise TrajectoryError(f"expected orientation as one quaternion (w, x, y, z), got shape {q.shape}")
    return matrices_of(q)
