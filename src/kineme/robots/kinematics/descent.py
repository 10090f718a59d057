"""Many postures at once, each a step nearer to its pose: fast enough to compare branches and places.

`InverseKinematics` then solves the one that is chosen, with the limits as constraints.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from kineme.robots.models.robot import Robot
from kineme.validation import Array

#: Cost of leaving the rest posture [1/rad], besides 1 per meter: decides where the pose leaves the joints free.
POSTURE_COST = 1e-4
_DAMPING = 1e-3  # of a step, per squared distance from the pose: far away the step is one of gradient descent
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
    `InverseKinematics` do; a joint at a stop stays there while it is pushed outwards.

    Parameters
    ----------
    robot : Robot
    joints : ndarray of shape (m, n)
        Where to start.
    positions, rotations : ndarray of shape (m, 3) and (m, 3, 3), or one for all
        The poses.
    turn_costs : ndarray of shape (3,)
        c, of turning about x, y, z of the tip [1/rad], besides 1 per meter.
    n_steps : int
    """
    q = np.array(joints, dtype=float)
    weights = np.concatenate((np.ones(3), turn_costs))
    for _ in range(n_steps):
        at, turned, jacobians = kinematics(robot, q)
        back = turned.transpose(0, 2, 1)
        away = np.einsum("mij,mj->mi", back, positions - at)
        turn = Rotation.from_matrix(back @ rotations).as_rotvec()
        error = np.concatenate((away, turn), axis=1) * weights
        slope = np.einsum("mij,mi->mj", jacobians * weights[:, None], error) + POSTURE_COST**2 * (robot.rest - q)
        stopped = ((q <= robot.lower) & (slope < 0)) | ((q >= robot.upper) & (slope > 0))
        free = np.where(stopped[:, None], 0.0, jacobians * weights[:, None])
        damping = POSTURE_COST**2 + _DAMPING * np.einsum("mi,mi->m", error, error)
        curvature = free.transpose(0, 2, 1) @ free + damping[:, None, None] * np.eye(robot.n_joints)
        change = np.linalg.solve(curvature, np.where(stopped, 0.0, slope)[:, :, None])[:, :, 0]
        change *= np.minimum(1.0, _LARGEST / np.maximum(np.abs(change).max(axis=1, keepdims=True), 1e-12))
        q = np.clip(q + change, robot.lower, robot.upper)
    return Reached(q, np.linalg.norm(kinematics(robot, q)[0] - positions, axis=1))


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
        jacobians[i] = pinocchio.getFrameJacobian(model, data, tip, local)
        positions[i], rotations[i] = pose.translation, pose.rotation
    return positions, rotations, jacobians
