"""Poses of the tip to joints: many postures at once, to compare branches and places, and one with its limits."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from kineme.errors import DataError, SpecificationError, TrajectoryError
from kineme.movements.rotations import matrices_of
from kineme.robots.models.robot import Robot, check_robot, check_start
from kineme.validation import Array, as_numbers, check_choice

#: How much of the orientation is followed -> cost of turning about x, y, z of the tip [1/rad], besides 1 per meter.
ORIENTATIONS = {"full": (1.0, 1.0, 1.0), "axis": (1.0, 1.0, 0.0), "free": (0.0, 0.0, 0.0)}

_COORDINATES = 6  # of a pose
_PARTIAL = 0.005  # times these costs, for arms with fewer joints than that: the position comes first
_GAIN = 0.95  # of the way to a limit that one step may go
_STEP_DAMPING = 1e-12
_INSIDE = 0.002  # of the range of a joint, so far from its ends it is kept: between samples a path goes a little beyond
_CLOSE, _MOST_STEPS = 1e-5, 3  # of a pose [m], and steps towards it along a path
_WXYZ = [0, 1, 2, 6, 3, 4, 5]  # pinocchio has w last

_REACHED = 1e-3  # farther from its pose than this, a posture does not reach it [m]
_SEEDS = 48  # starts from which a posture is sought before a pose is said to be out of reach
_MOST_CHECKED = 8  # poses whose distance is sought, of those that are missed
_FAR = 3.0  # from an arm [m]: farther than that, it is rather the unit that is wrong
_REMEDY = (
    "choose another place (--at), free the orientation (follow=, --follow axis), or make the movement smaller (--scale)"
)
_MILLIMETERS = "is it in millimeters? --at and --goal are in meters, --scale 0.001 makes a movement so"

#: Planes in which a two-dimensional movement is executed: its axes in the frame of the robot.
PLANES = {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}

_APART = 0.3  # two postures that differ by less in every joint count as one [rad]
_STEPS = 30
_STARTS = 16
_TOLERANCE = 1e-4  # from the pose [m]

#: Cost of leaving the rest posture [1/rad], besides 1 per meter: decides where the pose leaves the joints free.
POSTURE_COST = 1e-4
_DAMPING = 1e-3  # of a step, per squared distance from the pose: far away the step is one of gradient descent
_ROUNDS = 4  # of finding the joints that come to a stop within a step
_LARGEST = 0.7  # change of a joint in one step [rad, m]


class Reached(NamedTuple):
    """Postures, and how far their tips are from where they should be."""

    joints: Array  # (m, n)
    errors: Array  # (m,) [m]


def descend(
    robot: Robot, joints: Array, positions: Array, rotations: Array, turn_costs: Array, n_steps: int
) -> Reached:
    """Step from `joints` (m, n) to poses (m, 3), (m, 3, 3), by damped least squares (Levenberg and Marquardt).

    They minimize what `InverseKinematics` does; joints that come to a stop stay there, and the others do their part.
    """
    q = np.array(joints, dtype=float)
    weights = np.concatenate((np.ones(3), turn_costs))
    for _ in range(n_steps):
        at, turned, jacobians = kinematics(robot, q)
        error = distances((at, turned), (positions, rotations), turn_costs) * weights
        damping = _DAMPING * np.einsum("mi,mi->m", error, error)
        pull = np.full(len(q), POSTURE_COST**2)
        range_left = robot.lower - q, robot.upper - q
        change = step_within(jacobians * weights[:, None], error, (robot.rest - q, pull, damping), range_left)
        change *= np.minimum(1.0, _LARGEST / np.maximum(np.abs(change).max(axis=1, keepdims=True), 1e-12))
        q = np.clip(q + change, robot.lower, robot.upper)
    return Reached(q, np.linalg.norm(kinematics(robot, q)[0] - positions, axis=1))


def step_within(
    slopes: Array, error: Array, costs: tuple[Array, Array, Array], range_left: tuple[Array, Array]
) -> Array:
    """Minimize ``|A x - error|^2 + pull |x - drift|^2 + damping |x|^2`` within limits, for m postures at once.

    Joints that would pass a limit stop there, and the others are solved again. `slopes` (m, 6, n): A; `error` (m, 6);
    `costs`: drift (m, n), pull and damping (m,); `range_left`: the least and the largest x (m, n).
    """
    drift, pull, damping = costs
    diagonal = (pull + damping)[:, None, None] * np.eye(drift.shape[1])
    stopped, change = np.zeros(drift.shape, dtype=bool), np.zeros_like(drift)
    for _ in range(_ROUNDS):
        free = np.where(stopped[:, None], 0.0, slopes)
        left = error - np.einsum("mij,mj->mi", slopes, np.where(stopped, change, 0.0))
        slope = np.einsum("mij,mi->mj", free, left) + np.where(stopped, 0.0, pull[:, None] * drift)
        moved = np.linalg.solve(free.transpose(0, 2, 1) @ free + diagonal, slope[:, :, None])[:, :, 0]
        change = np.where(stopped, change, moved)
        beyond = ~stopped & ((change < range_left[0]) | (change > range_left[1]))
        change = np.clip(change, *range_left)
        if not beyond.any():
            break
        stopped |= beyond
    return np.asarray(change)


def distances(here: tuple[Array, Array], wanted: tuple[Array, Array], turn_costs: Array) -> Array:
    """Positions and rotation vectors (m, 6) from poses to others, in the axes of the former.

    Where turning about z costs nothing, the shortest turn that brings the z axes together: that of the whole rotation
    changes with the turn about z.
    """
    back = here[1].transpose(0, 2, 1)
    away = np.einsum("mij,mj->mi", back, wanted[0] - here[0])
    if turn_costs[2] == 0:
        x, y, z = (back @ wanted[1][..., 2:])[..., 0].T
        sine = np.hypot(x, y)
        angle = np.arctan2(sine, z) / np.where(sine > 0, sine, 1.0)
        turn = np.column_stack((-y * angle, x * angle, np.zeros_like(x)))
        turn[(sine == 0) & (z < 0), 0] = np.pi
    else:
        turn = Rotation.from_matrix(back @ wanted[1]).as_rotvec()
    return np.concatenate((away, turn), axis=1)


def kinematics(robot: Robot, joints: Array) -> tuple[Array, Array, Array]:
    """Positions (m, 3) and rotations (m, 3, 3) of the tip, and Jacobians (m, 6, n) in its own axes."""
    import pinocchio

    model, data = robot.model, robot.model.createData()
    tip, local = model.getFrameId(robot.tip), pinocchio.ReferenceFrame.LOCAL
    m, n = joints.shape
    positions, rotations, jacobians = np.empty((m, 3)), np.empty((m, 3, 3)), np.empty((m, 6, n))
    for i, q in enumerate(joints):
        pinocchio.computeJointJacobians(model, data, q)
        pose = pinocchio.updateFramePlacement(model, data, tip)
        jacobians[i] = pinocchio.getFrameJacobian(model, data, tip, local).reshape(6, n)  # it has (6,) of one joint
        positions[i], rotations[i] = pose.translation, pose.rotation
    return positions, rotations, jacobians


def postures(robot: Robot, position: Array, rotation: Array, turn_costs: Array, n_starts: int = _STARTS) -> Reached:
    """Joint positions that bring the tip within 0.1 mm of a pose, from rest and from others; the most exact first.

    It is alone if none does. Two that differ by less than 0.3 rad in every joint count as one.
    """
    reached = descend(robot, _starts(robot, n_starts), position, rotation, turn_costs, _STEPS)
    order = np.argsort(reached.errors, kind="stable")
    distinct = [int(order[0])]
    for i in order[1:]:
        apart = np.abs(reached.joints[distinct] - reached.joints[i]).max(axis=1)
        if reached.errors[i] <= _TOLERANCE and apart.min() > _APART:
            distinct.append(int(i))
    return Reached(reached.joints[distinct], reached.errors[distinct])


@lru_cache(maxsize=8)
def _starts(robot: Robot, n: int) -> Array:
    """The rest posture and a Halton sequence within the limits, at most half a turn to each side; always the same."""
    from scipy.stats import qmc  # it takes long to load

    lower, upper = np.clip((-np.pi, np.pi), robot.lower[:, None], robot.upper[:, None]).T
    spread = qmc.Halton(robot.n_joints, scramble=False).random(n)[1:]
    return np.vstack((robot.rest, lower + spread * (upper - lower)))


class TaskPath(NamedTuple):
    """Poses of the tip in the frame of the robot's base, T samples."""

    times: Array  # (T,) [s], from 0
    positions: Array  # (T, 3) [m]
    rotations: Array  # (T, 3, 3)

    def at(self, times: Array) -> TaskPath:
        """The poses at other times: cubic between positions and between orientations."""
        positions = CubicSpline(self.times, self.positions)(times)
        if np.ptp(self.rotations, axis=0).max() == 0:
            return TaskPath(times, positions, np.broadcast_to(self.rotations[0], (len(times), 3, 3)))
        rotations = Rotation.from_matrix(np.array(self.rotations))  # SciPy 1.14 takes no read-only array
        return TaskPath(times, positions, RotationSpline(self.times, rotations)(times).as_matrix())


