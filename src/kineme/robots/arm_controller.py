"""A movement under live control on the joints of an arm: the controller of a primitive, and inverse kinematics."""

from __future__ import annotations

import math
from enum import Flag, auto
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from kineme.dmp.control.controller import Controller
from kineme.dmp.control.plan import State
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.channels.channel import recorded_names
from kineme.movements.rotations import NORM_TOLERANCE, matrices_of, matrix_one
from kineme.movements.trajectories.presented import with_units
from kineme.robots.execution.joint_trajectory import Torques
from kineme.robots.execution.preflight import TRACKED, TURNED
from kineme.robots.kinematics import descent
from kineme.robots.models.robot import Robot, check_robot
from kineme.robots.planning.roles import roles_of, scales_of
from kineme.validation import Array, as_numbers, as_point

_AT = 1 - 1e-9  # share of a limit from which it counts as met

_SHARE = 0.5  # of the acceleration with which a gap is closed; the movement itself needs the rest
_CURVED = 0.3  # damping of a step, per distance from the pose: at a stretched arm this is how much the reach bends
_NEAR = 0.01  # gaps far below this are closed without damping [m]
_CLOSED = 1e-6  # gaps below this are closed in one step [m]
_TINY = 1e-300  # no change at all, and no division by it
_LONGEST = 1.0  # farther than this nothing is asked of one step [m]


