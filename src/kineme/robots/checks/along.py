"""Kinematics, dynamics and contacts of an arm along a trajectory."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kineme.robots.checks.contacts import Contact, contacts_of
from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.models.robot import Robot
from kineme.validation import Array


class Along(NamedTuple):
    """What an arm does at the T samples of a trajectory."""

    tip_positions: Array  # (T, 3) [m]
    tip_rotations: Array  # (T, 3, 3)
    heights: Array  # (T, n + 1), of the joints and the tip above the base [m]
    smallest_singular_values: Array  # (T,), of the Jacobian of the tip, its translation counted in meters
    holding_torques: Array  # (T, n), at rest in that posture [Nm]
    moving_torques: Array  # (T, n), what the movement adds
    contacts: tuple[Contact, ...]  # the first of each pair of links that touch


def along(robot: Robot, trajectory: JointTrajectory) -> Along:
    """Follow the trajectory through the model."""
    import pinocchio

    model, data = robot.model, robot.model.createData()
    tip = model.getFrameId(robot.tip)
    n_samples, n = trajectory.positions.shape
    positions, rotations, heights = (np.empty((n_samples, *shape)) for shape in ((3,), (3, 3), (n + 1,)))
    jacobians, holding, whole = np.empty((n_samples, 6, n)), np.empty((n_samples, n)), np.empty((n_samples, n))
    samples = zip(trajectory.positions, trajectory.velocities, trajectory.accelerations, strict=True)
    for t, (q, v, a) in enumerate(samples):
        pinocchio.computeJointJacobians(model, data, q)
        pinocchio.updateFramePlacement(model, data, tip)
        jacobian = pinocchio.getFrameJacobian(model, data, tip, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        jacobians[t] = jacobian.reshape(6, n)  # of a single joint it has one axis
        positions[t], rotations[t] = data.oMf[tip].translation, data.oMf[tip].rotation
        heights[t] = [*(data.oMi[j].translation[2] for j in range(1, model.njoints)), positions[t, 2]]
        holding[t] = pinocchio.computeGeneralizedGravity(model, data, q)
        whole[t] = pinocchio.rnea(model, data, q, v, a)
    singular = np.asarray(np.linalg.svd(jacobians, compute_uv=False)[:, min(6, n) - 1], dtype=np.float64)
    contacts = contacts_of(robot, trajectory.positions)
    return Along(positions, rotations, heights, singular, holding, whole - holding, contacts)
