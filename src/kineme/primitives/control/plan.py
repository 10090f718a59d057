"""Everything about a controlled movement that no step changes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from kineme.primitives.control.obstacles import ObstacleAvoidance
from kineme.primitives.discrete.primitives import Primitives
from kineme.validation import Array


class Influences(NamedTuple):
    """What acts on the movement during one step, held constant over it; in normalized time, relative to x0."""

    goal: Array  # (d,)
    ratio: Array  # (d,), what scale f is multiplied by
    push: Array  # (d,), an external acceleration
    obstacles: Array  # (m, d), at the start of the step
    obstacle_velocities: Array  # (m, d); with these the obstacles go on during the step


@dataclass(frozen=True, eq=False)
class Plan:
    """The equation of one primitive, ``x'' = K (g - x) - D x' + ratio scale f + coupling (g - x0)``, and obstacles."""

    primitive: Primitives  # a batch of one
    avoidance: ObstacleAvoidance

    @property
    def K(self) -> float:
        """Stiffness."""
        return self.primitive.dmp.K

    @property
    def D(self) -> float:
        """Damping."""
        return self.primitive.dmp.D

    @cached_property
    def intervals(self) -> float:
        """Quadrature intervals per unit of u: two between neighboring centers, and as many as the spring is fast."""
        return max(2.0 * (self.primitive.dmp.n_basis - 1), math.sqrt(self.K), 0.5 * self.D)

    def shape(self, u: Array) -> Array:
        """At normalized times u (T,): scale f of each dimension, then the coupling; shape (T, d + 1)."""
        dmp = self.primitive.dmp
        forcing = dmp.basis.design(u) @ self.primitive.scaled_weights[0].T
        return np.column_stack((forcing, dmp.system.coupling(dmp.K, dmp.basis.phase(u))))

    def ratio(self, goal: Array) -> Array:
        """What scale f is multiplied by for a goal relative to x0 (d,); not finite where the formulation cannot go."""
        primitive = self.primitive
        learned = primitive.goals - primitive.starts
        return np.array(primitive.dmp.system.ratio(goal[None], learned, primitive.extents)[0])