class ArmStatus(Flag):
    """State of an arm that follows its movement, and what holds it back; members combine. ``ArmStatus(0)``: it follows.

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

    - `joints` (n,): what to send now [rad, m].
    - `velocities` (n,): of the joints during this step, per second: constant in it.
    - `accelerations` (n,): change of the velocities since the last step, per second squared.
    - `torques` (n,): what that takes by the model [Nm, N], without friction and load; nan where it knows no masses.
    - `distance`: of the tip from where the movement is [m]: above 0 where limits of the joints hold it back.
    - `status`: whether the arm follows, and which limits hold it back.
    - `movement`: of the movement; see `kineme.control.State`.
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
        Of a primitive of the tip: x, y, z in the frame of the robot [m], or poses (7 columns), learned in this order.
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
        controller: Controller[Any],
        *,
        start: ArrayLike | None = None,
        orientation: ArrayLike | None = None,
        follow: str = "full",
    ) -> None:
        check_robot(robot)
        check_tip(controller)
        self.robot, self.controller = robot, controller
        self._ik, self._torques = LiveKinematics(robot, follow, controller.dt), Torques(robot)
        self._rotation = self._ik.tip_rotation
        if orientation is not None:
            q = as_numbers(orientation, "orientation")
            if q.shape != (4,):
                raise TrajectoryError(f"expected orientation as one quaternion (w, x, y, z), got shape {q.shape}")
            self._rotation = matrices_of(q)
        controller.reset()
        self._start = self._nearest_start() if start is None else as_point("start", start, robot.joints)
        self._waits = controller.options.feedback == "phase"
        self.reset()

    def __reduce__(self) -> NoReturn:
        raise SpecificationError(
            "expected a robot and a controller to be pickled or copied, got the arm controller over both; make it in "
            "each process: ArmController(robot, controller)"
        )

    def reset(self) -> ArmState:
        """Back to the start, movement and joints; returns the state there."""
        self._ik.reset(self._start)
        movement = self.controller.reset()
        self._ik.start_from(*self._pose(movement))
        self.state = self._report(movement)
        return self.state

    def step(self, **options: Any) -> ArmState:
        """Move on by the controller's dt.

        Parameters
        ----------
        **options
            As to `kineme.control.Controller.step`: goal, goal_velocity, obstacles, tempo, ...; but for dt. Where the
            controller has ``feedback="phase"``, position is by default that of the tip.

        Raises
        ------
        SpecificationError
            A dt.
        """
        if "dt" in options:
            raise SpecificationError("expected no dt: an arm moves in steps of its controller's dt")
        if self._waits and "position" not in options:
            options["position"] = self._ik.tip_pose[: len(self.state.movement.position)]
        movement = self.controller.step(**options)
        self._ik.step(*self._pose(movement))
        self.state = self._report(movement)
        return self.state

    def _report(self, movement: State) -> ArmState:
        ik = self._ik
        q, distance = ik.q, ik.error
        torques = self._torques.of(q, ik.velocities, ik.accelerations)
        status = ArmStatus.TORQUE_LIMIT if self._torques.exceeded(torques) else _FOLLOWS
        if distance > TRACKED or ik.turned > _TURNED:
            status |= ArmStatus.LAGS | ik.reasons
        return ArmState(q, ik.velocities, ik.accelerations, torques, distance, status, movement)

    def _pose(self, movement: State) -> tuple[Array, Array]:
        """Position (3,) and rotation (3, 3) of the tip that the movement asks for."""
        columns = movement.position
        return columns[:3], self._rotation if len(columns) == 3 else np.array(matrix_one(columns[3:].tolist()))

    def _nearest_start(self) -> Array:
        position, rotation = self._pose(self.controller.state)
        what = f"the start of the movement, {descent.point_in_words(position)} m"
        postures = descent.reaching_postures(self.robot, position, rotation, self._ik.costs, what)
        away = np.abs(postures - self.robot.rest).max(axis=1)
        return np.asarray(postures[int(np.argmin(away))])


def check_tip(controller: Controller[Any]) -> None:
    """Refuse a movement whose columns are not x, y, z [m] in this order, alone or before a unit quaternion."""
    place, channels = controller.state.position, controller.channels
    d = len(place)
    if d not in (3, 7):
        raise TrajectoryError(
            f"expected a controller of three positions, or of poses of seven columns, got {d} columns"
        )
    roles = roles_of(channels, d, "tip")
    in_order = roles.positions == [0, 1, 2] and (d == 3) == (roles.orientation is None)
    if not in_order or np.any(scales_of(roles, None).size != 1.0):
        named = "" if channels is None else ", ".join(with_units(recorded_names(channels), channels))
        raise TrajectoryError(
            f"expected x, y, z [m] in this order, alone or with one quaternion, got {named}; learn columns in "
            "this order (columns=) and in meters, or let robots.move put them so"
        )
    if d == 7 and not abs(np.linalg.norm(place[3:]) - 1.0) <= NORM_TOLERANCE:
        raise TrajectoryError(
            "expected seven columns as a position and a unit quaternion, got a norm of "
            f"{np.linalg.norm(place[3:]):.4g}; of joints use robots.move(..., space='joints')"
        )


class LiveKinematics(descent.InverseKinematics):
    """Follows a pose that moves, within limits of position, velocity and acceleration of the joints.

    A step asks for the pose's own motion, and for that part of the gap to it which the joints can still brake at its
    end, by the least squares of `InverseKinematics` within the velocities of `Braking`. It is damped in proportion to
    the distance, so that an arm stretched towards a pose out of reach comes to rest.
    """

    def __init__(self, robot: Robot, orientation: str, time_step: float) -> None:
        self._braking, self._dt = Braking(robot, time_step), time_step
        super().__init__(robot, orientation)
        self._weights = np.concatenate((np.ones(3), self.costs))
        self._still = np.zeros(robot.n_joints)
        self._turns = np.zeros(3) if descent.is_partial(robot) else self.costs

    def reset(self, q: Array) -> None:
        """Start from joint positions q (n,), at rest; the pose to follow is that of the tip."""
        super().reset(q)
        self.velocities = self.accelerations = self._before = np.zeros(self.robot.n_joints)
        self._allowed = self._braking.range(self._configuration.q, self.velocities)
        self._at = self._wanted = self._configuration.get_transform_frame_to_world(self.robot.tip)

    def start_from(self, position: Array, rotation: Array) -> None:
        """The pose to follow is there now."""
        import pinocchio

        self._wanted = pinocchio.SE3(rotation, position)

    @property
    def error(self) -> float:
        """Distance of the tip from where it was asked to be at the last step [m]."""
        return math.dist(self._at.translation, self._wanted.translation)

    @property
    def turned(self) -> float:
        """Angle of the tip from how it was asked to be turned [rad], of what is followed."""
        import pinocchio

        return math.hypot(*(self._turns * pinocchio.log3(self._at.rotation.T @ self._wanted.rotation)))

    @property
    def reasons(self) -> ArmStatus:
        """The limits that bound the last step."""
        return self._braking.reasons(self._allowed, self._before, self.velocities)

    def step(self, position: Array, rotation: Array) -> Array:
        """Follow the pose to where it is after one more step of time; joint positions (n,) then."""
        import pinocchio

        last, self._wanted, self._before = self._wanted, pinocchio.SE3(rotation, position), self.velocities
        self._allowed = self._braking.range(self._configuration.q, self._before)
        change = self._within(self._allowed, *self._least_squares(last))
        # The solver keeps limits to 1e-6 only; where it finds nothing, the joints brake.
        self.velocities = self._allowed.nearest(self._still if change is None else change / self._dt)
        self.accelerations = (self.velocities - self._before) / self._dt
        q = self._configuration.q + self.velocities * self._dt
        self._configuration.update(np.minimum(np.maximum(q, self.robot.lower), self.robot.upper))
        self._at = self._configuration.get_transform_frame_to_world(self.robot.tip)
        return self.q

    def _least_squares(self, last: Any) -> tuple[Array, Array]:
        """Return what this step asks of the joints, least of ``|A dq|^2 / 2 - b dq``, as `A' A` (n, n) and b (n,)."""
        import pinocchio

        at, wanted, q = self._at, self._wanted, self._configuration.q
        back = at.rotation.T
        away, turn = _bounded(last.translation - at.translation), pinocchio.log3(back @ last.rotation)
        gap = self._weights * np.concatenate((back @ away, turn))
        distance = math.hypot(*gap)
        J = self._weights[:, None] * self._configuration.get_frame_jacobian(self.robot.tip)
        curvature = J.T @ J
        curvature.flat[:: len(q) + 1] += _CURVED * distance * distance / (distance + _NEAR) + descent.POSTURE_COST**2
        to_rest = self.robot.rest - q
        closing = np.linalg.solve(curvature, J.T @ gap) if distance > _CLOSED else self._still
        share, share_to_rest = self._shares(np.array((closing, to_rest)))
        moved = back @ (share * away + _bounded(wanted.translation - last.translation))
        turned = pinocchio.log3(pinocchio.exp3(share * turn) @ (last.rotation.T @ wanted.rotation))
        way = self._weights * np.concatenate((moved, turned))
        return curvature, J.T @ way + descent.POSTURE_COST**2 * share_to_rest * to_rest

    def _within(self, allowed: Range, curvature: Array, slope: Array) -> Array | None:
        """The change of the joints (n,) that a step asks for, within a range of velocities."""
        from qpsolvers import Problem, solve_problem

        problem = Problem(curvature, -slope, lb=allowed.least * self._dt, ub=allowed.most * self._dt)
        solution = solve_problem(problem, solver="daqp")
        return np.asarray(solution.x) if solution.found and solution.x is not None else None

    def _shares(self, changes: Array) -> Array:
        """Return how much of changes of the joints (m, n) one step may take so that it can be braked where they end."""
        sizes = np.abs(changes)
        fastest = brakeable(sizes, _SHARE * self._braking.change, self._dt)
        ways = np.minimum(fastest, self.robot.velocity) * self._dt
        return np.minimum((ways / np.maximum(sizes, _TINY)).min(axis=1), 1.0)


def _bounded(way: Array) -> Array:
    """A way (3,) of at most 1 m in its direction."""
    length = math.hypot(*way)
    return way if length <= _LONGEST else way * (_LONGEST / length)


def brakeable(distance: Array, change: Array, dt: float) -> Array:
    """The fastest velocities (..., n) from which joints stop within distances (..., n), in steps of `dt` [s].

    Velocities are constant over a step and decrease by `change` (n,) from one to the next. Of one that stops in m steps
    the distance is ``dt (m v - change m (m - 1) / 2)``; m is the least number of steps with
    ``distance <= dt change m (m + 1) / 2``. For short steps that is ``sqrt(2 change / dt distance)``, which alone would
    overshoot by up to a step.
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


