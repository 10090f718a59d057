"""Many postures at once, each a step nearer to its pose: fast enough to compare branches and places.

`InverseKinematics` then solves the one that is chosen, with the limits as constraints.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import qmc

from kineme.robots.models.robot import Robot
from kineme.validation import Array

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
    """Steps of damped least squares (Levenberg and Marquardt) towards poses of the tip.

    A step minimizes ``|p - p*|^2 + |c log(R' R*)|^2 + (0.0001 |q - rest|)^2`` to first order, as those of
    `InverseKinematics` do; joints that come to a stop stay there, and the others do their part.

    `joints` (m, n): where to start; `positions`, `rotations` (m, 3) and (m, 3, 3): the poses; `turn_costs` (3,): c, of
    turning about x, y, z of the tip [1/rad], besides 1 per meter.
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

    Joints that would pass a limit stop there, and the others are solved again.

    `slopes` (m, 6, n): A; `error` (m, 6); `costs`: drift (m, n), pull and damping (m,); `range_left`, two of (m, n):
    the least and the largest change x.
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
    """Joint positions that bring the tip to one pose, from the rest posture and from others spread over the limits.

    Two that differ by less than 0.3 rad in every joint count as one. The most exact comes first; if none comes within
    0.1 mm, it is alone.
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
    """The same every time, so that the same question has the same answer.

    A Halton sequence within the limits, at most half a turn to each side.
    """
    lower, upper = np.clip((-np.pi, np.pi), robot.lower[:, None], robot.upper[:, None]).T
    spread = qmc.Halton(robot.n_joints, scramble=False).random(n)[1:]
    return np.vstack((robot.rest, lower + spread * (upper - lower)))
