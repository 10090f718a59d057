"""Move an arm: what is asked for, the joints along it, its timing and its checks, one after the other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.pose.pose_dmp import PosePrimitives
from kineme.dmp.rhythmic.rhythmic_dmp import RhythmicPrimitives
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.channels.channel import Channel
from kineme.movements.channels.coordinates import as_wxyz
from kineme.movements.rotations import quaternion_of
from kineme.movements.segmentation.segment import as_recording
from kineme.robots.execution.preflight import TRACKED
from kineme.robots.kinematics import descent
from kineme.robots.kinematics.pursuit import choose_place, choose_posture, pursue
from kineme.robots.models.robot import Robot, check_robot, check_start
from kineme.robots.planning import robot_movement
from kineme.robots.planning.roles import (
    JOINT_UNITS,
    SPACES,
    check_columns,
    check_plausible,
    plane_of,
    roles_of,
    scales_of,
    space_of,
)
from kineme.validation import Array, as_numbers, check_choice, check_number, check_switch

PLACES = ("as given", "free")
_STRICTER = {follow: list(descent.ORIENTATIONS)[i::-1] for i, follow in enumerate(descent.ORIENTATIONS)}  # itself first
_SAMPLES = (150, 600)  # poses at least for which the joints are solved, whatever the duration; more where needed
_CLOSE = 1e-5  # to the path between them [m]

_HURRIED = 4.0  # times the mean acceleration, from which on another way is sought; a stroke takes less than three
_LOST = ("tracking", "turned away", "jump", "position")  # checks of what another way may mend
_SLOWER = 1.1  # times as slow as demonstrated: other ways are tried


def move(  # noqa: PLR0913 - one parameter per option
    movement: Any,
    robot: Robot,
    *,
    space: str = "auto",
    orientation: ArrayLike | None = None,
    follow: str = "full",
    plane: str | None = None,
    place: str = "as given",
    timing: str = "generated",
    rate: float = 100.0,
    start: ArrayLike | None = None,
    steps: Mapping[str, Array] | None = None,
    continuous: Mapping[str, Array] | None = None,
    joint_units: str | None = None,
    force: bool = False,
) -> robot_movement.RobotMovement:
    """Make a movement of the tip or of the joints executable on an arm, and check it.

    Parameters
    ----------
    movement : Trajectory, Rollout, PoseRollout, primitive, or what else holds one movement
        Positions of the tip in the frame of the robot, of two or three dimensions, alone or with orientations; or
        positions of the joints. In meters and radians, unless its channels name another unit. Its discrete channels
        are kept as `steps`.
    robot : Robot
    space : {"auto", "tip", "joints"}, default "auto"
        Of what the positions are. "auto": of the joints, if columns have their names, alone or as ``shoulder_pan.pos``
        in data sets of LeRobot, or if there are as many angles as the robot has joints; without channels, if there are
        as many columns, neither two, three nor a pose. Else of the tip.
    orientation : array_like of shape (4,), optional
        Unit quaternion w, x, y, z of the tip throughout; by default as in the movement, and where it has none, that of
        the rest posture.
    follow : {"full", "axis", "free"}, default "full"
        How much of the orientation is followed; see `InverseKinematics`.
    plane : {"xy", "xz", "yz"}, optional
        Where the axes of a two-dimensional movement lie; the third coordinate is that of the tip at rest. By default
        the axes that names of columns say, as x and z, else "xy".
    place : {"as given", "free"}, default "as given"
        "free" shifts the movement to where the arm executes it best.
    timing : {"generated", "slowed", "fastest"}, default "generated"
        That of the movement; the same, slowed down evenly as far as limits demand; or the least time that keeps the
        limits along the path.
    rate : float, default 100
        Samples per second of what is sent, 1 to 10,000.
    start : array_like of shape (n,), optional
        Where the joints stand now, in radians and meters; by default the rest posture. The approach begins there.
    steps : dict of str to array_like of shape (T,), optional
        Discrete channels, as of a gripper, at the samples of the movement: kept as steps, whatever the timing.
    continuous : dict of str to array_like of shape (T,), optional
        Channels that move on and are no joints, as a gripper from 0 to 100: interpolated, and sent beside `steps`.
        Those of a movement whose columns have the names of the joints are taken without being given.
    joint_units : {"deg", "rad", "percent"}, optional
        Of joints whose columns say no unit: degrees, radians, or -100 to 100 between the limits of each joint in its
        URDF, as LeRobot's drivers normalize to their calibration. By default radians; of columns that are called as
        LeRobot's drivers call them, ``shoulder_pan.pos``, degrees, which a warning says.
    force : bool, default False
        Return a trajectory that did not pass its checks.

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
    if plane is not None:
        check_choice("plane", plane, list(descent.PLANES))
    check_choice("timing", timing, robot_movement.TIMINGS)
    check_choice("place", place, PLACES)
    if joint_units is not None:
        check_choice("joint_units", joint_units, tuple(JOINT_UNITS))
    check_number("rate", rate, least=robot_movement.SLOWEST_RATE, most=robot_movement.FASTEST_RATE)
    check_switch("force", force)
    request = request_of(movement, robot, space, steps, continuous, joint_units)
    stands = robot.rest
    if start is not None:
        stands = as_numbers(start, "start")
        if stands.shape != (robot.n_joints,):
            raise TrajectoryError(
                f"expected start as the positions of {robot.n_joints} joints, got shape {stands.shape}"
            )
        check_start(robot, stands)
    planned = robot_movement.PlannedPath(
        robot,
        CubicSpline(request.times, request.positions),
        None,
        stands,
        rate,
        request.times,
        request.steps,
        follow,
        request.continuous,
    )
    if request.space == "joints":
        if not force:
            robot_movement.refuse_outside(robot, request.times, request.positions)
        result = robot_movement.with_timing(planned, timing)
        if not force:
            robot_movement.refuse_failed(result, planned, timing)
        return result
    ik = descent.InverseKinematics(robot, follow)
    # A missing orientation or third coordinate is that of the tip at rest.
    turned = request.orientations if orientation is None else orientation
    turned = quaternion_of(ik.tip_rotation) if turned is None else turned
    plane = plane_of(request.columns, plane)
    path = descent.task_path(request.times, request.positions, turned, plane, ik.tip_position)
    return _along(ik, path, place, planned, timing, force)


