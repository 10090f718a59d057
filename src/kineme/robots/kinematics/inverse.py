"""Inverse kinematics in steps: each moves the joints towards a pose of the tip, within their limits."""

from __future__ import annotations

import numpy as np

from kineme.errors import DataError
from kineme.robots.kinematics.descent import POSTURE_COST, distances
from kineme.robots.models.robot import Robot, check_robot, check_start
from kineme.validation import Array, check_choice

#: How much of the orientation is followed -> cost of turning about x, y, z of the tip [1/rad], besides 1 per meter.
ORIENTATIONS = {"full": (1.0, 1.0, 1.0), "axis": (1.0, 1.0, 0.0), "free": (0.0, 0.0, 0.0)}

_COORDINATES = 6  # of a pose
_PARTIAL = 0.005  # times these costs, for arms with fewer joints than that: the position comes first
_GAIN = 0.95  # of the way to a limit that one step may go
_DAMPING = 1e-12
_INSIDE = 0.002  # of the range of a joint, so far from its ends it is kept: between samples a path goes a little beyond
_CLOSE, _MOST_STEPS = 1e-5, 3  # of a pose [m], and steps towards it along a path
_WXYZ = [0, 1, 2, 6, 3, 4, 5]  # pinocchio has w last


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

        Raises
        ------
        SpecificationError
            Joints outside their limits.
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
        self._aim(position, rotation)
        self._advance()
        return self.q

    def solve(self, position: Array, rotation: Array, most: int = 30, tolerance: float = 1e-6) -> Array:
        """Move towards a pose until the tip is within `tolerance` [m] and the joints stand, `most` steps at most."""
        for _ in range(most):
            self._aim(position, rotation)
            change = self._advance()
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
                self._aim(position, rotation)
                self._advance()
                if self.error < _CLOSE:
                    break
            path[t] = self._configuration.q
        return path

    def _aim(self, position: Array, rotation: Array) -> None:
        """Set the pose that the tip is to have; with its z axis alone, that of the shortest turn."""
        import pinocchio

        if self.costs[2] == 0 < self.costs[0]:
            here = self.tip_rotation
            turn = distances((np.zeros((1, 3)), here[None]), (np.zeros(3), rotation), self.costs)[0, 3:]
            rotation = here @ pinocchio.exp3(turn)
        self._tip.set_target(pinocchio.SE3(rotation, position))

    def _advance(self) -> float:
        """Take one step towards the target of the tip, and return the largest change of a joint."""
        from pink import build_ik
        from qpsolvers import solve_problem

        problem = build_ik(self._configuration, (self._tip, self._posture), 1.0, _DAMPING, self._limits)
        solution = solve_problem(problem, solver="daqp")
        if not solution.found or solution.x is None:  # as of a pose beyond all numbers
            return 0.0
        change = np.asarray(solution.x)
        self._configuration.integrate_inplace(change, 1.0)
        return float(np.abs(change).max())


def is_partial(robot: Robot) -> bool:
    """Tell whether the arm has fewer joints than a pose has coordinates: it follows orientations as far as it can."""
    return robot.n_joints < _COORDINATES
