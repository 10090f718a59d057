"""The torques that a model says a motion takes."""

from __future__ import annotations

import numpy as np

from kineme.robots.models.robot import Robot
from kineme.validation import Array


def knows_masses(robot: Robot) -> bool:
    """Whether the model says what its links weigh."""
    return float(sum(inertia.mass for inertia in robot.model.inertias)) > 0


class Torques:
    """Torques of one arm, posture by posture: inverse dynamics by the recursive Newton-Euler algorithm of Pinocchio.

    Without friction, and without a load that the model does not have.
    """

    def __init__(self, robot: Robot) -> None:
        import pinocchio

        self._inverse_dynamics = pinocchio.rnea
        self._model, self._data = robot.model, robot.model.createData()
        self._known = knows_masses(robot)
        self._most = np.where(np.isnan(robot.effort), np.inf, robot.effort)

    def of(self, q: Array, velocities: Array, accelerations: Array) -> Array:
        """Torques (n,) [Nm, N] at joint positions, velocities and accelerations (n,); nan without masses."""
        if not self._known:
            return np.full(len(q), np.nan)
        return np.array(self._inverse_dynamics(self._model, self._data, q, velocities, accelerations))

    def exceeded(self, torques: Array) -> bool:
        """Whether a joint would need more than it has; False where that is not known."""
        return bool((np.abs(torques) > self._most).any())
