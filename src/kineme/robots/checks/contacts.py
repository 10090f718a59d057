"""Which links of an arm touch one another along a trajectory."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from kineme.robots.models.robot import Robot
from kineme.validation import Array

_MARGIN = 0.005  # links closer than this count as touching [m]
_RANDOM_POSTURES = 100
_ALWAYS = 0.9  # of random postures in which a pair of shapes touches: it touches by design


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
    found: dict[int, int] = {}
    for t, q in enumerate(positions):
        if pinocchio.computeCollisions(robot.model, data, geometry, shapes, q, False):
            for k, result in enumerate(shapes.collisionResults):
                if result.isCollision():
                    found.setdefault(k, t)
    pairs = geometry.collisionPairs

    def link(shape: int) -> str:
        return str(robot.model.frames[geometry.geometryObjects[shape].parentFrame].name)

    return tuple(Contact(t, link(pairs[k].first), link(pairs[k].second)) for k, t in found.items())


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
    """Whether each pair of shapes is closer than the margin [m], in each posture: (T, pairs)."""
    import pinocchio

    data, shapes = robot.model.createData(), geometry.createData()
    for request in shapes.collisionRequests:
        request.security_margin = margin
    touching = np.zeros((len(postures), len(geometry.collisionPairs)), dtype=bool)
    for t, q in enumerate(postures):
        pinocchio.computeCollisions(robot.model, data, geometry, shapes, q, False)
        touching[t] = [result.isCollision() for result in shapes.collisionResults]
    return touching