class Braking:
    """The range of velocities from which every later step keeps the limits of position, velocity and acceleration.

    A joint at q with velocity v may go with velocities of [v - a dt, v + a dt] and of [-v_max, v_max], from which it
    can brake before either stop. The range is never empty if the joints began at rest and have kept to it since: from a
    velocity that can be braked, the first step of that braking leads to one that can.

    Sources: F. Flacco, A. De Luca, O. Khatib, "Control of Redundant Robots Under Hard Joint Constraints: Saturation in
    the Null Space", IEEE Transactions on Robotics 31(3), 2015; A. Del Prete, "Joint Position and Velocity Bounds in
    Discrete-Time Acceleration/Torque Control of Robot Arms", IEEE Robotics and Automation Letters 3(1), 2018.
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

    def reasons(self, allowed: Range, before: Array, after: Array) -> ArmStatus:
        """Tell which limits keep a velocity `after` (n,) one of `before` within the range, of any joint."""
        at_end = (after >= allowed.most) | (after <= allowed.least)
        changed = np.abs(after - before) >= self.change * _AT
        fastest = np.abs(after) >= self.robot.velocity * _AT
        status = ArmStatus.POSITION_LIMIT if (at_end & ~changed & ~fastest).any() else _FOLLOWS
        status |= ArmStatus.VELOCITY_LIMIT if (at_end & fastest).any() else _FOLLOWS
        return status | (ArmStatus.ACCELERATION_LIMIT if (at_end & changed).any() else _FOLLOWS)