def task_path(
    times: Array, positions: Array, orientation: ArrayLike, plane: str = "xy", through: ArrayLike | None = None
) -> TaskPath:
    """Positions (T, 2), in a plane through a point, or (T, 3), and quaternions w, x, y, z, one or (T, 4), as poses."""
    d = positions.shape[1]
    if plane not in PLANES:
        raise SpecificationError(f"expected plane as one of {', '.join(PLANES)}, got {plane!r}")
    points = np.tile(np.zeros(3) if through is None else as_numbers(through, "through"), (len(times), 1))
    points[:, list(PLANES[plane]) if d == 2 else [0, 1, 2]] = positions
    q = as_numbers(orientation, "orientation")
    if q.shape not in {(4,), (len(times), 4)}:
        raise TrajectoryError(
            f"expected orientation as one quaternion (w, x, y, z) or {len(times)} of them, got shape {q.shape}"
        )
    return TaskPath(times, points, np.broadcast_to(matrices_of(q), (len(times), 3, 3)))


class OutOfReachError(TrajectoryError):
    """A pose that no posture of an arm reaches."""


def reaching_postures(robot: Robot, position: Array, rotation: Array, turn_costs: Array, what: str) -> Array:
    """Postures (m, n) whose tips reach a pose, which the message of an OutOfReachError calls `what`."""
    for n_starts in (_STARTS, _SEEDS):
        reached = postures(robot, position, rotation, turn_costs, n_starts)
        if reached.errors[0] <= _REACHED:
            return reached.joints
    raise OutOfReachError(_unreachable(robot, what, float(reached.errors[0])))


