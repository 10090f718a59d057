"""Generated movements in a batch: any start, goal, duration and rate, as one matrix product."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, NamedTuple, Self, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.dmp.batch import Batch
from kineme.dmp.discrete.operators import decoder
from kineme.dmp.discrete.specification import Specification
from kineme.dmp.discrete.via_points import broadcast_length, check_durations, filled, per_movement
from kineme.dmp.recorded_as import with_recorded
from kineme.errors import DegenerateMovementError, SpecificationError
from kineme.movements.channels.channel import Channels, recorded_names
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.labels import as_indices
from kineme.movements.trajectories.movements import Samples
from kineme.movements.trajectories.presented import Presented, with_units
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.runtime.parallel import for_tiles
from kineme.validation import Array, as_numbers, check_count, check_number, check_samples, describe

_PER_BASIS = 32  # samples for each basis function: parabolas through three of them miss a maximum by less than 1e-5
_LIMITED_SAMPLES = 200_000  # in one tile of movements, each with so many
_LONGEST = 10.0  # durations after which a movement that has not settled is given up
_SETTLING_SAMPLES = 400
_TILE_SAMPLES = 100_000  # numbers in one tile of the result


class Change(NamedTuple):
    """A change of the weights of n movements: ``W + coefficients @ directions``."""

    coefficients: Array  # (n, d, k)
    directions: Array  # (k, N)


@dataclass(frozen=True, eq=False, repr=False)
class BaseRollout(Presented, ABC):
    """n generated movements of T samples each: a sequence of `Trajectory`, taken wherever movements are expected.

    ``rollout[i]`` is one `Trajectory` and ``rollout[2:5]``, as any slice, mask or list of indices, a rollout of the
    chosen movements. `numpy.asarray` gives `positions`.
    """

    primitives: Batch  # that move, one for each movement or one for all

    @property
    @abstractmethod
    def times(self) -> Array:
        """Times of the samples (n, T), from 0 [s]."""

    @cached_property
    def positions(self) -> Array:
        """Movements in the columns and in the unit of the demonstrations, (n, T, d)."""
        return self._derivative(0)

    @cached_property
    def velocities(self) -> Array:
        """Velocities, per second; of orientations angular ones in the world frame."""
        return self._derivative(1)

    @cached_property
    def accelerations(self) -> Array:
        """Accelerations, per second squared; of orientations angular ones in the world frame."""
        return self._derivative(2)

    @abstractmethod
    def _derivative(self, order: int) -> Array:
        """Positions (n, T, d), or a derivative of them in time."""

    @property
    def _shares(self) -> Array:
        """Times of the samples as shares of the duration (T,)."""
        return np.asarray(self.times[0] / self.times[0, -1])

    @property
    def _column_channels(self) -> Channels | None:
        """Channels of the columns of `positions`, where these are no coordinates and no recording is known."""
        return None

    def _take(self, chosen: NDArray[np.intp]) -> Self:
        """The rollout of the chosen movements; a field that all of them share stays."""

        def of(value: Any) -> Any:
            if isinstance(value, Change):
                return value._replace(coefficients=value.coefficients[chosen])
            each = isinstance(value, (np.ndarray, BaseRollout)) and len(value) == len(self)
            return value[chosen] if each or (isinstance(value, Batch) and len(value) > 1) else value

        return replace(self, **{field.name: of(getattr(self, field.name)) for field in fields(self)})

    def _with_samples(self, n_samples: int) -> Self:
        return replace(self, **{"n_samples": n_samples})  # type: ignore[arg-type]

    @abstractmethod
    def __len__(self) -> int: ...

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self)} movements of {self.times.shape[1]} samples from {self.primitives!r})"

    @property
    def axis_names(self) -> list[str]:
        """Names of the d columns of `positions`, in tables and figures."""
        about = self.primitives.to_recording
        return self.primitives.plain_names[0] if about is None else list(about.column_names)

    @property
    def _samples(self) -> Samples:
        n, n_samples, d = self.positions.shape
        names = with_units(tuple(self.axis_names), self.channels)
        columns = self.positions.reshape(-1, d)
        offsets = n_samples * np.arange(n + 1)
        return Samples(self.times.ravel(), offsets, columns, names, columns, names, self.labels)

    @property
    def rate_names(self) -> list[str]:
        """Names of the columns of `velocities` and `accelerations`."""
        about = self.primitives.to_recording
        return self.primitives.plain_names[1] if about is None else list(about.rate_names)

    @property
    def channels(self) -> Channels | None:
        """Channels of the recordings, where they are known; see `Demonstrations.channels`."""
        return self.primitives.channels

    @property
    def labels(self) -> NDArray[Any] | None:
        """Labels of the movements (n,), those of their primitives, or None."""
        labels = self.primitives.labels
        return labels if labels is None or len(labels) == len(self) else np.repeat(labels, len(self))

    @property
    def names(self) -> tuple[str | None, ...] | None:
        """Names of the movements, those of their primitives, or None."""
        names = self.primitives.names
        return names if names is None or len(names) == len(self) else names * len(self)

    @cached_property
    def demonstrations(self) -> Demonstrations:
        """The movements as `Demonstrations`, with the labels, names and channels of their primitives.

        Of primitives that were learned from recordings with named columns they are what a recording of the movement
        would be: orientations in the recorded order, and discrete channels that step where they did. Of other poses the
        positions are the columns that are generated, quaternions (w, x, y, z) too.

        Raises `TrajectoryError`: movements that are none, as of fewer than four samples.
        """
        demonstrations = Demonstrations.from_arrays(
            self.positions, self.labels, list(self.times), self.names, copy=False
        )
        if (about := self.primitives.to_recording) is not None:
            return Demonstrations.of_movements(
                with_recorded(demonstrations.movements, about, self._shares, len(self.primitives))
            )
        if (columns := self._column_channels) is None:
            return demonstrations
        return Demonstrations.of_movements(
            replace(demonstrations.movements, channels=columns, dimensions=recorded_names(columns))
        )

    @property
    def trajectories(self) -> Demonstrations:
        """The same as `demonstrations`."""
        return self.demonstrations

    def __iter__(self) -> Iterator[Trajectory]:
        return iter(self.demonstrations)

    @overload
    def __getitem__(self, index: int) -> Trajectory: ...
    @overload
    def __getitem__(self, index: slice | Sequence[int] | NDArray[Any]) -> Self: ...
    def __getitem__(self, index: Any) -> Trajectory | Self:
        """One `Trajectory` for an integer; a rollout for a slice, a mask or a list of indices."""
        chosen = as_indices(index, len(self))
        return self.demonstrations[int(chosen)] if chosen.ndim == 0 else self._take(chosen)

    def _least(self, durations: Array, passed: float, fixed_velocity: bool, *limits: ArrayLike | None) -> Array:
        """Least durations (n,); see `Rollout.least_duration`. `passed` is the last sample's time in durations."""
        if fixed_velocity:
            raise SpecificationError(
                "expected a movement whose velocities scale with its tempo, got one with velocity=, end_velocity= or "
                "goal_velocity= other than 0: its path depends on the duration; try durations, and look at velocities "
                "and accelerations"
            )
        if all(limit is None for limit in limits):
            raise SpecificationError("expected a limit: velocity, acceleration, or both")
        n_samples = math.ceil(_PER_BASIS * passed * self.primitives.dmp.n_basis) + 1
        factors, size = np.zeros(len(durations)), max(1, _LIMITED_SAMPLES // n_samples)
        for first in range(0, len(durations), size):
            chosen = slice(first, first + size)
            tile = self[chosen]._with_samples(n_samples)
            for power, name, limit in zip((1, 2), ("velocity", "acceleration"), limits, strict=True):
                if limit is not None:
                    rates = tile.velocities if power == 1 else tile.accelerations
                    exceeded = (_maximum(np.abs(rates)) / _largest(name, limit, rates.shape[2])).max(axis=1)
                    factors[chosen] = np.maximum(factors[chosen], exceeded ** (1.0 / power))
        return np.asarray(durations * factors)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.positions, dtype=dtype, copy=copy)


