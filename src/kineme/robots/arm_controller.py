"""A movement under live control on the joints of an arm: the controller of a primitive, and inverse kinematics."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.rotations.matrices import matrices_of
from kineme.movements.rotations.one_rotation import matrix_one
from kineme.primitives.control.controller import Controller
from kineme.primitives.control.state import State
from kineme.robots.kinematics.inverse import InverseKinematics
from kineme.robots.kinematics.reach import point_in_words, reaching_postures
from kineme.robots.models.robot import Robot, check_robot
from kineme.validation import Array, as_numbers


class ArmState(NamedTuple):
    """An arm after one step of live control.

    Attributes
    ----------
    joints, velocities : ndarray of shape (n,)
        What to send now [rad, m], per second.
    distance : float
        Of the tip from where the movement is [m]: above 0 where limits of the joints hold it back.
    movement : State
        Of the movement; see `kineme.control.State`.
    """

    joints: Array
    velocities: Array
    distance: float
    movement: State


class ArmController:
    """Moves an arm step by step as the controller of a primitive says, within its limits of position and velocity.

    In each step the controller moves on, and one step of `InverseKinematics` follows it. With ``feedback="phase"`` the
    controller is told where the tip is, so that the movement waits for an arm that its limits hold back. Accelerations,
    torques and self-collision are not looked at.

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
        self._ik = InverseKinematics(robot, follow, controller.dt)
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
        distance = float(np.linalg.norm(self._ik.tip_position - movement.position[:3]))
        self.state = ArmState(self._ik.q, np.zeros(self.robot.n_joints), distance, movement)
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
        last, (position, rotation) = self.state.joints, self._pose(movement)
        joints = self._ik.step(position, rotation)
        velocities = (joints - last) / self.controller.dt
        self.state = ArmState(joints, velocities, self._ik.error, movement)
        return self.state

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
