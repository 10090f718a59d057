"""A batch of learned orientations or poses, and how it moves again."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import TrajectoryError
from kineme.movements.rotations.quaternions import conjugate, normalized, product
from kineme.movements.rotations.rotation_vectors import exp, log, nearest
from kineme.primitives.batch import Batch
from kineme.primitives.control.obstacles import ObstacleAvoidance
from kineme.primitives.control.options import Options, check_one
from kineme.primitives.discrete.dmp import DMP, Primitives
from kineme.primitives.discrete.plan import plan_of
from kineme.primitives.discrete.rollout import broadcast_length, per_movement
from kineme.primitives.persistence import Arrays
from kineme.primitives.pose.pose_controller import PoseController
from kineme.primitives.pose.pose_rollout import PoseRollout
from kineme.primitives.pose.rates import rotation_vector_rate
from kineme.validation import Array


@dataclass(frozen=True, eq=False, repr=False)
class PosePrimitives(Batch):
    """n primitives of orientations or poses; made by `PoseDMP.learn`.

    Attributes
    ----------
    tangent : Primitives
        Of 3 dimensions, the rotation vector from the goal [rad] in the world frame, or 6, the position before it. Its
        weights, forcing terms and shape-attractors describe the movements.
    references : ndarray of shape (n, 4)
        The demonstrated goal orientations, where the rotation vector is 0.
    """

    ROWS = Primitives.ROWS | {"references": "n4"}
    SPECIFICATION = DMP
    KIND = "pose primitives"

    tangent: Primitives
    references: Array

    def __post_init__(self) -> None:
        view = self.references.view()
        view.setflags(write=False)
        object.__setattr__(self, "references", view)

    def __repr__(self) -> str:
        columns = "orientations" if self.n_columns == 4 else "poses"
        return f"PosePrimitives({len(self)} movements of {columns}, {self.tangent.dmp})"

    def _row(self, name: str) -> NDArray[Any]:
        return np.asarray(getattr(self if name == "references" else self.tangent, name))

    @classmethod
    def _of_rows(
        cls, dmp: Any, arrays: dict[str, Any], labels: NDArray[Any] | None, names: tuple[str | None, ...] | None
    ) -> PosePrimitives:
        rows = {name: arrays[name] for name in Primitives.ROWS}
        return cls(Primitives(dmp, **rows, labels=labels, names=names), arrays["references"])

    @classmethod
    def _from_file(cls, header: dict[str, Any], arrays: Arrays) -> PosePrimitives:
        loaded = super()._from_file(header, arrays)
        if loaded.n_dims not in {3, 6}:
            raise ValueError(f"scaled_weights should have 3 or 6 dimensions, have {loaded.n_dims}")
        normalized(loaded.references)  # refuses what is no rotation; the numbers stay as they were saved
        return loaded

    @property
    def dmp(self) -> DMP:
        """The specification of the DMP in the tangent space."""
        return self.tangent.dmp

    @property
    def labels(self) -> NDArray[Any] | None:
        """Labels of the demonstrations, shape (n,), or None."""
        return self.tangent.labels

    @property
    def names(self) -> tuple[str | None, ...] | None:
        """Where each demonstration came from, or None."""
        return self.tangent.names

    @property
    def durations(self) -> Array:
        """Duration tau of each demonstration, shape (n,) [s]."""
        return self.tangent.durations

    @property
    def n_columns(self) -> int:
        """4 for orientations, 7 for poses."""
        return self.tangent.n_dims + 1

    @property
    def starts(self) -> Array:
        """Demonstrated starts, shape (n, 4) or (n, 7)."""
        return self._poses(self.tangent.starts)

    @property
    def goals(self) -> Array:
        """Demonstrated goals, shape (n, 4) or (n, 7)."""
        return self._poses(self.tangent.goals)

    def rollout(  # noqa: PLR0913 - an option per parameter
        self,
        start: ArrayLike | None = None,
        goal: ArrayLike | None = None,
        duration: ArrayLike | None = None,
        *,
        velocity: ArrayLike | None = None,
        rate: float | None = None,
        n_samples: int | None = None,
        settle: float | None = None,
    ) -> PoseRollout:
        """Move again, as demonstrated or with another start, goal and duration; all movements in one product.

        Parameters
        ----------
        start, goal : array_like of shape (d,) or (n, d), optional
            Orientations (d = 4) or poses (d = 7), as demonstrated; quaternions of either sign. The way from a new
            start to a new goal is the one nearest to the demonstrated way, the long way round if that was shown.
        duration, rate, n_samples : optional
            See `Primitives.rollout`.
        velocity : array_like of shape (d - 1,) or (n, d - 1), optional
            Initial angular velocity in the world frame [rad/s], for poses after the linear velocity. By default
            the demonstrated rates of the position and the rotation vector, in proportion to the tempo.
        settle : float, optional
            Go on past the duration until every position and every component of the rotation vector [rad] stays within
            this distance of the goal.

        Raises
        ------
        TrajectoryError
            A start, goal or velocity of the wrong shape, a quaternion not of norm 1, numbers that do not go together.
        DegenerateMovementError
            The original formulation asked to turn about an axis that the demonstration does not turn about.
        """
        tangent_start, tangent_goal, references, tangent_velocity = self.in_tangent(start, goal, velocity)
        movement = self.tangent.rollout(
            tangent_start,
            tangent_goal,
            duration,
            velocity=tangent_velocity,
            rate=rate,
            n_samples=n_samples,
            settle=settle,
        )
        return PoseRollout(movement, np.broadcast_to(references, (len(movement), 4)))

    def controller(  # noqa: PLR0913 - an option per parameter
        self,
        dt: float,
        *,
        start: ArrayLike | None = None,
        goal: ArrayLike | None = None,
        duration: float | None = None,
        velocity: ArrayLike | None = None,
        feedback: str = "state",
        phase_stopping: float | None = None,
        goal_filter: float | None = None,
        velocity_limit: ArrayLike | None = None,
        acceleration_limit: ArrayLike | None = None,
        avoidance: ObstacleAvoidance | None = None,
        settle: float | None = None,
    ) -> PoseController:
        """One primitive under live control, in steps of `dt` [s].

        Parameters
        ----------
        dt : float
            Time of a step [s], at most the duration.
        start, goal, duration, velocity : optional
            As in `rollout`, for one movement.
        feedback, phase_stopping, goal_filter, velocity_limit, acceleration_limit, avoidance, settle : optional
            What to do with measurements, new goals, limits and obstacles; see `kineme.control.Options`. Limits hold for
            linear and angular velocities and accelerations, as the state reports them; obstacles are points (m, 3) that
            the position steers around; `settle` holds for positions and the components of the rotation vector [rad].

        Returns
        -------
        PoseController
            At the start, with ``step``, ``reset`` and ``state``.

        Raises
        ------
        SpecificationError, TrajectoryError
            More than one primitive; an option out of its range; a start or goal that is no pose.
        """
        starts, goals, references, velocities = self.in_tangent(start, goal, velocity)
        check_one(len(starts))
        v = None if velocities is None else velocities[0]
        plan = replace(plan_of(self.tangent, starts[0], goals[0], duration, v), n_positions=self.n_columns - 4)
        options = Options(feedback, phase_stopping, goal_filter, velocity_limit, acceleration_limit, avoidance, settle)
        return PoseController(plan, dt, options, references[0])

    def in_tangent(
        self, start: ArrayLike | None, goal: ArrayLike | None, velocity: ArrayLike | None
    ) -> tuple[Array, Array, Array, Array | None]:
        """Start, goal, reference orientations and initial velocity of the movements that these options make."""
        starts, goals, references = self._endpoints(start, goal)
        return starts, goals, references, self._tangent_velocity(velocity, starts)

    def _endpoints(self, start: ArrayLike | None, goal: ArrayLike | None) -> tuple[Array, Array, Array]:
        """Start and goal in positions and rotation vectors, and the orientations that the latter refer to."""
        starts, goals = self._as_poses(start, "start"), self._as_poses(goal, "goal")
        starts, goals = self.starts if starts is None else starts, self.goals if goals is None else goals
        n = broadcast_length(len(self), {"start": starts, "goal": goals})
        learned = self.tangent.starts[:, -3:]
        p = learned
        if start is not None or goal is not None:
            p = nearest(log(product(starts[:, -4:], conjugate(goals[:, -4:]))), learned)

        def joined(positions: Array, vectors: Array) -> Array:
            return np.concatenate((np.broadcast_to(positions, (n, positions.shape[1])), vectors), axis=1)

        vectors = np.broadcast_to(p, (n, 3))
        return joined(starts[:, :-4], vectors), joined(goals[:, :-4], np.zeros((n, 3))), goals[:, -4:]

    def _tangent_velocity(self, velocity: ArrayLike | None, starts: Array) -> Array | None:
        option = per_movement(velocity, "velocity", self.tangent.n_dims)
        if option is None:
            return None
        n = broadcast_length(len(starts), {"velocity": option})
        rates = rotation_vector_rate(starts[:, -3:], option[:, -3:])
        return np.concatenate((np.broadcast_to(option[:, :-3], (n, option.shape[1] - 3)), rates), axis=1)

    def _as_poses(self, option: ArrayLike | None, name: str) -> Array | None:
        poses = per_movement(option, name, self.n_columns)
        if poses is None:
            return None
        try:
            return np.concatenate((poses[:, :-4], normalized(poses[:, -4:])), axis=1)
        except TrajectoryError as error:
            raise TrajectoryError(f"{name}: {error}") from error

    def _poses(self, tangent: Array) -> Array:
        q = product(exp(tangent[:, -3:]), self.references)
        return np.concatenate((tangent[:, :-3], q), axis=1)
