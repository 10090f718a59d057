"""A movement on an arm: inverse kinematics, timing, approach and checks, one after the other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.channels.coordinates import as_wxyz
from kineme.movements.segmentation.segment import as_recording
from kineme.primitives.discrete.dmp import Primitives
from kineme.primitives.pose.pose_primitives import PosePrimitives
from kineme.robots.checks.check import Check, Preflight
from kineme.robots.checks.preflight import TRACKED, preflight
from kineme.robots.execution.approach import approach
from kineme.robots.execution.joint_trajectory import JointTrajectory, joined
from kineme.robots.execution.retime import fastest
from kineme.robots.execution.timing import Timing, as_generated, slowed, timed
from kineme.robots.kinematics.choose import check_reached, choose_place, choose_posture
from kineme.robots.kinematics.inverse import InverseKinematics
from kineme.robots.kinematics.task_path import PLANES, TaskPath, task_path
from kineme.robots.models.robot import Robot, check_robot, check_start
from kineme.robots.roles import SPACES, roles_of, space_of
from kineme.validation import Array, as_numbers, check_choice, check_number, check_switch

_TIMINGS = ("generated", "slowed", "fastest")
_SLOWEST_RATE, _FASTEST_RATE = 1.0, 10_000.0  # samples per second of what is sent
_LONGEST = 1_000_000  # samples of one trajectory, at most
_DENSE = 150  # poses at least for which the joints are solved, whatever the duration
_ROUNDS = 4  # of slowing down: torques do not fall as fast as velocities do
_A_LITTLE = 1 + 1e-6


class InfeasibleError(TrajectoryError):
    """A trajectory that an arm cannot or must not execute; ``preflight`` holds the checks."""

    def __init__(self, message: str, preflight: Preflight | None = None) -> None:
        super().__init__(message)
        self.preflight = preflight


@dataclass(frozen=True, eq=False, repr=False)
class RobotMovement:
    """What `move` made.

    Attributes
    ----------
    robot : Robot
    trajectory : JointTrajectory
        What is sent to the arm: the approach from the posture where it stands, then the movement.
    path : TaskPath or None
        What the tip follows, at the samples of the movement; None of a movement of the joints.
    preflight : Preflight
        All checks of `trajectory`.
    begins : float
        When the approach is over and the movement begins [s].
    factor : float
        How many times as long the movement takes as it was generated.
    """

    robot: Robot
    trajectory: JointTrajectory
    path: TaskPath | None
    preflight: Preflight
    begins: float
    factor: float

    def __repr__(self) -> str:
        as_generated = f"{self.factor:.3g} times as long as generated"
        return f"RobotMovement({self.robot.name!r}, {self.trajectory.duration:.2f} s, {as_generated})"


def move(  # noqa: PLR0913 - one parameter per option
    movement: Any,
    robot: Robot,
    *,
    space: str = "auto",
    orientation: ArrayLike | None = None,
    follow: str = "full",
    plane: str = "xy",
    place: str = "as given",
    timing: str = "generated",
    rate: float = 100.0,
    start: ArrayLike | None = None,
    steps: Mapping[str, Array] | None = None,
    force: bool = False,
) -> RobotMovement:
    """Make a movement of the tip or of the joints executable on an arm, and check it.

    Parameters
    ----------
    movement : Trajectory, Rollout, PoseRollout, primitive, or what else holds one movement
        Positions of the tip in the frame of the robot, of two or three dimensions, alone or with orientations; or
        positions of the joints. In meters and radians, unless its channels name another unit. Its discrete channels
        are kept as `steps`.
    robot : Robot
    space : {"auto", "tip", "joints"}, default "auto"
        Of what the positions are. "auto": of the joints, if there are as many angles as the robot has joints; without
        channels, if there are as many columns, neither two, three nor a pose. Else of the tip.
    orientation : array_like of shape (4,), optional
        Unit quaternion w, x, y, z of the tip throughout; by default as in the movement, and where it has none, that of
        the rest posture.
    follow : {"full", "axis", "free"}, default "full"
        How much of the orientation is followed; see `InverseKinematics`.
    plane : {"xy", "xz", "yz"}, default "xy"
        Where the axes of a two-dimensional movement lie; the third coordinate is that of the tip at rest.
    place : {"as given", "free"}, default "as given"
        "free" shifts the movement to where the arm executes it best.
    timing : {"generated", "slowed", "fastest"}, default "generated"
        That of the movement; the same, slowed down evenly as far as limits demand; or the least time that keeps the
        limits along the path.
    rate : float, default 100
        Samples per second of what is sent, 1 to 10,000.
    start : array_like of shape (n,), optional
        Where the joints stand now; by default the rest posture. The approach begins there.
    steps : dict of str to array_like of shape (T,), optional
        Discrete channels, as of a gripper, at the samples of the movement: kept as steps, whatever the timing.
    force : bool, default False
        Return a trajectory that did not pass its checks.

    Returns
    -------
    RobotMovement

    Raises
    ------
    InfeasibleError
        A check did not pass: which joint, when, its value beside the limit, and the least duration that works.
    TrajectoryError
        A pose out of reach, a movement of the wrong dimension, or several movements.
    SpecificationError
        An unknown option; a start outside the limits; more than a million samples.
    DataError
        The extra ``robot`` is not installed.
    """
    check_robot(robot)
    check_choice("space", space, SPACES)
    check_choice("plane", plane, list(PLANES))
    check_choice("timing", timing, _TIMINGS)
    check_choice("place", place, ("as given", "free"))
    check_number("rate", rate, least=_SLOWEST_RATE, most=_FASTEST_RATE)
    check_switch("force", force)
    wanted = _wanted(movement, robot, space)
    at = robot.rest if start is None else _posture(start, robot)
    if wanted.space == "joints":
        path, joints = None, _joints(wanted, robot)
    else:
        ik = InverseKinematics(robot, follow)
        path, joints = _inverse(ik, _path(ik, wanted, orientation, plane), place, at)
        if not force:
            check_reached(robot, path, joints, ik.costs, TRACKED)
    held = {name: _held(values, wanted.times, name) for name, values in {**wanted.steps, **_given(steps)}.items()}
    asked = _Asked(robot, CubicSpline(wanted.times if path is None else path.times, joints), path, at, rate, held)
    made = _in_time(asked, timing)
    if not made.preflight.passed and not force:
        raise InfeasibleError(_refusal(made), made.preflight)
    return made


class _Wanted(NamedTuple):
    """One movement as an arm is asked for it, T samples."""

    times: Array  # (T,) [s], from 0
    space: str
    positions: Array  # (T, d) [m] or [rad]
    orientations: Array | None  # (T, 4), w, x, y, z
    steps: dict[str, Array]


def _wanted(movement: Any, robot: Robot, space: str) -> _Wanted:
    if isinstance(movement, Primitives | PosePrimitives):
        movement = movement.rollout()
    one = as_recording(movement)
    columns = np.asarray(one.recorded, dtype=float)
    space = space_of(one.channels, columns, robot) if space == "auto" else space
    roles = roles_of(one.channels, columns.shape[1], space)
    turned = None if roles.orientation is None else as_wxyz(columns[:, roles.orientation[1]], roles.orientation[0])
    steps = {name: columns[:, k] for name, k in roles.discrete.items()}
    return _Wanted(one.times - one.times[0], space, columns[:, roles.positions] * roles.units, turned, steps)


def _posture(start: ArrayLike, robot: Robot) -> Array:
    q = as_numbers(start, "start")
    if q.shape != (robot.n_joints,):
        raise TrajectoryError(f"expected start as the positions of {robot.n_joints} joints, got shape {q.shape}")
    check_start(robot, q)
    return q


def _joints(wanted: _Wanted, robot: Robot) -> Array:
    n = wanted.positions.shape[1]
    if n != robot.n_joints:
        raise TrajectoryError(f"expected a movement of the {robot.n_joints} joints of {robot.name}, got {n} columns")
    return wanted.positions


def _path(ik: InverseKinematics, wanted: _Wanted, orientation: ArrayLike | None, plane: str) -> TaskPath:
    turned = wanted.orientations if orientation is None else orientation
    at_rest = Rotation.from_matrix(ik.tip_rotation).as_quat(scalar_first=True)
    return task_path(wanted.times, wanted.positions, at_rest if turned is None else turned, plane, ik.tip_position)


def _inverse(ik: InverseKinematics, path: TaskPath, place: str, stands: Array) -> tuple[TaskPath, Array]:
    """The path where it is executed, and the joints along it."""
    choose = choose_place if place == "free" else choose_posture
    chosen = choose(ik.robot, path, ik.costs, stands)
    path = path._replace(positions=path.positions + chosen.shift)
    if len(path.times) < _DENSE:
        path = path.at(np.linspace(0.0, path.times[-1], _DENSE))
    ik.reset(chosen.start)
    ik.solve(path.positions[0], path.rotations[0])
    return path, ik.follow(path.positions, path.rotations)


def _given(steps: Any) -> Mapping[str, Array]:
    if not isinstance(steps, Mapping | None):
        raise SpecificationError(f"expected steps as a dict of channels and their values, got {steps!r:.80}")
    return steps or {}


def _held(values: Array, times: Array, name: str) -> tuple[Array, Array]:
    """Times (T,) from which each value of a discrete channel holds, and the values."""
    values = as_numbers(values, name)
    if values.shape != times.shape:
        raise TrajectoryError(f"expected {len(times)} values of {name}, one for each sample, got {values.shape}")
    return times, values


class _Asked(NamedTuple):
    """What is executed, whatever its timing."""

    robot: Robot
    curve: CubicSpline  # of the joints
    path: TaskPath | None  # of the tip
    start: Array  # (n,), where the joints stand
    rate: float
    held: Mapping[str, tuple[Array, Array]]


def _check_length(n_samples: float) -> None:
    if not n_samples <= _LONGEST:
        raise SpecificationError(
            f"expected at most {_LONGEST:,} samples of one trajectory, got {n_samples:,.0f}; choose a lower rate or a "
            "shorter movement"
        )


def _in_time(asked: _Asked, timing: str) -> RobotMovement:
    """The movement with that timing, slowed down until it passes if that is allowed and helps."""
    _check_length(float(asked.curve.x[-1]) * asked.rate)
    if timing == "fastest":
        curve, chosen = fastest(asked.robot, asked.curve, asked.rate)
        return _checked(asked._replace(curve=curve), chosen)
    chosen = as_generated(asked.robot, asked.curve, asked.rate)
    made = _checked(asked, chosen)
    for _ in range(_ROUNDS if timing == "slowed" else 0):
        if made.preflight.passed or not np.isfinite(made.preflight.slower):
            break
        _check_length(made.trajectory.duration * made.preflight.slower * asked.rate)
        chosen = slowed(chosen, made.preflight.slower * _A_LITTLE, asked.rate)
        made = _checked(asked, chosen)
    return made


def _checked(asked: _Asked, timing: Timing) -> RobotMovement:
    """The approach and the movement with that timing, and the checks of both."""
    robot, path = asked.robot, asked.path
    steps = {
        name: values[np.searchsorted(times, timing.generated + 1e-9, "right") - 1]
        for name, (times, values) in asked.held.items()
    }
    movement = replace(timed(robot, asked.curve, timing), steps=steps)
    first = approach(robot, asked.start, movement.positions[0], asked.rate)
    whole = joined(first, movement)
    wanted = None if path is None else path.at(timing.generated)._replace(times=timing.times + first.duration)
    report = preflight(robot, whole, wanted, first.duration)
    return RobotMovement(robot, whole, wanted, report, first.duration, movement.duration / float(timing.generated[-1]))


def _refusal(made: RobotMovement) -> str:
    failed = made.preflight.failed
    lines: Sequence[str] = [
        f"{c.what} of {c.where} at {c.time:.2f} s{_wanted_at(made, c)}: {c.worst:.3g}, limit {c.limit:.3g} {c.unit}"
        for c in failed[:4]
    ]
    more = f" and {len(failed) - 4} more" if len(failed) > 4 else ""
    duration = made.trajectory.duration - made.begins
    slower = made.preflight.slower
    remedy = (
        f"It works in {duration * slower:.3g} s instead of {duration:.3g}: slow it down (timing='slowed', --slow-down)"
        if np.isfinite(slower)
        else "No speed helps: choose another place, orientation or posture"
    )
    return f"{made.robot.name} cannot execute this: {'; '.join(lines)}{more}. {remedy}"


def _wanted_at(made: RobotMovement, check: Check) -> str:
    """Where the tip was to be when it was farthest from there."""
    if check.what != "tracking" or made.path is None:
        return ""
    position = made.path.positions[int(np.argmin(np.abs(made.path.times - check.time)))]
    return f", from ({', '.join(f'{x:.3f}' for x in position)}) m"