def _along(
    ik: descent.InverseKinematics,
    path: descent.TaskPath,
    place: str,
    planned: robot_movement.PlannedPath,
    timing: str,
    force: bool,
) -> robot_movement.RobotMovement:
    """Return the first way along the path that passes its checks, of slow ones the fastest; with `force`, the first."""
    failed: list[tuple[robot_movement.RobotMovement, robot_movement.PlannedPath]] = []
    slower: list[robot_movement.RobotMovement] = []
    errors: list[TrajectoryError] = []
    lost = False
    # What may be left free may also be followed.
    solvers = [ik, *(descent.InverseKinematics(ik.robot, stricter) for stricter in _STRICTER[planned.follow][1:])]
    for way in (Way(solver, sought) for sought in (False, True) for solver in solvers):  # the quickest first
        if way.sought and not lost:
            break
        try:
            joints, placed = way.joints(path, place, planned.start)
            if not force:
                descent.check_reached(ik.robot, placed, joints(placed.times), way.ik.costs, TRACKED)
            solved = planned._replace(joints=joints, path=placed)
            result = robot_movement.with_timing(solved, timing)
        except TrajectoryError as error:
            errors.append(error)
            lost |= not isinstance(error, descent.OutOfReachError)
            continue
        passed = result.preflight.passed
        if force or (passed and (timing == "generated" or result.factor <= _SLOWER)):
            return result
        lost |= any(check.what in _LOST for check in result.preflight.failed) or _hurries(solved)
        if passed:
            slower.append(result)
        else:
            failed.append((result, solved))
    if slower:
        return min(slower, key=lambda result: result.factor)
    if not failed:
        raise errors[0]
    nearest = min(failed, key=lambda way: way[0].preflight.slower if _hurries(way[1]) else 0.0)
    robot_movement.refuse_failed(*nearest, timing)
    return nearest[0]


