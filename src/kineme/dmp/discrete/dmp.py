"""`DMP`, the specification that learns, and `Primitives`, what it learns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.dmp.batch import Batch
from kineme.dmp.discrete.operators import forcing_matrix
from kineme.dmp.discrete.specification import Specification, safe_amplitudes
from kineme.dmp.recorded_as import RecordedAs
from kineme.errors import SpecificationError
from kineme.validation import Array, check_count, check_number, check_samples

if TYPE_CHECKING:
    from kineme.dmp.control.controller import Controller
    from kineme.dmp.control.plan import ObstacleAvoidance, State
    from kineme.dmp.discrete.encode import BasisSelection
    from kineme.dmp.discrete.rollout import Rollout
    from kineme.dmp.discrete.via_points import ViaLike
    from kineme.movements.trajectories.trajectory import MovementsLike


@dataclass(frozen=True)
class DMP(Specification):
    """A Dynamical Movement Primitive, as a frozen specification.

    In normalized time ``u = t / tau``, with one canonical system s(u) shared by all dimensions,

        original      x'' = K (g - x) + (g - x0) f(s) - D x'                            Eq. (1)
        bio-inspired  x'' = s K (f(s)/s + x0 - x) + (1 - s) K (g - x) - D x'            Eq. (4)

    and ``f(s) = sum_i psi_i(s) w_i / sum_i psi_i(s)``, Eq. (2).

    Parameters
    ----------
    formulation : {"original", "bio-inspired", "amplitude-scaled", "decoupled"}, default "bio-inspired"
        The transformation system; see `kineme.dmp.discrete.specification.FORMULATIONS`.
    n_basis : int, default 40
        Number N of basis functions, at most 2,000.
    stiffness : float, default 100.0
        Spring constant K, in units of ``1 / tau^2``.
    damping : float, optional
        Damping D; by default critical, ``2 sqrt(K)``.
    gating : {"none", "phase"}, default "none"
        Whether f is Eq. (2) as printed, or that times s, as many implementations have it.
    fit : {"trajectory", "forcing"}, default "trajectory"
        Fit the path itself by regularized least squares on the system's response: no numerical derivatives, robust to
        noise. Or solve the equation for f and fit that, as the paper does, with 80 basis functions.
    regression : {"local", "ridge"}, default "local"
        How ``fit="forcing"``, and only that, finds the weights: locally weighted, or jointly by ridge regression.
    ridge : float, optional
        Strength of the penalty of ``regression="ridge"`` (default 1e-8) and ``fit="trajectory"`` (1e-6).
    phase_end : float, default 0.01
        The phase at the end, s(tau); ``alpha = -ln(phase_end)``.
    overlap : float, default 0.3
        Value of a basis function at its neighbor's center; sets the widths h_i.
    n_points : int, default 200
        Points T that each movement is resampled to before the fit, at most 10,000.
    preprocessing : tuple of steps, default ()
        Steps applied before learning, as `TrimRest` and `Smooth`; they are part of the specification.

    Raises
    ------
    SpecificationError
        A parameter out of its range; the message says what was expected.

    Examples
    --------
    >>> import kineme
    >>> demos = kineme.load_lasa(["CShape"])
    >>> kineme.DMP("bio-inspired", n_basis=20).learn(demos).weights.shape
    (7, 20, 2)
    """

    def learn(self, movements: MovementsLike) -> Primitives:
        """Learn one primitive per movement, all in one product: weights, start, goal, velocity there and duration.

        Parameters
        ----------
        movements : Demonstrations, Trajectory, sequence of Trajectory or of (T_i, d) arrays, or (n, T, d) array
            Any lengths, any sampling.

        Raises
        ------
        TrajectoryError
            Movements that cannot be used: see `Demonstrations`; also a movement that does not move.
        """
        from kineme.dmp.discrete.encode import encode  # movements load when there are some

        return Primitives(self, **encode(self, movements))

    def choose(
        self,
        movements: MovementsLike,
        *,
        n_basis: Sequence[int] | None = None,
        ridge: Sequence[float] | None = None,
        tolerance: float = 0.005,
        negligible: float = 1e-4,
    ) -> BasisSelection[Self]:
        """Choose the number of basis functions and the ridge by generalized cross-validation.

        ``mean (y - H y)^2 / (1 - trace(H) / T)^2`` estimates the mean squared error of predicting a sample of a path
        from all its others (Golub, Heath and Wahba 1979, Eq. 1.4). Chosen for all movements together are the
        fewest basis functions that are good enough, with their best ridge; all else stays as in this specification.

        Parameters
        ----------
        movements : as `learn` takes them
            Noise is assumed to be independent from sample to sample; smoothed recordings are followed too closely. More
            than 2,000 movements are represented by 2,000 of them.
        n_basis : sequence of int, optional
            Numbers to try; by default from 6 to 100, at most as many as samples.
        ridge : sequence of float, optional
            Ridges to try; by default powers of ten from 1e-12 to 100.
        tolerance : float, default 0.005
            Good enough is an error within this share of the smallest one; the noise of the samples is part of both,
        negligible : float, default 1e-4
            or below this share of the movements' extents.

        Raises
        ------
        SpecificationError
            ``fit="forcing"``; numbers or ridges out of range.
        TrajectoryError
            Movements that cannot be used: see `learn`.

        Examples
        --------
        >>> import kineme
        >>> demos = kineme.load_lasa(["CShape"])
        >>> selection = kineme.DMP().choose(demos)
        >>> primitives = selection.dmp.learn(demos)
        """
        from kineme.dmp.discrete.encode import choose  # only who chooses needs it

        return choose(self, movements, n_basis, ridge, tolerance, negligible)


@dataclass(frozen=True, eq=False, repr=False)
class Primitives(Batch):
    """n primitives of d dimensions that share one specification; made by `DMP.learn`.

    - `dmp`: the specification.
    - `scaled_weights` (n, d, N): weights times the formulation's scale: ``(g - x0) w`` (original) or ``K w``
      (bio-inspired). They exist for every movement, closed ones too.
    - `starts`, `goals` (n, d): x0 and g, in the user's unit.
    - `velocities` (n, d): initial velocities, in the user's unit per second.
    - `durations` (n,): tau [s].
    - `extents` (n, d): largest minus smallest position of each demonstration; g counts as close to x0 relative to it.
    - `labels` (n,).
    """

    ROWS = {  # noqa: RUF012 - declared as a class variable by Batch
        "scaled_weights": "ndN",
        "starts": "nd",
        "goals": "nd",
        "velocities": "nd",
        "durations": "n",
        "extents": "nd",
    }
    SPECIFICATION = DMP
    KIND = "primitives"

    dmp: DMP
    scaled_weights: Array
    starts: Array
    goals: Array
    velocities: Array
    durations: Array
    extents: Array
    labels: NDArray[Any] | None = None
    names: tuple[str | None, ...] | None = None
    recorded_as: RecordedAs | None = None

    @property
    def weights(self) -> Array:
        """Weights w of Eq. (2), shape (n, N, d).

        Raises `DegenerateMovementError`: in the original formulation, where ``g = x0`` in a dimension.
        """
        return (self.scaled_weights / self._scale("weights")).transpose(0, 2, 1)

    def forcing(self, n_samples: int = 100) -> Array:
        """The forcing term f, Eq. (2), at `n_samples` (S) even times, shape (n, S, d).

        Contains s if the specification's gating is "phase"; never contains K or g - x0.

        Raises `DegenerateMovementError`: in the original formulation, where ``g = x0`` in a dimension.
        """
        return (self._scaled_forcing(n_samples) / self._scale("forcing")).transpose(0, 2, 1)

    def shape_attractor(self, n_samples: int = 100) -> Array:
        """The shape-attractor term as it acts in the equation, at `n_samples` (S) even times, shape (n, S, d).

        ``(g - x0) f(s)`` in Eq. (1), ``s K (f(s)/s + x0 - x) = K f(s) + K s (x0 - x)`` in Eq. (4), with x the
        primitive's own path. It needs no division, neither by g - x0 nor by s, so it exists for every
        movement. Section 2.2 gives the name to the bracket without the leading s; that one grows as s vanishes.
        """
        term = self._scaled_forcing(n_samples)
        s = self.dmp.basis.phase(np.linspace(0.0, 1.0, term.shape[2]))
        coupling = self.dmp.system.coupling(self.dmp.K, s)
        if coupling.any():
            term += coupling * (
                self.rollout(n_samples=n_samples).positions.transpose(0, 2, 1) - self.starts[:, :, None]
            )
        return term.transpose(0, 2, 1)

    def rollout(  # noqa: PLR0913 - one parameter per option
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
    ) -> Rollout:
        """Generate movements, as demonstrated or with another start, goal and duration; all in one matrix product.

        One primitive can have many goals, many primitives one goal, or as many primitives as many goals.

        Parameters
        ----------
        start, goal : array_like of shape (d,) or (n, d), optional
            x0 and g; by default the demonstrated ones.
        duration : float or array_like of shape (n,), optional
            tau [s]; by default the demonstrated one. The path does not depend on it.
        velocity : array_like of shape (d,) or (n, d), optional
            Initial velocity, per second; by default the demonstrated one, in proportion to the tempo.
        via : sequence of (time, point) or ((begin, end), points), optional
            Where to pass, and when as a share of the duration, above 0 and below 1. A point (d,) is for all movements,
            (n, d) for each its own; a stretch of points (m, d) or (n, m, d) is at even times from `begin` to `end`. NaN
            leaves a dimension free. Points and goal are then met exactly, a stretch as well as the basis can.
        end_velocity : array_like of shape (d,) or (n, d), optional
            Velocity at the goal, at the end of the duration, per second; the goal is then met exactly.
        goal_velocity : array_like of shape (d,) or (n, d), optional
            Velocity of the goal, per second: it is at `goal` at the start, ``goal + duration * goal_velocity`` at the
            end, and followed without a lag, as by ``controller.step(goal=, goal_velocity=)``.
        position_limits : (low, high), optional
            Where to stay, each a number or (d,), infinite where there is no limit; at the specification's `n_points`
            samples. A small quadratic program for each dimension of each movement that would leave them.
        rate : float, optional
            Samples per second, at least; all movements of a batch get the same number of samples, at most 50 million
            over the number of basis functions.
        n_samples : int, optional
            Samples per movement; by default the specification's `n_points`. Give this or `rate`.
        settle : float, optional
            Continue past the duration until every dimension stays within this distance of the goal.

        Returns
        -------
        Rollout
            With ``times``, ``positions``, ``velocities``, ``accelerations`` and ``trajectories``; `from_rollout` makes
            primitives of it, to keep.

        Raises
        ------
        TrajectoryError
            A start, goal, velocity or via point of the wrong shape; numbers of movements that do not match.
        SpecificationError
            A duration of 0 or less, a rate too low to follow the dynamics, a via point outside the duration, two places
            at one time, more via points than there are basis functions to meet them, position limits that the movement
            cannot keep.
        DegenerateMovementError
            The original formulation asked to move a closed or flat demonstration to another goal.

        Warns
        -----
        ExtrapolationWarning
            A via point farther from the path than the movement is large; a stretch that is not met.

        Notes
        -----
        Via points and end velocity change the weights by one linear solve, ``W += S A' (A S A')^-1 e``, so that the
        change of the path has the least mean square acceleration; after Y. Zhou, J. Gao, T. Asfour, "Learning
        Via-Movement Primitives with Inter- and Extrapolation Capabilities", IROS 2019.
        """
        from kineme.dmp.discrete.modulate import modulated
        from kineme.dmp.discrete.rollout import rollout, sampled

        movement = modulated(
            rollout(self, start, goal, duration, velocity, goal_velocity), via, end_velocity, position_limits
        )
        return sampled(movement, rate, n_samples, settle)

    @classmethod
    def from_rollout(cls, movement: Rollout) -> Primitives:
        """The movements of a rollout as primitives of their own, with its starts, goals, durations and via points.

        They move so without being told; they are saved, recognized, controlled and moved to other goals like any other.

        Raises `SpecificationError`: a rollout with a goal that moves, which a primitive has not.
        """
        if movement.goal_velocities is not None and movement.goal_velocities.any():
            raise SpecificationError(
                "expected movements to goals at rest, got goal_velocity= other than 0: primitives know no goals that "
                "move; give it to their rollout, or to controller.step, or use end_velocity= to go on at the goal"
            )
        of = movement.primitives
        of = of if len(of) == len(movement) else of[np.zeros(len(movement), dtype=np.intp)]
        return cls(
            of.dmp,
            scaled_weights=movement.weights,
            starts=movement.starts.copy(),
            goals=movement.goals.copy(),
            velocities=movement.velocities_at_start.copy(),
            durations=movement.durations.copy(),
            extents=of.row("extents"),
            labels=of.labels,
            names=of.names,
            recorded_as=of.recorded_as,
        )

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
    ) -> Controller[State]:
        """One primitive under live control, in steps of `dt` [s].

        Parameters
        ----------
        dt : float
            Time of a step [s], at most the duration.
        start, goal, duration, velocity, via, end_velocity, position_limits : optional
            As in `rollout`, for one movement. Past the duration the goal attracts again, at rest.
        feedback, phase_stopping, goal_filter, velocity_limit, acceleration_limit, avoidance, settle : optional
            What to do with measurements, new goals, limits and obstacles; see `kineme.control.Options`.

        Raises
        ------
        SpecificationError
            More than one primitive; an option out of its range.
        DegenerateMovementError
            The original formulation asked to move a closed or flat demonstration to another goal.

        Examples
        --------
        >>> import kineme
        >>> primitives = kineme.DMP().learn(kineme.load_lasa(["CShape"]))
        >>> controller = primitives[0].controller(dt=0.002)
        >>> controller.step(goal=[10.0, 5.0]).time
        0.002
        """
        from kineme.dmp.control.controller import Controller  # these load where a robot moves, not to learn
        from kineme.dmp.control.plan import Options, check_one, one_vector
        from kineme.dmp.discrete.modulate import modulated, plan_along
        from kineme.dmp.discrete.rollout import rollout
        from kineme.dmp.discrete.via_points import via_points

        options = Options(feedback, phase_stopping, goal_filter, velocity_limit, acceleration_limit, avoidance, settle)
        check_one(len(self))
        check_number("duration", duration, above=0.0, optional=True)
        vectors = {"start": start, "goal": goal, "velocity": velocity, "end_velocity": end_velocity}
        x0, g, v0, end = (one_vector(name, vector, self.n_dims) for name, vector in vectors.items())
        targets = None if via is None else via_points(via, self.n_dims)
        movement = modulated(rollout(self, x0, g, duration, v0), targets, end, position_limits)
        return Controller(plan_along(movement, self.n_dims, targets), dt, options, self.moving_channels)

    def _scale(self, feature: str) -> Array:
        """The formulation's scale (n, d, 1), refused where it is zero."""
        amplitude = self.goals - self.starts
        if self.dmp.system.divides_by_amplitude:
            amplitude = safe_amplitudes(amplitude, self.extents, self.names, feature)
        return self.dmp.system.scale(self.dmp.K, amplitude)[:, :, None]

    def _scaled_forcing(self, n_samples: int) -> Array:
        n_samples = check_samples(check_count("n_samples", n_samples, 2), self.dmp.n_basis, "n_samples")
        return self.scaled_weights @ forcing_matrix(self.dmp, n_samples).T