def _maximum(x: Array) -> Array:
    """The maximum of curves (n, T, d) with even samples, shape (n, d): the top of a parabola through three of them."""
    middle = x[:, 1:-1]
    slope, bend = (x[:, 2:] - x[:, :-2]) / 2, x[:, :-2] - 2 * middle + x[:, 2:]
    inside = (bend < 0) & (np.abs(slope) < -bend)
    tops = middle - slope**2 / (2 * np.where(inside, bend, -1.0))
    return np.asarray(np.maximum(x.max(axis=1), np.where(inside, tops, 0.0).max(axis=1)))


def _largest(name: str, limit: ArrayLike, n_dims: int) -> Array:
    """A limit as positive (d,)."""
    value = as_numbers(limit, name)
    if value.shape not in {(), (n_dims,)} or not (value > 0).all() or not np.isfinite(value).all():
        raise SpecificationError(f"expected {name} to be a number above 0, or {n_dims} of them, got {limit!r}")
    return np.broadcast_to(value, n_dims)


@dataclass(frozen=True, eq=False, repr=False)
class Rollout(BaseRollout):
    """n generated movements of T samples each; positions and derivatives are computed when asked for.

    A sequence of `Trajectory`, taken wherever movements are expected; see `BaseRollout`. Each of `positions`,
    `velocities` and `accelerations` is one product of numbers ``[W, g - x0, v0, x0]`` with the decode matrix.
    """

    ratio: Array  # (n, d), what scale f is multiplied by
    starts: Array  # (n, d)
    goals: Array  # (n, d)
    velocities_at_start: Array  # (n, d), per second
    durations: Array  # (n,), tau
    n_samples: int
    end: float = 1.0  # of the last sample, in durations
    change: Change | None = None  # of the weights in force: via points, end velocity
    goal_velocities: Array | None = None  # (n, d), per second, of goals that move
    fixed_velocity: bool = False  # whether a velocity was asked for that does not scale with the tempo

    def __len__(self) -> int:
        return len(self.starts)

    @property
    def weights(self) -> Array:
        """Scaled weights in force (n, d, N), with the change."""
        weights = self.primitives.row("scaled_weights") * self.ratio[:, :, None]
        return weights if self.change is None else weights + self.change.coefficients @ self.change.directions

    @property
    def arrivals(self) -> Array:
        """The goals at the end of the duration (n, d)."""
        return self.goals if self.goal_velocities is None else self.goals + self.goal_steps

    @property
    def goal_steps(self) -> Array:
        """Distances by which the goals move in one duration (n, d)."""
        if self.goal_velocities is None:
            return np.zeros_like(self.goals)
        return self.goal_velocities * self.durations[:, None]

    @property
    def times(self) -> Array:
        """Times of the samples (n, T) [s]."""
        return self.durations[:, None] * self._shares

    def least_duration(self, velocity: ArrayLike | None = None, acceleration: ArrayLike | None = None) -> Array:
        """The least duration of each movement (n,) [s] in which the same path stays within limits.

        Of one path, velocities are in proportion to ``1 / tau`` and accelerations to ``1 / tau^2``, so it is
        ``tau max(|v_k| / velocity_k, sqrt(|a_k| / acceleration_k))``, the maximum over time and dimensions k. It holds
        between samples too, whatever their number, to 1e-5 of a limit.
        ``rollout(duration=...)`` moves so; initial velocities scale with the rest.

        Parameters
        ----------
        velocity, acceleration : float or array_like of shape (d,), optional
            Largest absolute value, per second and per second squared: of all dimensions, or one each.

        Raises
        ------
        SpecificationError
            No limit, or one that is not above 0; a rollout that was given a velocity other than 0, initial, at the end
            or of the goal, for its path depends on the duration.
        """
        return self._least(self.durations, self.end, self.fixed_velocity, velocity, acceleration)

    @property
    def _shares(self) -> Array:
        return np.linspace(0.0, self.end, self.n_samples)

    def _derivative(self, order: int) -> Array:
        response = decoder(self.primitives.dmp, self.n_samples, self.end)
        constant = np.full(self.n_samples, 1.0 if order == 0 else 0.0)
        rows = [response.Phi[order].T, response.goal[order], response.velocity[order], constant]
        goal_steps = self.goal_steps[:, :, None] if self.goal_velocities is not None else np.zeros((len(self), 1, 0))
        rows += [response.moving_goal[order]] * goal_steps.shape[2]
        change = self.change or Change(np.zeros((len(self), 1, 0)), np.zeros((0, len(response.Phi[order].T))))
        matrix, n_basis = np.vstack([*rows, change.directions @ rows[0]]), self.primitives.dmp.n_basis
        n_others = len(matrix) - len(change.directions)
        per_tau = (1.0 / self.durations**order)[:, None, None]
        shared = len(self.primitives) == 1
        weights, d = self.primitives.row("scaled_weights"), self.starts.shape[1]
        result = np.empty((len(self), d, self.n_samples))

        def tile(start: int, stop: int) -> None:
            chosen = slice(start, stop)
            numbers = np.empty((stop - start, d, len(matrix)))
            np.multiply(
                weights if shared else weights[chosen], self.ratio[chosen, :, None], out=numbers[:, :, :n_basis]
            )
            numbers[:, :, n_basis] = self.goals[chosen] - self.starts[chosen]
            numbers[:, :, n_basis + 1] = self.velocities_at_start[chosen] * self.durations[chosen, None]
            numbers[:, :, n_basis + 2] = self.starts[chosen]
            numbers[:, :, n_basis + 3 : n_others] = goal_steps[chosen]
            numbers[:, :, n_others:] = change.coefficients[chosen]
            # Two-dimensional on purpose: a stack of matrices would become as many small products.
            rows = numbers.reshape(-1, len(matrix))
            np.matmul(rows, matrix, out=result[chosen].reshape(len(rows), -1))
            if order:
                result[chosen] *= per_tau[chosen]

        for_tiles(tile, len(self), max(1, _TILE_SAMPLES // (d * self.n_samples)))
        return result.transpose(0, 2, 1)


def rollout(
    primitives: Batch,
    start: ArrayLike | None,
    goal: ArrayLike | None,
    duration: ArrayLike | None,
    velocity: ArrayLike | None,
    goal_velocity: ArrayLike | None = None,
) -> Rollout:
    """Check the options and broadcast them over the primitives; see `Primitives.rollout`."""
    d, row = primitives.n_dims, primitives.row
    vectors = {"start": start, "goal": goal, "velocity": velocity, "goal_velocity": goal_velocity}
    options = {name: per_movement(vector, name, d) for name, vector in vectors.items()}
    options["duration"] = per_movement(duration, "duration", None)
    n = broadcast_length(len(primitives), options)
    durations = filled(options["duration"], row("durations"), n)
    check_durations("duration", durations)
    starts, goals = filled(options["start"], row("starts"), n), filled(options["goal"], row("goals"), n)
    # The demonstrated velocity scales with the tempo; a given velocity does not.
    tempo = row("durations") / durations
    velocities = filled(options["velocity"], row("velocities"), n)
    velocities = velocities * (tempo[:, None] if options["velocity"] is None else 1.0)
    moving = None if (rate := options["goal_velocity"]) is None else np.broadcast_to(rate, (n, d))
    arrivals = goals if moving is None else goals + moving * durations[:, None]
    ratio = primitives.dmp.system.ratio(arrivals - starts, row("goals") - row("starts"), row("extents"))
    if not np.isfinite(ratio).all():
        i, k = (int(index) for index in np.argwhere(~np.isfinite(ratio))[0])
        raise DegenerateMovementError(
            f"{describe(min(i, len(primitives) - 1), primitives.names)}: expected a demonstration with g != x0 in "
            f"dimension {k} to move to another goal, got a closed or flat one; the original formulation scales by "
            'g - x0: use "bio-inspired" or "amplitude-scaled"'
        )
    given = [option for option in (options["velocity"], moving) if option is not None]
    return Rollout(
        primitives,
        ratio,
        starts,
        goals,
        velocities,
        durations,
        primitives.dmp.n_points,
        goal_velocities=moving,
        fixed_velocity=any(bool(option.any()) for option in given),
    )


def sampled(movement: Rollout, rate: float | None, n_samples: int | None, settle: float | None) -> Rollout:
    """The movement with the samples that the options of `Primitives.rollout` ask for."""
    dmp = movement.primitives.dmp
    end = 1.0 if settle is None else settled_end(movement, settle)
    if rate is not None and n_samples is not None:
        raise SpecificationError("expected either rate or n_samples, got both")
    if rate is not None:
        n_samples = samples_at_rate(rate, movement.durations * end, dmp)
    elif n_samples is None:
        n_samples = math.ceil(end * (dmp.n_points - 1)) + 1
    n_samples = check_samples(check_count("n_samples", n_samples, 2), dmp.n_basis, "n_samples")
    return replace(movement, n_samples=n_samples, end=end)


def samples_at_rate(rate: float, durations: Array, dmp: Specification) -> int:
    """Samples per movement so that none is sampled more coarsely than `rate` [Hz]."""
    check_number("rate", rate, above=0.0)
    wanted = float(durations.max()) * rate * (1 - 1e-12) + 1
    n_samples = check_samples(wanted, dmp.n_basis, "rate times duration")
    least = math.ceil(2 * math.sqrt(dmp.K)) + 1
    if n_samples < least:
        raise SpecificationError(
            f"expected a rate of at least {(least - 1) / float(durations.max()):.3g} Hz to follow the dynamics, that "
            f"is two samples in each time constant duration / sqrt(K) of the spring, got {rate:g} Hz"
        )
    return n_samples


def settled_end(movement: Rollout, tolerance: float) -> float:
    """Time, in durations from 1 on, at which every movement stays within `tolerance` of its goal."""
    check_number("settle", tolerance, above=0.0)
    far = replace(movement, n_samples=_SETTLING_SAMPLES, end=_LONGEST)
    goals = (
        movement.goals[:, None] + np.linspace(0.0, _LONGEST, _SETTLING_SAMPLES)[:, None] * movement.goal_steps[:, None]
    )
    outside = (np.abs(far.positions - goals) > tolerance).any(axis=(0, 2))
    last = int(np.flatnonzero(outside)[-1]) if outside.any() else 0
    if last == _SETTLING_SAMPLES - 1:
        raise SpecificationError(
            f"expected the movement to come within {tolerance:g} of its goal in {_LONGEST:g} durations, it does "
            "not; raise the tolerance, the stiffness or the damping"
        )
    return max(1.0, (last + 1) * _LONGEST / (_SETTLING_SAMPLES - 1))