def _hurries(planned: robot_movement.PlannedPath) -> bool:
    """Tell whether the joints accelerate many times as hard at one place of the path as along it in the mean."""
    shares = np.abs(planned.joints(planned.joints.x, 2) / planned.robot.acceleration).max(axis=1)
    return bool(shares.max() > _HURRIED * shares.mean())


class Way(NamedTuple):
    """A way in which the joints may follow a movement; it is solved when it is asked for."""

    ik: descent.InverseKinematics
    sought: bool  # by `pursue`, among many postures: that takes as long as fifty others

    def joints(self, path: descent.TaskPath, place: str, stands: Array) -> tuple[CubicSpline, descent.TaskPath]:
        """Solve the joints over time, and place the path where it is free, at least cost from where they stand (n,)."""
        robot, costs = self.ik.robot, self.ik.costs
        if place == "free":
            path = choose_place(robot, path, costs)
        start = choose_posture(robot, path, costs, stands)
        if self.sought:
            way = pursue(robot, path, costs)
            if way is None:
                raise TrajectoryError(f"{robot.name} reaches no way along this movement")
            return CubicSpline(way[1].times, way[0]), way[1]
        for n in _SAMPLES:
            dense = path if len(path.times) >= n else path.at(np.linspace(0.0, path.times[-1], n))
            self.ik.reset(start)
            self.ik.solve(dense.positions[0], dense.rotations[0])
            joints = CubicSpline(dense.times, self.ik.follow(dense.positions, dense.rotations))
            between = (dense.times[:-1] + dense.times[1:]) / 2
            off = descent.kinematics(robot, joints(between))[0] - dense.at(between).positions
            if np.abs(off).max() <= _CLOSE:
                break
        return joints, dense


class Request(NamedTuple):
    """One movement of the tip or of the joints, T samples."""

    times: Array  # (T,) [s], from 0
    space: str  # "tip" or "joints"
    positions: Array  # (T, d) [m] or [rad]
    columns: tuple[Channel, ...]  # of the positions; empty if nothing is known of them
    orientations: Array | None  # (T, 4), w, x, y, z
    steps: dict[str, Array]  # discrete channels, (T,)
    continuous: dict[str, Array]  # channels that move and are no joints, (T,)


def request_of(
    movement: Any, robot: Robot, space: str, steps: Any = None, continuous: Any = None, joint_units: str | None = None
) -> Request:
    """Read the arguments of `move` as one movement; `steps` and `continuous` besides such channels of its own."""
    if isinstance(movement, Primitives | PosePrimitives | RhythmicPrimitives):
        movement = movement.rollout()
    recording = as_recording(movement)
    times, columns = recording.times, np.asarray(recording.recorded, dtype=float)
    space = space_of(recording.channels, columns, robot) if space == "auto" else space
    roles = roles_of(recording.channels, columns.shape[1], space, robot)
    joints = robot if space == "joints" else None
    check_columns(roles, joints)
    scales = scales_of(roles, joints, joint_units)
    positions = columns[:, roles.positions] * scales.size + scales.offset
    if space == "joints":
        check_plausible(positions, robot)
    turned = None if roles.orientation is None else as_wxyz(columns[:, roles.orientation[1]], roles.orientation[0])
    beside: list[dict[str, Array]] = []
    for what, recorded, given in (("steps", roles.discrete, steps), ("continuous", roles.continuous, continuous)):
        if not isinstance(given, Mapping | None) or not all(isinstance(name, str) for name in given or {}):
            raise SpecificationError(f"expected {what} as a dict of channels and their values, got {given!r:.80}")
        channels = {name: columns[:, k] for name, k in recorded.items()}
        beside.append(channels | {name: as_numbers(values, name) for name, values in (given or {}).items()})
    for name, values in (*beside[0].items(), *beside[1].items()):
        if name in robot.joints:
            raise TrajectoryError(f"expected other channels of other names than the joints have, got {name!r}")
        if values.shape != times.shape:
            raise TrajectoryError(f"expected {len(times)} values of {name}, one for each sample, got {values.shape}")
    return Request(times - times[0], space, positions, roles.columns, turned, *beside)
