"""Kinematics, dynamics and contacts of an arm along a trajectory."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from kineme.robots.execution.joint_trajectory import JointTrajectory
from kineme.robots.models.robot import Robot
from kineme.validation import Array

_MARGIN = 0.005  # links closer than this count as touching [m]
_RANDOM_POSTURES = 100
_ALWAYS = 0.9  # of random postures in which a pair of shapes touches: it touches by design


class Along(NamedTuple):
    """Kinematics, torques and contacts of an arm at the T samples of a trajectory."""

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
    jacobians, holding, total = np.empty((n_samples, 6, n)), np.empty((n_samples, n)), np.empty((n_samples, n))
    samples = zip(trajectory.positions, trajectory.velocities, trajectory.accelerations, strict=True)
    for t, (q, v, a) in enumerate(samples):
        pinocchio.computeJointJacobians(model, data, q)
        pinocchio.updateFramePlacement(model, data, tip)
        jacobian = pinocchio.getFrameJacobian(model, data, tip, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        jacobians[t] = jacobian.reshape(6, n)  # of a single joint it has one axis
        positions[t], rotations[t] = data.oMf[tip].translation, data.oMf[tip].rotation
        heights[t] = [*(data.oMi[j].translation[2] for j in range(1, model.njoints)), positions[t, 2]]
        holding[t] = pinocchio.computeGeneralizedGravity(model, data, q)
        total[t] = pinocchio.rnea(model, data, q, v, a)
    singular = np.asarray(np.linalg.svd(jacobians, compute_uv=False)[:, min(6, n) - 1], dtype=np.float64)
    contacts = contacts_of(robot, trajectory.positions)
    return Along(positions, rotations, heights, singular, holding, total - holding, contacts)


class Contact(NamedTuple):
    """Two links that touch."""

    sample: int
    first: str
    second: str


def contacts_of(robot: Robot, positions: Array) -> tuple[Contact, ...]:
    """The first contact of each pair of shapes that touch, over joint positions (T, n)."""
    import pinocchio

    geometry, margins = _pair_geometry(robot)
    if len(geometry.collisionPairs) == 0:
        return ()
    data, shapes = robot.model.createData(), geometry.createData()
    for request, margin in zip(shapes.collisionRequests, margins, strict=True):
        request.security_margin = margin
    first_samples: dict[int, int] = {}
    for t, q in enumerate(positions):
        if pinocchio.computeCollisions(robot.model, data, geometry, shapes, q, False):
            for k, result in enumerate(shapes.collisionResults):
                if result.isCollision():
                    first_samples.setdefault(k, t)
    pairs = geometry.collisionPairs

    def link(shape: int) -> str:
        return str(robot.model.frames[geometry.geometryObjects[shape].parentFrame].name)

    return tuple(Contact(t, link(pairs[k].first), link(pairs[k].second)) for k, t in first_samples.items())


@lru_cache(maxsize=8)
def _pair_geometry(robot: Robot) -> tuple[Any, tuple[float, ...]]:
    """The arm's shapes with the pairs that can touch, and the margin of each pair [m].

    None of neighboring links, and none that touch in nearly all postures: those overlap by design, as two links on one
    axis do. Links that are within the margin of one another where the arm rests, without touching, have none.
    """
    import pinocchio

    geometry = robot.geometry.copy()
    geometry.removeAllCollisionPairs()
    objects = geometry.geometryObjects
    parents = list(robot.model.parents)
    for i, first in enumerate(objects):
        for j in range(i + 1, len(objects)):
            a, b = first.parentJoint, objects[j].parentJoint
            if a != b and parents[a] != b and parents[b] != a:
                geometry.addCollisionPair(pinocchio.CollisionPair(i, j))
    postures = np.random.default_rng(0).uniform(robot.lower, robot.upper, (_RANDOM_POSTURES, robot.n_joints))
    shares = _touching(robot, geometry, postures, _MARGIN).mean(axis=0)
    for k in np.flatnonzero(shares > _ALWAYS)[::-1]:
        geometry.removeCollisionPair(geometry.collisionPairs[int(k)])
    near, touching = (_touching(robot, geometry, robot.rest[None], margin)[0] for margin in (_MARGIN, 0.0))
    return geometry, tuple(np.where(near & ~touching, 0.0, _MARGIN).tolist())


def _touching(robot: Robot, geometry: Any, postures: Array, margin: float) -> Array:
    """Tell of each pair of shapes whether it is closer than the margin [m], in each posture: (T, pairs)."""
    import pinocchio

    data, shapes = robot.model.createData(), geometry.createData()
    for request in shapes.collisionRequests:
        request.security_margin = margin
    touching = np.zeros((len(postures), len(geometry.collisionPairs)), dtype=bool)
    for t, q in enumerate(postures):
        pinocchio.computeCollisions(robot.model, data, geometry, shapes, q, False)
        touching[t] = [result.isCollision() for result in shapes.collisionResults]
    return touching
