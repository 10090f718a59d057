"""`RhythmicDMP`, the specification that learns, and `RhythmicPrimitives`, what it learns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Never

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.dmp.batch import Batch
from kineme.dmp.control.plan import MISSED, ObstacleAvoidance, Options, Plan, ViaPlaces, check_one, one_vector
from kineme.dmp.discrete.via_points import ViaLike, via_points
from kineme.dmp.recorded_as import RecordedAs
from kineme.dmp.rhythmic.encode import encode
from kineme.dmp.rhythmic.operators import RhythmicSpecification, forcing_matrix
from kineme.dmp.rhythmic.rollout import PHASES, RhythmicRollout, modulated, rollout
from kineme.errors import SpecificationError
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.validation import Array, check_count, check_samples

if TYPE_CHECKING:
    from kineme.dmp.rhythmic.controller import RhythmicController

_INSTEAD = {
    "goal": "a rhythm goes around its baseline: give baseline=",
    "duration": "a rhythm has no end: give period=, of one cycle, and n_periods=",
    "end_velocity": "a rhythm has no end: on its cycle give via= points, off it the initial velocity=",
    "goal_velocity": "a rollout goes around a baseline at rest: give goal_velocity= to controller.step",
    "position_limits": "a rhythm is not kept within limits: a smaller amplitude=, another baseline= or via= points are",
    "settle": "a rhythm never settles: give n_periods=",
}

_LONGEST_STEP = 1000.0  # periods in one step: the forcing is followed all the way


@dataclass(frozen=True)
class RhythmicDMP(RhythmicSpecification):
    """A rhythmic Dynamical Movement Primitive, as a frozen specification: a limit cycle that attracts.

    With the phase ``phi = 2 pi t / period`` shared by all dimensions, and in time ``u = t / period`` (' = d/du),

        x'' = K (b - x) - D x' + r f(phi),    f(phi) = sum_i psi_i(phi) w_i / sum_i psi_i(phi),

    ``psi_i = exp(h (cos(phi - c_i) - 1))``, baseline b and amplitude r.

    Parameters
    ----------
    n_basis : int, default 25
        Number N of basis functions; they hold about N / 2 harmonics.
    stiffness : float, default 100.0
        Spring constant K, in units of ``1 / period^2``.
    damping : float, optional
        Damping D; by default critical, ``2 sqrt(K)``.
    fit : {"trajectory", "forcing"}, default "trajectory"
        Fit the path itself on the system's periodic response, or solve the equation for f and fit that. On noisy
        recordings the first finds f with a third of the error.
    ridge : float, optional
        Strength of the penalty, by default 1e-8 on the weights (forcing) and 1e-6 on their curvature (trajectory).
    n_points : int, default 200
        Number T of phases at which the fit compares paths.
    overlap : float, default 0.5
        Value of a basis function at its neighbor's center; sets the width h.
    period : float, optional
        Period of all movements [s]; by default it is estimated from each recording, which must then hold 1.5 periods.
    align_on : int, optional
        Dimension whose first harmonic is largest at phase 0. By default that with the largest first harmonic, chosen
        for each movement; to compare movements in which two dimensions are alike, name one.
    aperiodic : {"raise", "accept"}, default "raise"
        For a recording without a clear period: an error, or the best estimate, at worst the whole recording.
    preprocessing : tuple of steps, default ()
        Steps applied before learning; they are part of the specification.

    Raises
    ------
    SpecificationError
        A parameter out of its range; the message says what was expected.

    Notes
    -----
    A. J. Ijspeert, J. Nakanishi, H. Hoffmann, P. Pastor, S. Schaal, "Dynamical Movement Primitives: Learning Attractor
    Models for Motor Behaviors", Neural Computation 25(2), 2013, Eqs. (2.1), (2.5) and (2.6), Table 1, write ``tau =
    period / (2 pi)`` and measure stiffness per ``tau^2``: their ``alpha_z = 25, beta_z = 25/4`` is
    ``K = 4 pi^2 alpha_z beta_z = 6168.5`` here. The weights are found jointly here, and r is estimated.

    Examples
    --------
    >>> import numpy as np, kineme
    >>> t = np.linspace(0.0, 2.5, 200)
    >>> wave = kineme.Trajectory(t, np.sin(2 * np.pi * t / 0.8))
    >>> learned = kineme.RhythmicDMP().learn(wave)
    >>> float(learned.periods[0].round(6))
    0.8
    """

    def learn(self, movements: MovementsLike) -> RhythmicPrimitives:
        """Learn the weights, baseline, amplitude, period and starting phase of one limit cycle per movement.

        Parameters
        ----------
        movements : Demonstrations, Trajectory, sequence of Trajectory or of (T_i, d) arrays, or (n, T, d) array
            Any lengths, any sampling, any number of periods from 1.5 on, or from 1 on if the period is given.

        Raises
        ------
        TrajectoryError
            Movements that cannot be used: see `Demonstrations`; no period found; less than one period; fewer than four
            samples per period; a movement that does not move.
        """
        return RhythmicPrimitives(self, **encode(self, movements))


@dataclass(frozen=True, eq=False, repr=False)
class RhythmicPrimitives(Batch):
    """n limit cycles of d dimensions that share one specification; made by `RhythmicDMP.learn`.

    - `dmp`: the specification.
    - `scaled_weights` (n, d, N): weights times amplitude, ``r w``.
    - `baselines` (n, d): b, the mean over whole periods, in the user's unit.
    - `amplitudes` (n,): r, half of the largest minus the smallest position of the widest dimension, in the user's unit.
      One for all dimensions: their proportions belong to the shape, and a dimension that does not move needs no
      division.
    - `periods` (n,): seconds.
    - `phases` (n,): phase at which the recording started, in [0, 2 pi). At phase 0 the first harmonic of the aligned
      dimension is largest, so that recordings of one movement get the same weights wherever they start.
    - `aligned_on` (n,): the aligned dimension.
    - `explained` (n,): share of the recording's variance that the folded cycle explains.
    - `labels` (n,).
    """

    ROWS = {  # noqa: RUF012 - declared as a class variable by Batch
        "scaled_weights": "ndN",
        "baselines": "nd",
        "amplitudes": "n",
        "periods": "n",
        "phases": "n",
        "aligned_on": "n",
        "explained": "n",
    }
    SPECIFICATION = RhythmicDMP
    KIND = "rhythmic primitives"

    dmp: RhythmicDMP
    scaled_weights: Array
    baselines: Array
    amplitudes: Array
    periods: Array
    phases: Array
    aligned_on: NDArray[np.intp]
    explained: Array
    labels: NDArray[Any] | None = None
    names: tuple[str | None, ...] | None = None
    recorded_as: RecordedAs | None = None

    @property
    def weights(self) -> Array:
        """Weights w, shape (n, N, d); they do not depend on baseline, amplitude and tempo."""
        return (self.scaled_weights / self.amplitudes[:, None, None]).transpose(0, 2, 1)

    def forcing(self, n_samples: int = 100) -> Array:
        """The forcing term f at `n_samples` (S) even phases from 0, shape (n, S, d); without r, as the weights."""
        return self.shape_attractor(n_samples) / self.amplitudes[:, None, None]

    def shape_attractor(self, n_samples: int = 100) -> Array:
        """The term as it acts in the equation, ``r f(phi)``, at `n_samples` (S) even phases, shape (n, S, d)."""
        n_samples = check_samples(check_count("n_samples", n_samples, 2), self.dmp.n_basis, "n_samples")
        return (self.scaled_weights @ forcing_matrix(self.dmp, n_samples).T).transpose(0, 2, 1)

    def rollout(  # noqa: PLR0913 - one parameter per option
        self,
        n_periods: float = 1.0,
        *,
        period: ArrayLike | None = None,
        amplitude: ArrayLike | None = None,
        baseline: ArrayLike | None = None,
        start: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        phase: ArrayLike = 0.0,
        via: ViaLike | None = None,
        rate: float | None = None,
        n_samples: int | None = None,
        **others: Never,
    ) -> RhythmicRollout:
        """Generate movements on the limit cycle or towards it, for any number of periods; all in one product.

        Parameters
        ----------
        n_periods : float, default 1.0
            Number of periods, not necessarily whole.
        period, amplitude : float or array_like of shape (n,), optional
            Seconds, and the user's unit; by default the demonstrated ones.
        baseline : array_like of shape (d,) or (n, d), optional
            By default the demonstrated one.
        start, velocity : array_like of shape (d,) or (n, d), optional
            State at the beginning, by default that of the limit cycle: no transient.
        phase : float or array_like of shape (n,), default 0.0
            Phase at the beginning [rad]; ``phase=primitives.phases`` starts where the recordings did.
        via : sequence of (phase, point) or ((begin, end), points), optional
            Where the limit cycle passes, at phases from 0 to below 2 pi [rad]: points (d,) for all movements or (n, d),
            stretches of points (m, d) or (n, m, d) at even phases. NaN leaves a dimension free. Points are met exactly,
            a stretch as well as the basis functions can; baseline and period stay.
        rate : float, optional
            Samples per second, at least.
        n_samples : int, optional
            Samples per movement, the last at `n_periods`; by default `n_points` per period. Give this or `rate`.

        Raises
        ------
        TrajectoryError
            An option of the wrong shape; numbers of movements that do not match.
        SpecificationError
            A period or n_periods of 0 or less, a rate too low to show a period; a phase outside the cycle, two places
            at one phase, more points than there are basis functions to meet them, an amplitude of 0 with via points;
            what a rhythm does not have, as an end velocity or position limits.

        Warns
        -----
        ExtrapolationWarning
            A via point farther from the cycle than it is large; a stretch that is not met.
        """
        refuse_others("rollout", others)
        options = {"period": period, "amplitude": amplitude, "phase": phase}
        options |= {"baseline": baseline, "start": start, "velocity": velocity}
        return modulated(rollout(self, options, n_periods, rate, n_samples), via)

    def controller(  # noqa: PLR0913 - an option per parameter
        self,
        dt: float,
        *,
        phase: ArrayLike = 0.0,
        period: ArrayLike | None = None,
        amplitude: ArrayLike | None = None,
        baseline: ArrayLike | None = None,
        goal: ArrayLike | None = None,
        start: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        via: ViaLike | None = None,
        feedback: str = "state",
        phase_stopping: float | None = None,
        goal_filter: float | None = None,
        velocity_limit: ArrayLike | None = None,
        acceleration_limit: ArrayLike | None = None,
        avoidance: ObstacleAvoidance | None = None,
        **others: Never,
    ) -> RhythmicController:
        """One limit cycle under live control, in steps of `dt` [s]; amplitude and period may change in a step.

        Parameters
        ----------
        dt : float
            Time of a step [s], at most 1000 periods.
        phase, period, amplitude, baseline, start, velocity, via : optional
            As in `rollout`, for one movement. A new amplitude scales the cycle through the via points as a whole.
        goal : array_like of shape (d,), optional
            Another name of the baseline, as in the other controllers; pass one of the two.
        feedback, phase_stopping, goal_filter, velocity_limit, acceleration_limit, avoidance : optional
            What to do with measurements, new baselines and amplitudes, limits and obstacles; see
            `kineme.control.Options`.

        Raises
        ------
        SpecificationError
            More than one primitive; both `baseline` and `goal`; an option out of its range, or one that rhythms lack.
        """
        from kineme.dmp.rhythmic.controller import RhythmicController  # loads where a robot moves, not to learn

        refuse_others("controller", others)
        if goal is not None and baseline is not None:
            raise SpecificationError("expected goal or baseline, which are the same, got both; pass one of them")
        options = Options(feedback, phase_stopping, goal_filter, velocity_limit, acceleration_limit, avoidance)
        check_one(len(self))
        d, dmp, weights = self.n_dims, self.dmp, self.scaled_weights[0]
        vectors = {"baseline": goal if baseline is None else baseline, "start": start, "velocity": velocity}
        settings: dict[str, ArrayLike | None] = {"period": period, "amplitude": amplitude, "phase": phase}
        settings |= {name: one_vector(name, vector, d) for name, vector in vectors.items()}
        targets = None if via is None else via_points(via, d, span=PHASES)
        movement = modulated(rollout(self, settings, 1.0, None, n_samples=2), targets)
        check_one(len(movement))
        origin, tau, gain = movement.baselines[0].copy(), float(movement.periods[0]), float(movement.ratio[0])
        size = 2.0 * abs(gain) * float(self.amplitudes[0])
        if movement.change is not None:
            weights = weights + movement.change[0] / gain  # a new amplitude scales the whole cycle
        mixing = np.zeros((dmp.n_basis + 1, d + 1))
        mixing[:-1, :-1] = weights.T
        plan = Plan(  # a discrete movement whose shape repeats around its baseline
            dmp,
            mixing,
            ratio=np.ones_like,
            origin=origin,
            goal=np.zeros(d),
            state=np.vstack((movement.positions[0, 0] - origin, movement.velocities[0, 0] * tau)),
            duration=tau,
            settle=0.0,
            n_positions=d,
            begin=float(movement.phases[0] / (2 * np.pi) % 1.0),
            periodic=True,
            longest_step=_LONGEST_STEP,
            via=None if targets is None else ViaPlaces(targets.times, targets.points[0] - origin, MISSED * size),
        )
        return RhythmicController(plan, dt, options, float(self.amplitudes[0]), gain, self.moving_channels)


def refuse_others(what: str, options: Mapping[str, object]) -> None:
    """Refuse options that a rhythm does not have, and other names as any function does."""
    for name, value in options.items():
        if name not in _INSTEAD:
            raise TypeError(f"{what}() got an unexpected keyword argument {name!r}")
        if value is not None:
            raise SpecificationError(f"expected no {name}= for a rhythm; {_INSTEAD[name]}")
