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

    geometry = _pair_geometry(robot)
    if len(geometry.collisionPairs) == 0:
        return ()
    data, shapes = robot.model.createData(), geometry.createData()
    for request in shapes.collisionRequests:
        request.security_margin = _MARGIN
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
def _pair_geometry(robot: Robot) -> Any:
    """The arm's shapes with the pairs that can touch.

    None of neighboring links, and none that touch in nearly all postures: those overlap by design, as two links on one
    axis do.
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
    if len(geometry.collisionPairs) == 0:
        return geometry
    data, shapes = robot.model.createData(), geometry.createData()
    counts = np.zeros(len(geometry.collisionPairs))
    postures = np.random.default_rng(0).uniform(robot.lower, robot.upper, (_RANDOM_POSTURES, robot.n_joints))
    for q in postures:
        pinocchio.computeCollisions(robot.model, data, geometry, shapes, q, False)
        counts += [result.isCollision() for result in shapes.collisionResults]
    for k in np.flatnonzero(counts > _ALWAYS * len(postures))[::-1]:
        geometry.removeCollisionPair(geometry.collisionPairs[int(k)])
    return geometry