def check_reached(robot: Robot, path: TaskPath, joints: Array, turn_costs: Array, tolerance: float) -> None:
    """Refuse joints (T, n) whose tip stays farther from the path than `tolerance` [m]; OutOfReachError of a pose."""
    errors = np.linalg.norm(kinematics(robot, joints)[0] - path.positions, axis=1)
    missed = np.flatnonzero(~(errors <= tolerance))
    if len(missed) == 0:
        return
    checked = missed[np.unique(np.linspace(0, len(missed) - 1, _MOST_CHECKED).astype(int))]
    nearest = [postures(robot, path.positions[t], path.rotations[t], turn_costs, _SEEDS).errors[0] for t in checked]
    worst = int(np.argmax(nearest))
    if nearest[worst] > tolerance:
        raise OutOfReachError(_unreachable(robot, pose_in_words(path, int(checked[worst])), float(nearest[worst])))
    raise TrajectoryError(
        f"{robot.name} reaches every pose of this movement, but not one after the other: from "
        f"{path.times[missed[0]]:.2f} to {path.times[missed[-1]]:.2f} s its tip stays up to {errors.max():.3f} m away, "
        f"where joints come to a stop or would have to jump; {_REMEDY}"
    )


def pose_in_words(path: TaskPath, t: int) -> str:
    """Position and time of sample t of a path."""
    return f"{point_in_words(path.positions[t])} m at {path.times[t]:.2f} s"


def point_in_words(position: Array) -> str:
    """A position [m], to the millimeter."""
    return f"({', '.join(f'{x:.3f}' for x in position)})"


def _unreachable(robot: Robot, what: str, distance: float) -> str:
    remedy = _MILLIMETERS if distance > _FAR else _REMEDY
    return f"{robot.name} does not reach {what}: its tip stays {distance:.3f} m away; {remedy}"


