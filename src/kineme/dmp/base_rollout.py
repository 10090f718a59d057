"""Base of all generated movements, be they discrete, rhythmic or poses."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Self, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.dmp.batch import Batch
from kineme.dmp.recorded_as import RecordedAs, with_recorded
from kineme.errors import SpecificationError
from kineme.movements.channels.channel import Channels, recorded_names
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.labels import as_indices
from kineme.movements.trajectories.movements import axis_names
from kineme.movements.trajectories.presented import Presented, Samples, with_units
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.validation import Array, as_numbers

_PER_BASIS = 32  # samples for each basis function: parabolas through three of them miss a maximum by less than 1e-5
_TILE_SAMPLES = 200_000  # in one tile of movements, each with so many


class BaseRollout(Presented, ABC):
    """n generated movements of T samples each: a sequence of `Trajectory`, taken wherever movements are expected.

    ``len(rollout)`` is n, iterating gives one `Trajectory` each, ``rollout[i]`` is one `Trajectory` and
    ``rollout[2:5]``, as any slice, mask or list of indices, a rollout of the chosen movements. `numpy.asarray` gives
    `positions`.
    """

    @property
    @abstractmethod
    def times(self) -> Array:
        """Times of the samples (n, T), from 0 [s]."""

    @property
    @abstractmethod
    def positions(self) -> Array:
        """Movements in the columns that were demonstrated, (n, T, d)."""

    @property
    @abstractmethod
    def velocities(self) -> Array:
        """Velocities, per second."""

    @property
    @abstractmethod
    def accelerations(self) -> Array:
        """Accelerations, per second squared."""

    @property
    def _shares(self) -> Array:
        """Times of the samples as shares of the duration (T,)."""
        return np.asarray(self.times[0] / self.times[0, -1])

    @property
    def _to_recording(self) -> RecordedAs | None:
        return self._batch.to_recording

    @property
    def _column_channels(self) -> Channels | None:
        """Channels of the columns of `positions`, where these are no coordinates and no recording is known."""
        return None

    @property
    @abstractmethod
    def _batch(self) -> Batch:
        """The primitives that move, one for each movement or one for all."""

    @abstractmethod
    def _take(self, chosen: NDArray[np.intp]) -> Self:
        """The rollout of the chosen movements."""

    @abstractmethod
    def __len__(self) -> int: ...

    @property
    def axis_names(self) -> list[str]:
        """Names of the d columns of `positions`, in tables and figures."""
        about = self._to_recording
        return axis_names(self.positions.shape[2]) if about is None else list(about.column_names)

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
        about = self._to_recording
        return axis_names(self.velocities.shape[2]) if about is None else list(about.rate_names)

    @property
    def channels(self) -> Channels | None:
        """Channels of the recordings, where they are known; see `Demonstrations.channels`."""
        return self._batch.channels

    @property
    def labels(self) -> NDArray[Any] | None:
        """Labels of the movements (n,), those of their primitives, or None."""
        labels = self._batch.labels
        return labels if labels is None or len(labels) == len(self) else np.repeat(labels, len(self))

    @property
    def names(self) -> tuple[str | None, ...] | None:
        """Names of the movements, those of their primitives, or None."""
        names = self._batch.names
        return names if names is None or len(names) == len(self) else names * len(self)

    @cached_property
    def demonstrations(self) -> Demonstrations:
        """The movements as `Demonstrations`, with the labels, names and channels of their primitives.

        Of primitives that were learned from recordings with named columns they are what a recording of the movement
        would be: orientations in the recorded order, and discrete channels that step where they did.

        Of other poses the positions are the columns that are generated, quaternions (w, x, y, z) too. Their channels
        say so, and recognition converts them.

        Raises
        ------
        TrajectoryError
            Movements that are none, as of fewer than four samples.
        """
        demonstrations = Demonstrations.from_arrays(
            self.positions, self.labels, list(self.times), self.names, copy=False
        )
        about = self._to_recording
        if about is not None:
            return Demonstrations.of_movements(
                with_recorded(demonstrations.movements, about, self._shares, len(self._batch))
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

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self.positions, dtype=dtype, copy=copy)


def least_durations(
    movements: Any,
    durations: Array,
    finely: tuple[float, Callable[[Any, int], Any]],
    fixed_velocity: bool,
    limits: tuple[ArrayLike | None, ArrayLike | None],
) -> Array:
    """Least durations (n,) of n movements; see `Rollout.least_duration`.

    `finely` is the number of basis functions that they pass, and what gives them so many samples.
    """
    if fixed_velocity:
        raise SpecificationError(
            "expected a movement whose velocities scale with its tempo, got one with velocity=, end_velocity= or "
            "goal_velocity= other than 0: its path depends on the duration; try durations, and look at velocities "
            "and accelerations"
        )
    if all(limit is None for limit in limits):
        raise SpecificationError("expected a limit: velocity, acceleration, or both")
    n_basis, with_samples = finely
    n_samples = math.ceil(_PER_BASIS * n_basis) + 1
    factors, size = np.zeros(len(durations)), max(1, _TILE_SAMPLES // n_samples)
    for first in range(0, len(durations), size):
        chosen = slice(first, first + size)
        tile = with_samples(movements[chosen], n_samples)
        for power, name, limit in zip((1, 2), ("velocity", "acceleration"), limits, strict=True):
            if limit is not None:
                rates = tile.velocities if power == 1 else tile.accelerations
                exceeded = (_maximum(np.abs(rates)) / _largest(name, limit, rates.shape[2])).max(axis=1)
                factors[chosen] = np.maximum(factors[chosen], exceeded ** (1.0 / power))
    return np.asarray(durations * factors)


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
