"""The specification of a DMP for orientations and poses."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.dmp.batch import Arrays, Batch, check_array
from kineme.dmp.control.plan import ObstacleAvoidance, Options
from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.dmp.discrete.modulate import modulated, plan_along
from kineme.dmp.discrete.rollout import Rollout, rollout, sampled
from kineme.dmp.discrete.specification import FORMULATIONS
from kineme.dmp.discrete.via_points import ViaLike, broadcast_length
from kineme.dmp.pose.pose_controller import PoseController
from kineme.dmp.pose.pose_rollout import PoseRollout, changes_in_tangent, checked_poses, rates_in_tangent
from kineme.dmp.pose.tangent import to_tangent
from kineme.dmp.recorded_as import RecordedAs, make_read_only, recorded_as
from kineme.errors import SpecificationError
from kineme.movements.channels.channel import Channels
from kineme.movements.rotations import conjugate, exp, log, nearest, normalized, product
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import Names
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.validation import Array, check_number


@dataclass(frozen=True)
class PoseDMP:
    """A DMP for orientations (w, x, y, z), or for positions and orientations under one canonical system.

    It learns poses, and recordings with any mixture of positions, joint angles and orientations, such as two hands. It
    is an ordinary DMP of the rotation vector from the goal, ``p = 2 log(q conj(q_goal))``, whose goal is 0; with
    the bio-inspired formulation, in normalized time,

        p'' = K (0 - p) - D p' + K f(s) + K s p_0,    q = exp(p) q_goal,    omega = J(p) p' / tau.

    The rates of p become angular velocities through the Jacobian J of the logarithm: the corrected formulation of
    Koutras and Doulgeri, "A correct formulation for the orientation dynamic movement primitives for robot control in
    the Cartesian space", PMLR 100, 2020. Ude et al. (ICRA 2014) take p' for omega, and the fast spring then oscillates.

    Parameters
    ----------
    dmp : DMP, default DMP()
        The specification for all 3 or 6 dimensions. Its preprocessing applies to positions and rotation vectors; a
        step that measures distances over all dimensions counts a radian as a unit of length.

    Notes
    -----
    What a new goal preserves: start and goal multiplied from the right by one quaternion (a tool mounted
    differently) give the demonstrated angular velocities exactly. A new goal alone keeps f, along the axes of the
    world, and bends the path by the turn that is added or missing, as a new goal does to a position. Start and goal
    multiplied from the left (the whole scene turned) do not turn f with them.

    The original formulation scales each axis of p by itself: a demonstration that does not turn about the world's x
    cannot be moved to a goal that needs it.

    Turns of more than pi are followed, up to a full turn from the goal, beyond it about a fixed axis. A generated path
    may leave that range; it stays smooth.

    Examples
    --------
    >>> import numpy as np
    >>> from kineme.orientation import PoseDMP, exp, slerp
    >>> u = np.linspace(0, 1, 101)
    >>> demo = slerp([1, 0, 0, 0], exp([0, 0, 1.5]), u**3 * (10 - 15 * u + 6 * u**2))
    >>> primitives = PoseDMP().learn([demo])
    >>> movement = primitives.rollout(goal=exp([0.5, 0, 2.0]), duration=2.0, rate=100)
    >>> movement.orientations.shape, movement.angular_velocities.shape
    ((1, 201, 4), (1, 201, 3))
    """

    dmp: DMP = field(default_factory=DMP)

    def __post_init__(self) -> None:
        if not isinstance(self.dmp, DMP):
            raise SpecificationError(f"expected dmp to be a kineme.DMP, got {self.dmp!r}; write PoseDMP(kineme.DMP())")

    def learn(self, movements: MovementsLike) -> PosePrimitives:
        """Learn one primitive per movement of 4 (orientation) or 7 columns (position, orientation), all at once.

        Movements with `channels` may have any number of positions, angles and orientations, at least one of these.

        Parameters
        ----------
        movements : Demonstrations, Trajectory, sequence of Trajectory or of (T_i, d) arrays, or (n, T, d) array
            Any lengths, any sampling; quaternions (w, x, y, z) of either sign.

        Raises
        ------
        TrajectoryError
            Movements that cannot be used; see `to_tangent` and `DMP.learn`.
        SpecificationError
            Poses with the amplitude-scaled formulation: it has one scale for all dimensions, and no distance from
            start to goal is common to meters and radians.
        """
        recorded = Demonstrations.of(movements)
        tangent, references = to_tangent(recorded, self.dmp.preprocessing)
        if self.dmp.formulation == "amplitude-scaled" and tangent.n_dims > 3:
            others = ", ".join(f'"{name}"' for name in FORMULATIONS if name != self.dmp.formulation)
            raise SpecificationError(
                f'expected one of the formulations {others} for poses, got "amplitude-scaled", which scales '
                "by one distance over meters and radians; learn positions and orientations apart to use it"
            )
        about = recorded_as(recorded, self.dmp.preprocessing)
        return PosePrimitives(
            replace(self.dmp, preprocessing=()).learn(tangent),
            references,
            about if about is not None and about.orientations else None,
        )


@dataclass(frozen=True, eq=False, repr=False)
class PosePrimitives(Batch):
    """n primitives of orientations or poses; made by `PoseDMP.learn`.

    - `tangent`: of 3 dimensions, the rotation vector from the goal [rad] in the world frame, or 6, the position before
      it. Its weights, forcing terms and shape-attractors describe the movements. Of recordings with p positions and
      angles and k orientations it has p + 3 k.
    - `references` (n, 4): the demonstrated goal orientations, where the rotation vectors are 0.
    - `recorded_as`: channels of the recordings, where they are known; see `channels`.
    """

    ROWS = Primitives.ROWS | {"references": "nq"}
    SPECIFICATION = DMP
    KIND = "pose primitives"

    tangent: Primitives
    references: Array
    recorded_as: RecordedAs | None = None

    def __post_init__(self) -> None:
        make_read_only(self, ["references"])

    def __repr__(self) -> str:
        columns = {4: "orientations", 7: "poses"}.get(self.n_columns, f"{self.n_columns} columns")
        return f"PosePrimitives({len(self)} movements of {columns}, {self.tangent.dmp})"

    def row(self, name: str) -> NDArray[Any]:
        """Return the array of that name in `ROWS`."""
        return np.asarray(getattr(self if name == "references" else self.tangent, name))

    @classmethod
    def _of_rows(
        cls, dmp: Any, arrays: dict[str, Any], labels: NDArray[Any] | None, names: Names, about: RecordedAs | None
    ) -> PosePrimitives:
        rows = {name: arrays[name] for name in Primitives.ROWS}
        return cls(Primitives(dmp, **rows, labels=labels, names=names), arrays["references"], about)

    @classmethod
    def _from_file(cls, header: dict[str, Any], arrays: Arrays) -> PosePrimitives:
        loaded = super()._from_file(header, arrays)
        k = 1 if loaded.recorded_as is None else len(loaded.recorded_as.orientations)
        check_array("references", loaded.references, (len(loaded), 4 * k))
        if loaded.recorded_as is None and loaded.n_dims not in {3, 6}:
            raise ValueError(f"scaled_weights should have 3 or 6 dimensions, have {loaded.n_dims}")
        normalized(loaded._goals)  # refuses what is no rotation; the numbers stay as they were saved
        return loaded

    @property
    def moving_channels(self) -> Channels | None:
        """Those `channels` that are learned, in the order of the columns: the orientations last."""
        return None if self.recorded_as is None else (*self.recorded_as.plain, *self.recorded_as.orientations)

    @property
    def to_recording(self) -> RecordedAs | None:
        """`recorded_as`, if the movements can be written in the columns of the recording; else None."""
        return self.recorded_as if self.recorded_as is not None and self.recorded_as.has_steps else None

    @property
    def dmp(self) -> DMP:
        """The specification of the DMP in the tangent space."""
        return self.tangent.dmp

    @property
    def labels(self) -> NDArray[Any] | None:  # type: ignore[override]
        """Labels of the demonstrations, shape (n,), or None."""
        return self.tangent.labels

    @property
    def names(self) -> tuple[str | None, ...] | None:  # type: ignore[override]
        """Source of each demonstration, or None."""
        return self.tangent.names

    @property
    def durations(self) -> Array:
        """Duration tau of each demonstration, shape (n,) [s]."""
        return self.tangent.durations

    @property
    def plain_names(self) -> tuple[list[str], list[str]]:
        """Names of the columns and of their rates without a recording: x, y, z, then qw, ... and q.rx, ..."""
        places = [*"xyz"[: self.n_positions]]
        return [*places, "qw", "qx", "qy", "qz"], [*places, "q.rx", "q.ry", "q.rz"]

    @property
    def n_orientations(self) -> int:
        """Number of orientations k."""
        return self.references.shape[1] // 4

    @property
    def n_positions(self) -> int:
        """Number of columns before the orientations: those of a position, or all positions and angles."""
        return self.tangent.n_dims - 3 * self.n_orientations

    @property
    def n_columns(self) -> int:
        """4 for orientations, 7 for poses."""
        return self.n_positions + 4 * self.n_orientations

    @property
    def starts(self) -> Array:
        """Demonstrated starts, shape (n, 4) or (n, 7), with positions first."""
        return self._poses(self.tangent.starts)

    @property
    def goals(self) -> Array:
        """Demonstrated goals, shape (n, 4) or (n, 7), with positions first."""
        return self._poses(self.tangent.goals)

    def rollout(  # noqa: PLR0913 - an option per parameter
        self,
        start: ArrayLike | None = None,
        goal: ArrayLike | None = None,
        duration: ArrayLike | None = None,
        *,
        velocity: ArrayLike | None = None,
        via: ViaLike | None = None,
        end_velocity: ArrayLike | None = None,
        goal_velocity: ArrayLike | None = None,
        position_limits: tuple[ArrayLike, ArrayLike] | None = None,
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
            Of other recordings the positions and angles, and after them the orientations, each as (w, x, y, z).
        duration, rate, n_samples : as in `Primitives.rollout`
        velocity : array_like of shape (d - 1,) or (n, d - 1), optional
            Initial angular velocity in the world frame [rad/s], for poses after the linear velocity. By default
            the demonstrated rates of the position and the rotation vector, in proportion to the tempo.
        via : sequence of (time, point) or ((begin, end), points), optional
            Where to pass, and when; see `Primitives.rollout`. Points are orientations (d = 4) or poses (d = 7): NaN
            leaves a position free, NaN in all four numbers an orientation. Each is met the way round that is nearest.
        end_velocity : array_like of shape (d - 1,) or (n, d - 1), optional
            As `velocity`, at the goal, at the end of the duration; the goal is then met exactly.
        goal_velocity : array_like of shape (d - 1,) or (n, d - 1), optional
            Velocity of the goal, as `velocity`: it is at `goal` at the start, and goes and turns on at that rate.
        position_limits : (low, high), optional
            Where the positions stay, each a number or one for each position; see `Primitives.rollout`.
        settle : float, optional
            Go on past the duration until every position and rotation vector [rad] stays this near the goal.

        Raises
        ------
        TrajectoryError
            A start, goal, velocity or via point of the wrong shape, a quaternion not of norm 1, unequal numbers.
        SpecificationError
            As of `Primitives.rollout`, with its warnings, in positions or in radians; limits of orientations alone.
        DegenerateMovementError
            The original formulation asked to turn about an axis that the demonstration does not turn about.

        Notes
        -----
        All happens in positions and rotation vectors from the goal, where via points and velocities are linear. At the
        goal the rotation vector is 0, and its rate the angular velocity.
        """
        movement, references = self._asked_for(start, goal, duration, velocity, goal_velocity)
        movement = modulated(movement, *changes_in_tangent(movement, references, via, end_velocity, position_limits))
        movement = sampled(movement, rate, n_samples, settle)
        references = np.broadcast_to(references, (len(movement), references.shape[1]))
        return PoseRollout(self, movement, references)

    @classmethod
    def from_rollout(cls, movement: PoseRollout) -> PosePrimitives:
        """The movements of a rollout as primitives of their own; see `Primitives.from_rollout`.

        Raises `SpecificationError`: a rollout with a goal that moves, which a primitive has not.
        """
        about, n = movement.recorded_as, len(movement)
        if about is not None and len(movement.tangent.primitives) < n:
            about = about.take(np.zeros(n, dtype=np.intp))
        return cls(Primitives.from_rollout(movement.tangent), movement.references.copy(), about)

    def controller(  # noqa: PLR0913 - an option per parameter
        self,
        dt: float,
        *,
        start: ArrayLike | None = None,
        goal: ArrayLike | None = None,
        duration: float | None = None,
        velocity: ArrayLike | None = None,
        via: ViaLike | None = None,
        end_velocity: ArrayLike | None = None,
        position_limits: tuple[ArrayLike, ArrayLike] | None = None,
        feedback: str = "state",
        phase_stopping: float | None = None,
        goal_filter: float | None = None,
        velocity_limit: ArrayLike | None = None,
        acceleration_limit: ArrayLike | None = None,
        avoidance: ObstacleAvoidance | None = None,
        settle: float | None = None,
    ) -> PoseController:
        """One primitive under live control, in steps of `dt` [s]; options as of `Primitives.controller`.

        Start, goal, velocity, via points, end velocity and limits are as in `rollout`, for one movement. Limits of
        `Options` hold for linear and angular velocities and accelerations, as the state reports them; obstacles are
        points (m, 3) that the position steers around; `settle` holds for positions and rotation vectors [rad].

        Raises `SpecificationError` or `TrajectoryError`: more than one primitive; an option out of its range; a start
        or goal that is no pose.
        """
        check_number("duration", duration, above=0.0, optional=True)
        movement, references = self._asked_for(start, goal, duration, velocity)
        changes = changes_in_tangent(movement, references, via, end_velocity, position_limits)
        plan = plan_along(modulated(movement, *changes), self.n_positions, changes[0])
        options = Options(feedback, phase_stopping, goal_filter, velocity_limit, acceleration_limit, avoidance, settle)
        return PoseController(plan, dt, options, references[0], self.moving_channels)

    def _asked_for(
        self,
        start: ArrayLike | None,
        goal: ArrayLike | None,
        duration: ArrayLike | None,
        velocity: ArrayLike | None,
        goal_velocity: ArrayLike | None = None,
    ) -> tuple[Rollout, Array]:
        """The movements in positions and rotation vectors, and the orientations (1 or n, 4 k) that these refer to."""
        starts, goals, references = self._endpoints(start, goal)
        velocities = rates_in_tangent(velocity, starts, self.n_positions, "velocity")
        return rollout(self.tangent, starts, goals, duration, velocities, goal_velocity), references

    def _endpoints(self, start: ArrayLike | None, goal: ArrayLike | None) -> tuple[Array, Array, Array]:
        """Start and goal in positions and rotation vectors, and the orientations that the latter refer to."""
        starts, goals = (
            checked_poses(*option, self.n_positions, self.n_columns) for option in ((start, "start"), (goal, "goal"))
        )
        starts, goals = self.starts if starts is None else starts, self.goals if goals is None else goals
        n = broadcast_length(len(self), {"start": starts, "goal": goals})
        m, k = self.n_positions, self.n_orientations
        learned = self.tangent.starts[:, m:].reshape(len(self), k, 3)
        vectors = learned
        if start is not None or goal is not None:
            q, q_goal = (columns[:, m:].reshape(-1, k, 4) for columns in (starts, goals))
            vectors = nearest(log(product(q, conjugate(q_goal))), learned)

        def joined(positions: Array, vectors: Array) -> Array:
            return np.concatenate((np.broadcast_to(positions, (n, m)), np.broadcast_to(vectors, (n, 3 * k))), axis=1)

        flat = vectors.reshape(len(vectors), 3 * k)
        return joined(starts[:, :m], flat), joined(goals[:, :m], np.zeros((1, 3 * k))), goals[:, m:]

    def _poses(self, tangent: Array) -> Array:
        m = self.n_positions
        q = product(exp(tangent[:, m:].reshape(len(self), -1, 3)), self._goals)
        return np.concatenate((tangent[:, :m], q.reshape(len(self), -1)), axis=1)

    @property
    def _goals(self) -> Array:
        """The references (n, k, 4)."""
        return self.references.reshape(len(self), -1, 4)