class InverseKinematics:
    """The joints of one arm, step by step; the quadratic programs are those of pink, solved by DAQP.

    One step minimizes ``|p - p*|^2 + |c log(R' R*)|^2 + (0.0001 |q - rest|)^2`` to first order in the change of the
    joints q, subject to the limits of position, less 0.2 % of their range: between samples a path goes a little beyond.
    p and R are position and orientation of the tip, starred the wanted ones, log the rotation vector of a rotation, c
    the costs of turning. `LiveKinematics` keeps the limits of velocity and acceleration too.

    Parameters
    ----------
    robot : Robot
    orientation : {"full", "axis", "free"}, default "full"
        "axis" follows the z axis of the tip and leaves the turn about it free, "free" follows the position alone. Arms
        of fewer than six joints follow the orientation as far as the position allows.

    Attributes
    ----------
    robot : Robot
    costs : ndarray of shape (3,)
        c, of turning about x, y, z of the tip [1/rad], besides 1 per meter.

    Raises
    ------
    DataError
        The extra ``robot`` is not installed.
    """

    def __init__(self, robot: Robot, orientation: str = "full") -> None:
        check_robot(robot)
        check_choice("orientation", orientation, list(ORIENTATIONS))
        try:
            import pink  # noqa: F401 - so that the message names the extra
            import qpsolvers  # noqa: F401
            from pink.limits import ConfigurationLimit
            from pink.tasks import FrameTask, PostureTask
        except ImportError as error:
            raise DataError("expected the package pin-pink for arms; pip install 'kineme[robot]'") from error
        self.robot = robot
        self._data = robot.model.createData()
        partial = _PARTIAL if is_partial(robot) else 1.0
        self.costs = partial * np.array(ORIENTATIONS[orientation])
        self._tip = FrameTask(robot.tip, position_cost=1.0, orientation_cost=self.costs.tolist(), gain=1.0)
        self._posture = PostureTask(cost=POSTURE_COST)
        self._posture.set_target(robot.rest)
        limited, inside = robot.model.copy(), _INSIDE * (robot.upper - robot.lower)
        limited.lowerPositionLimit, limited.upperPositionLimit = robot.lower + inside, robot.upper - inside
        self._limits = (ConfigurationLimit(limited, config_limit_gain=_GAIN),)
        self.reset(robot.rest)

    def reset(self, q: Array) -> None:
        """Start from joint positions q (n,).

        Raises `SpecificationError`: joints outside their limits.
        """
        from pink import Configuration

        robot = self.robot
        check_start(robot, q)
        self._configuration = Configuration(robot.model, self._data, np.clip(q, robot.lower, robot.upper))

    @property
    def q(self) -> Array:
        """Joint positions (n,)."""
        return np.array(self._configuration.q)

    @property
    def tip_position(self) -> Array:
        """Position of the tip (3,) [m]."""
        return np.array(self._configuration.get_transform_frame_to_world(self.robot.tip).translation)

    @property
    def tip_rotation(self) -> Array:
        """Rotation of the tip (3, 3)."""
        return np.array(self._configuration.get_transform_frame_to_world(self.robot.tip).rotation)

    @property
    def tip_pose(self) -> Array:
        """Position and orientation (w, x, y, z) of the tip (7,)."""
        import pinocchio

        pose = self._configuration.get_transform_frame_to_world(self.robot.tip)
        return np.array(pinocchio.SE3ToXYZQUAT(pose)[_WXYZ])

    @property
    def error(self) -> float:
        """Distance of the tip from where it was asked to be at the last step [m]."""
        wanted = self._tip.transform_target_to_world.translation
        return float(np.linalg.norm(self.tip_position - wanted))

    def step(self, position: Array, rotation: Array) -> Array:
        """Move towards a pose by one step, and return the joint positions (n,) after it."""
        self._advance(position, rotation)
        return self.q

    def solve(self, position: Array, rotation: Array, most: int = 30, tolerance: float = 1e-6) -> Array:
        """Move towards a pose until the tip is within `tolerance` [m] and the joints stand, `most` steps at most."""
        for _ in range(most):
            change = self._advance(position, rotation)
            if self.error < tolerance and change < 1e-4:
                break
        return self.q

    def follow(self, positions: Array, rotations: Array) -> Array:
        """Return joint positions (T, n) along poses that lie close to one another.

        One step for each pose, from where the joints would be if they went on as between the two poses before: the
        error of a step is quadratic in how far it goes, so this one is of the fourth order in the time between samples.
        Up to two more where that leaves the tip farther than 0.01 mm away.
        """
        path = np.empty((len(positions), self.robot.n_joints))
        for t, (position, rotation) in enumerate(zip(positions, rotations, strict=True)):
            if t > 1:
                ahead = np.clip(2 * path[t - 1] - path[t - 2], self.robot.lower, self.robot.upper)
                self._configuration.update(ahead)
            for _ in range(_MOST_STEPS):
                self._advance(position, rotation)
                if self.error < _CLOSE:
                    break
            path[t] = self._configuration.q
        return path

    def _advance(self, position: Array, rotation: Array) -> float:
        """Take one step towards a pose, where the z axis counts alone that of the shortest turn.

        Return the largest change of a joint.
        """
        import pinocchio
        from pink import build_ik
        from qpsolvers import solve_problem

        if self.costs[2] == 0 < self.costs[0]:
            here = self.tip_rotation
            turn = distances((np.zeros((1, 3)), here[None]), (np.zeros(3), rotation), self.costs)[0, 3:]
            rotation = here @ pinocchio.exp3(turn)
        self._tip.set_target(pinocchio.SE3(rotation, position))
        problem = build_ik(self._configuration, (self._tip, self._posture), 1.0, _STEP_DAMPING, self._limits)
        solution = solve_problem(problem, solver="daqp")
        if not solution.found or solution.x is None:  # as of a pose beyond all numbers
            return 0.0
        change = np.asarray(solution.x)
        self._configuration.integrate_inplace(change, 1.0)
        return float(np.abs(change).max())


def is_partial(robot: Robot) -> bool:
    """Tell whether the arm has fewer joints than a pose has coordinates: it follows orientations as far as it can."""
    return robot.n_joints < _COORDINATES
