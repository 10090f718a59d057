"""One primitive from several demonstrations, with their spread; and two such averages blended into one.

With the activations a and b at a time, and means and covariances of the position there, the blend is the product of
Gaussians (A. Paraschos, C. Daniel, J. Peters and G. Neumann, "Probabilistic Movement Primitives", NIPS 2013),

    Sigma = (a Sigma_1^-1 + b Sigma_2^-1)^-1,    mean = Sigma (a Sigma_1^-1 mean_1 + b Sigma_2^-1 mean_2).

How positions vary together over time is our choice: ``sqrt(a) Sigma Sigma_1^-1`` times the deviations of the one and
``sqrt(b) Sigma Sigma_2^-1`` times those of the other, which has this Sigma at each time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.discrete.modulate import modulated
from kineme.dmp.discrete.operators import encoder
from kineme.dmp.discrete.rollout import Rollout, rollout, sampled
from kineme.dmp.discrete.specification import Specification
from kineme.dmp.discrete.via_points import ViaLike
from kineme.dmp.recorded_as import merged
from kineme.dmp.styles import parameters
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.channels.coordinates import turns_beyond
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.validation import Array, as_numbers, check_choice, check_count, check_number

_FLOOR = 1e-3  # of the typical deviation, added to all: where nobody varies the activations alone decide

_CERTAIN = 1e-6  # of the extent: smaller deviations count as equal when averages are blended
_DERIVATIVES = {"position": 0, "velocity": 1, "acceleration": 2}


@dataclass(frozen=True, eq=False)
class AveragePrimitive:
    """The mean of several primitives and, as a low-rank factor, their covariance; made by `average`.

    With ``theta = [W, x0, g, tau v0]``, the ``d (N + 3)`` numbers that a path depends on linearly, the covariance is
    ``factor.T @ factor``. It is never formed: n demonstrations span n - 1 of its d (N + 3) directions.

    - `primitive`: the mean, a batch of one: roll it out, describe it, control with it as with any other. It knows
      nothing of the covariance, see `rollout`.
    - `factor` (r, d, N + 3): centered, weighted deviations of theta from the mean; r is at most n and at most d (N +
      3).
    - `tempo_factor` (r,): the same for ln tau.
    - `noise`: standard deviation of a path, at each time, around what the factor explains: how far each demonstration
      is from the nearest weighted mean of the others. None where there are too few demonstrations to say, or too many.
    """

    primitive: Primitives
    factor: Array
    tempo_factor: Array
    noise: float | None = None

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
        """Generate movements as `Primitives.rollout` does, through via points in the way of the demonstrations.

        Where one demonstration only lets the path bend smoothly, the covariance of several says how they differ, and
        the path goes through the via points as one of them would; r demonstrations count as r, smoothness as ten.

        Parameters and errors are those of `Primitives.rollout`. `Primitives.from_rollout` keeps the movement, and
        ``Primitives.from_rollout(average.rollout(via=...)).controller(dt)`` moves so step by step.
        """
        movement = rollout(self.primitive, start, goal, duration, velocity, goal_velocity)
        movement = modulated(movement, via, end_velocity, position_limits, self.factor[:, :, :-3])
        return sampled(movement, rate, n_samples, settle)

    def deviation(self, n_samples: int = 100, of: str = "position") -> Array:
        """Standard deviation at `n_samples` (S) even phases from start to goal, shape (S, d): the half-width of a band.

        Movements are compared at equal phase t / tau, so `of` a velocity (per second) or an acceleration it is the
        deviation at the mean duration; differences in tempo are in `tempo_factor`.
        """
        check_count("n_samples", n_samples, 2)
        check_choice("of", of, list(_DERIVATIVES))
        order = _DERIVATIVES[of]
        deviations = parameters.map_rows(
            self.factor, parameters.path_matrix(self.primitive.dmp, n_samples, order)
        )  # (r, d, S)
        variance = np.einsum("rds,rds->sd", deviations, deviations)
        return np.sqrt(variance) / self.primitive.durations[0] ** order

    def sample(self, n: int, seed: int | np.random.Generator) -> Primitives:
        """Draw `n` new variants from the Gaussian with this mean and covariance, durations (log-normal) included."""
        check_count("n", n, 1)
        normal = np.random.default_rng(seed).standard_normal((n, len(self.factor)))
        theta = parameters.to_numbers(self.primitive) + np.tensordot(normal, self.factor, axes=1)
        durations = self.primitive.durations * np.exp(normal @ self.tempo_factor)
        return parameters.with_numbers(self.primitive, theta, durations)

    def condition(
        self,
        t: ArrayLike,
        position: ArrayLike | None = None,
        std: ArrayLike = 0.0,
        *,
        velocity: ArrayLike | None = None,
        velocity_std: ArrayLike = 0.0,
    ) -> AveragePrimitive:
        """The average of those movements that are at a position, or have a velocity, at some times.

        The Gaussian is updated as Paraschos et al. (2013, Section 2.2) do, exactly and in its low-rank factor: what was
        demonstrated together changes together, the duration too. Conditioning on positions one after another, in any
        order, is conditioning on all at once. In an exact velocity the duration counts, and so does the order.

        Parameters
        ----------
        t : float or array_like of shape (m,)
            Times as shares of the duration, from 0 to 1.
        position : array_like of shape (d,) or (m, d), optional
            In the unit of the movements; NaN for dimensions that are free.
        std : float or array_like of shape (m,) or (m, d), default 0.0
            Standard deviation of the position: 0 meets it exactly, infinity changes nothing.
        velocity : array_like of shape (d,) or (m, d), optional
            Per second; NaN for dimensions that are free.
        velocity_std : float or array_like of shape (m,) or (m, d), default 0.0
            The same for the velocity.

        Raises
        ------
        SpecificationError
            Times outside 0 to 1, a negative std, neither position nor velocity, or more exact numbers than the
            directions in which the demonstrations differ.
        TrajectoryError
            Positions or velocities of the wrong shape or infinite.

        Warns
        -----
        ExtrapolationWarning
            A position or velocity that one of 370 such demonstrations would have, or fewer: with its distance, in units
            and in standard deviations (Mahalanobis).
        """
        if position is None and velocity is None:
            raise SpecificationError("expected a position or a velocity to condition on, got neither")
        times, d = np.atleast_1d(as_numbers(t, "t")), self.primitive.n_dims
        if times.ndim != 1 or not len(times) or not ((times >= 0.0) & (times <= 1.0)).all():
            raise SpecificationError(f"expected t between 0 and 1, as shares of the duration, got {t!r}")
        observed = (
            None if position is None else parameters.as_observations("position", times, position, std, d),
            None if velocity is None else parameters.as_observations("velocity", times, velocity, velocity_std, d),
        )
        theta, duration, factor, tempo = parameters.updated(self.primitive, self.factor, self.tempo_factor, observed)
        return AveragePrimitive(parameters.with_numbers(self.primitive, theta, duration), factor, tempo, self.noise)

    def log_likelihood(self, movements: Primitives | MovementsLike, noise: float | None = None) -> Array:
        """Log probability density of the path of each movement, shape (n,), in nats.

        Paths are those of primitives with this specification, at its `n_points` (T) times, equal shares of the
        duration: the Gaussian of theta, and independent noise in all directions. The density is proper, its integral
        over all paths of d T numbers is 1, so averages of different movements compare. Neighboring times are not
        independent in truth: differences of log-likelihood are larger than the evidence.

        Parameters
        ----------
        movements : Primitives of this specification, or movements as `DMP.learn` takes them
        noise : float, optional
            Standard deviation of the noise, in the unit of the movements; by default the attribute `noise`.

        Raises
        ------
        SpecificationError
            No noise given where none could be estimated; primitives of another specification or dimension.
        """
        sigma = self.noise if noise is None else noise
        if sigma is None:
            raise SpecificationError(
                f"expected noise, which {len(self.factor)} demonstrations cannot tell; pass noise=, in the unit of the "
                "movements"
            )
        check_number("noise", sigma, above=0.0)
        matrix = parameters.path_matrix(self.primitive.dmp, self.primitive.dmp.n_points)
        deviations = parameters.to_numbers(self._of_this_kind(movements)) - parameters.to_numbers(self.primitive)
        paths = parameters.map_rows(deviations, matrix).reshape(len(deviations), -1)
        n_numbers = paths.shape[1]
        # With B = U diag(s) V' (r, d T) the path of the factor, ln N(e; 0, B' B + noise^2 I) follows from c = V' e, and
        # nothing of the size (d T)^2 is formed.
        spread = parameters.map_rows(self.factor, matrix).reshape(len(self.factor), n_numbers)
        _, s, Vt = np.linalg.svd(spread, full_matrices=False)
        along = paths @ Vt.T
        beside = np.sum((paths - along @ Vt) ** 2, axis=1)
        variances = s**2 + sigma**2
        determinant = np.sum(np.log(variances)) + 2.0 * (n_numbers - len(s)) * np.log(sigma)
        distances = along**2 @ (1.0 / variances) + beside / sigma**2
        return np.asarray(-0.5 * (determinant + distances + n_numbers * np.log(2.0 * np.pi)))

    def blend(self, other: AveragePrimitive, activation: ArrayLike) -> AveragePrimitive:
        """One movement from two, each as much as it is active: the product of their Gaussians at each time.

        ``p(x) ~ p_1(x)^(1 - a) p_2(x)^a`` (Paraschos et al. 2013, Section 2.2): where one is certain and the other is
        not, the path is that of the certain one. The logarithm of the duration is averaged by the mean activation.

        Parameters
        ----------
        other : AveragePrimitive
            Of the same specification and dimension.
        activation : float or array_like of shape (S,)
            Of the other, from 0 to 1, at even times from start to goal; between them it is interpolated.

        Raises
        ------
        SpecificationError
            Another specification or dimension, or an activation outside 0 to 1.
        """
        a = np.atleast_1d(as_numbers(activation, "activation"))
        if a.ndim != 1 or not len(a) or not ((a >= 0.0) & (a <= 1.0)).all():
            raise SpecificationError(
                f"expected activation to be numbers from 0 to 1, of shape (S,), got {activation!r}"
            )
        even = np.linspace(0.0, 1.0, self.primitive.dmp.n_points)
        a = np.interp(even, np.linspace(0.0, 1.0, len(a)), a)
        if not isinstance(other, AveragePrimitive):
            raise SpecificationError(f"expected an AveragePrimitive to blend with, got {type(other).__name__}")
        own, its = self.primitive, self._of_this_kind(other.primitive)
        floor = _CERTAIN * float(max(own.extents.max(), its.extents.max()))
        first, second = (parameters.to_numbers(own), self.factor), (parameters.to_numbers(its), other.factor)
        theta, factor = blended(own.dmp, first, second, a, floor)
        share = float(a.mean())
        duration = own.durations ** (1.0 - share) * its.durations**share
        label = (
            parameters.shared_label(Primitives.concatenate([own, its]))
            if own.labels is not None is not its.labels
            else None
        )
        mean = parameters.from_numbers(own.dmp, theta, duration, label, merged([own.recorded_as, its.recorded_as]))
        tempo = np.concatenate(((1.0 - share) * self.tempo_factor, share * other.tempo_factor))
        noises = [noise for noise in (self.noise, other.noise) if noise is not None]
        return AveragePrimitive(mean, factor, tempo, max(noises, default=None))

    def _of_this_kind(self, movements: Primitives | MovementsLike) -> Primitives:
        own = self.primitive
        same = parameters.of_kind(movements, own.dmp, own.n_dims, own.moving_channels, "the same")
        if own.recorded_as is None:
            return same
        periods = own.recorded_as.periods(np.concatenate((own.starts, same.starts)))
        return parameters.without_turns(same, turns_beyond(same.starts, own.starts[0], periods))


def average(primitives: Primitives | MovementsLike, weights: ArrayLike | None = None) -> AveragePrimitive:
    """Mean and covariance of a batch of primitives, as if they were several demonstrations of one movement.

    The mean of ``theta = [W, x0, g, tau v0]`` is the movement whose path is the mean of the demonstrations' paths at
    equal phase, in every formulation; see `kineme.dmp.styles.parameters` for why the mean of the *scaled*
    weights W, and not of w, is the right one when g - x0 differs. Durations are averaged geometrically, as tempi are
    ratios. The covariance is free of bias: divided by ``1 - sum p_i^2``, that is by n - 1 where all count alike.

    Parameters
    ----------
    primitives : Primitives, or movements as `DMP.learn` takes them
        One movement shown n times; what is not learned yet is learned as ``DMP()`` does. One has no spread.
    weights : array_like of shape (n,), optional
        How much each demonstration counts, 0 or more; only their ratios matter. By default all count alike.

    Raises
    ------
    TrajectoryError
        No primitive, movements that cannot be learned, or weights of the wrong number, negative, infinite, or all zero.
    """
    primitives = parameters.as_primitives(primitives)
    p = _shares(weights, len(primitives))
    tempo = np.log(primitives.durations / primitives.durations[0])
    numbers = parameters.to_numbers(primitives)
    theta = np.column_stack((numbers.reshape(len(p), -1), tempo))
    mean = theta[0] + p @ (theta - theta[0])  # equal demonstrations give themselves to the last bit
    rest = 1.0 - p @ p
    factor = np.sqrt(p / rest)[:, None] * (theta - mean) if rest > np.finfo(float).eps else np.zeros((0, len(mean)))
    if len(factor) > len(mean):
        factor = np.linalg.qr(factor, mode="r")  # the same covariance from as few rows as it has columns
    shape = (primitives.n_dims, primitives.dmp.n_basis + 3)
    duration = primitives.durations[:1] * np.exp(mean[-1:])
    center = parameters.with_numbers(primitives, mean[:-1].reshape(1, *shape), duration)
    noise = unexplained_noise(primitives.dmp, numbers[p > 0.0] - numbers[p > 0.0].mean(axis=0))
    return AveragePrimitive(center, factor[:, :-1].reshape(len(factor), *shape), factor[:, -1], noise)


def average_by_label(primitives: Primitives | MovementsLike) -> dict[Any, AveragePrimitive]:
    """One `average` for each label, in sorted order.

    Raises `TrajectoryError`: primitives without labels.
    """
    primitives = parameters.as_primitives(primitives)
    if primitives.labels is None:
        raise TrajectoryError(
            "expected labeled primitives, got none with a label; learn them from demonstrations with labels, "
            "or use average for a single movement"
        )
    return {label: average(primitives[primitives.labels == label]) for label in np.unique(primitives.labels).tolist()}


def _shares(weights: ArrayLike | None, n: int) -> Array:
    """Weights (n,) that sum to 1."""
    if n == 0:
        raise TrajectoryError("expected at least one primitive to average, got none")
    if weights is None:
        return np.full(n, 1.0 / n)
    w = as_numbers(weights, "weights")
    if w.shape != (n,):
        raise TrajectoryError(f"expected one weight for each of the {n} primitives, got weights of shape {w.shape}")
    bad = ~np.isfinite(w) | (w < 0)
    if bad.any():
        i = int(np.argmax(bad))
        raise TrajectoryError(f"expected weights of 0 or more, got {w[i]:g} for primitive {i}")
    if not w.any():
        raise TrajectoryError(f"expected at least one weight above 0, got {n} zeros")
    return w / w.sum()


def blended(
    dmp: Specification, first: tuple[Array, Array], other: tuple[Array, Array], activation: Array, floor: float
) -> tuple[Array, Array]:
    """Theta and factor of two averages blended with `activation` (T,); `floor` is the least deviation that counts."""
    matrix = parameters.path_matrix(dmp, len(activation))
    means = [parameters.map_rows(theta, matrix)[0].T for theta, _ in (first, other)]  # (T, d)
    deviations = [parameters.map_rows(factor, matrix).transpose(2, 0, 1) for _, factor in (first, other)]  # (T, r, d)
    a = np.stack((1.0 - activation, activation))[:, :, None, None]
    size = np.sqrt(sum(float(np.mean(np.sum(x**2, axis=1))) for x in deviations) / 2.0)
    least = max(_FLOOR * size, floor) ** 2 * np.eye(means[0].shape[1])
    precisions = np.stack([np.linalg.inv(x.transpose(0, 2, 1) @ x + least) for x in deviations])  # (2, T, d, d)
    gains = np.linalg.inv(np.sum(a * precisions, axis=0)) @ precisions  # Sigma Sigma_i^-1
    mean = sum((a[i] * gains[i] @ means[i][:, :, None])[:, :, 0] for i in (0, 1))
    paths = [deviations[i] @ (np.sqrt(a[i]) * gains[i]).transpose(0, 2, 1) for i in (0, 1)]
    theta = encoded(dmp, np.asarray(mean)[None].transpose(0, 2, 1))
    return theta, encoded(dmp, np.concatenate(paths, axis=1).transpose(1, 2, 0))


def encoded(dmp: Specification, paths: Array) -> Array:
    """Theta (n, d, N + 3) of paths (n, d, T) at even times: learning is linear."""
    relative = paths - paths[:, :, :1]
    operator = encoder(dmp, paths.shape[2])
    weights, velocity = relative @ operator.weights, relative @ operator.velocity
    return np.concatenate((weights, np.stack((paths[:, :, 0], paths[:, :, -1], velocity), axis=2)), axis=2)


def unexplained_noise(dmp: Specification, deviations: Array) -> float | None:
    """Standard deviation that others leave unexplained, from theta (n, d, N + 3) minus its mean; None if unknown.

    Each demonstration is compared with the nearest weighted mean of the others. With G the products of the centered
    paths its squared distance is ``1 / (G^+)_ii``, in d T - (n - 2) directions.
    """
    n, d, n_numbers = deviations.shape
    if n < 3 or n - 2 >= d * n_numbers:
        return None
    paths = parameters.map_rows(deviations, parameters.path_matrix(dmp, dmp.n_points)).reshape(n, -1)
    values, vectors = np.linalg.eigh(paths @ paths.T)
    values, vectors = values[1:], vectors[:, 1:]  # without the direction in which all are shifted
    if not values[0] > n * np.finfo(float).eps * values[-1]:
        return None
    squares = 1.0 / np.sum(vectors**2 / values, axis=1)
    return float(np.sqrt(squares.mean() / (paths.shape[1] - (n - 2))))
