"""Generated orientations and poses with their velocities and accelerations in the world frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.dmp.base_rollout import BaseRollout, least_durations
from kineme.dmp.batch import Batch
from kineme.dmp.discrete.rollout import Rollout
from kineme.dmp.pose.rates import angular_acceleration, angular_velocity
from kineme.dmp.recorded_as import RecordedAs
from kineme.movements.channels.channel import Channel, Channels
from kineme.movements.rotations import exp, product
from kineme.runtime.parallel import for_tiles
from kineme.validation import Array

_TILE_SAMPLES = 10_000  # samples in one tile: with its intermediate results it stays in a core's cache


@dataclass(frozen=True, eq=False, repr=False)
class PoseRollout(BaseRollout):
    """n generated movements of T samples; computed when asked for.

    A sequence of `Trajectory`, taken wherever movements are expected; see `BaseRollout`.

    Attributes
    ----------
    tangent : Rollout
        The movement in positions and rotation vectors.
    references : ndarray of shape (n, 4), or (n, 4 k) of k orientations
        Goal orientations, from which the rotation vectors count.
    recorded_as : RecordedAs or None
        Channels of the recordings, where they are known.
    """

    tangent: Rollout
    references: Array
    recorded_as: RecordedAs | None = None

    def __len__(self) -> int:
        return len(self.tangent)

    def __repr__(self) -> str:
        return f"PoseRollout({len(self)} movements of {self.tangent.n_samples} samples)"

    @property
    def times(self) -> Array:
        """Times of the samples (n, T) [s]."""
        return self.tangent.times

    @cached_property
    def orientations(self) -> Array:
        """Unit quaternions (n, T, 4); of k orientations (n, T, 4 k), one after the other, as all that follows."""
        return self._of_each(lambda r, p: product(exp(p), r), 4, 1)

    @property
    def poses(self) -> Array:
        """The same as `positions`."""
        return self.positions

    @property
    def positions(self) -> Array:
        """Movements as demonstrated: orientations (n, T, 4), or positions and orientations (n, T, 7)."""
        return np.concatenate((self.tangent.positions[..., : self._n_positions], self.orientations), axis=-1)

    @cached_property
    def angular_velocities(self) -> Array:
        """Angular velocities in the world frame (n, T, 3) [rad/s]."""
        return self._of_each(lambda _, p, rate: angular_velocity(p, rate), 3, 2)

    @cached_property
    def angular_accelerations(self) -> Array:
        """Angular accelerations in the world frame (n, T, 3) [rad/s^2]."""
        return self._of_each(lambda _, p, rate, bend: angular_acceleration(p, rate, bend), 3, 3)

    @property
    def velocities(self) -> Array:
        """Angular velocities (n, T, 3), for poses after the linear ones (n, T, 6), in the world frame."""
        return np.concatenate((self.tangent.velocities[..., : self._n_positions], self.angular_velocities), axis=-1)

    @property
    def accelerations(self) -> Array:
        """Angular accelerations (n, T, 3), for poses after the linear ones (n, T, 6), in the world frame."""
        linear = self.tangent.accelerations[..., : self._n_positions]
        return np.concatenate((linear, self.angular_accelerations), axis=-1)

    def least_duration(self, velocity: ArrayLike | None = None, acceleration: ArrayLike | None = None) -> Array:
        """The least duration of each movement (n,) [s] within limits; see `Rollout.least_duration`.

        Parameters
        ----------
        velocity, acceleration : float or array_like of shape (d,), optional
            Largest absolute value, in the columns of `velocities`: angular ones after the linear ones.

        Raises
        ------
        SpecificationError
            As of `Rollout.least_duration`.
        """
        tangent = self.tangent
        finely = (
            tangent.end * tangent.primitives.dmp.n_basis,
            lambda movements, n: replace(movements, tangent=replace(movements.tangent, n_samples=n)),
        )
        return least_durations(self, tangent.durations, finely, tangent.fixed_velocity, (velocity, acceleration))

    @property
    def axis_names(self) -> list[str]:
        """Names of the columns of `positions`: as recorded, else x, y, z and qw, qx, qy, qz."""
        about = self._to_recording
        return list(about.column_names) if about else [*"xyz"[: self._n_positions], "qw", "qx", "qy", "qz"]

    @property
    def rate_names(self) -> list[str]:
        """Names of the columns of `velocities` and `accelerations`: as recorded, else x, y, z, q.rx, ..."""
        about = self._to_recording
        return list(about.rate_names) if about else [*"xyz"[: self._n_positions], "q.rx", "q.ry", "q.rz"]

    @property
    def channels(self) -> Channels | None:
        """Channels of the recordings, where they are known; see `Demonstrations.channels`."""
        return None if self.recorded_as is None else self.recorded_as.channels

    @property
    def _column_channels(self) -> Channels | None:
        if self.references.shape[1] != 4:
            return None
        *positions, w, x, y, z = self.axis_names
        return (
            *(Channel(name, "position", (name,)) for name in positions),
            Channel("q", "orientation", (w, x, y, z), None, "wxyz"),
        )

    @property
    def _to_recording(self) -> RecordedAs | None:
        return self.recorded_as if self.recorded_as is not None and self.recorded_as.has_steps else None

    @property
    def _shares(self) -> Array:
        return self.tangent._shares

    @property
    def _n_positions(self) -> int:
        return self.tangent.starts.shape[1] - 3 * (self.references.shape[1] // 4)

    @property
    def _batch(self) -> Batch:
        return self.tangent.primitives

    def _take(self, chosen: NDArray[np.intp]) -> PoseRollout:
        shared = len(self._batch) == 1 or self.recorded_as is None
        about = self.recorded_as if shared or self.recorded_as is None else self.recorded_as.take(chosen)
        return PoseRollout(self.tangent[chosen], self.references[chosen], about)

    def _of_each(self, function: Callable[..., Array], size: int, orders: int) -> Array:
        """A function of the reference and the first derivatives of each rotation vector: (n, T, size times k)."""
        motion = [getattr(self.tangent, name) for name in ("positions", "velocities", "accelerations")[:orders]]
        results = []
        for i in range(self.references.shape[1] // 4):
            at = self._n_positions + 3 * i
            vectors = (rows[..., at : at + 3] for rows in motion)
            results.append(self._by_tiles(function, size, self.references[:, None, 4 * i : 4 * i + 4], *vectors))
        return results[0] if len(results) == 1 else np.concatenate(results, axis=-1)

    def _by_tiles(self, function: Callable[..., Array], size: int, *arrays: Array) -> Array:
        """Apply an elementwise function to movements, tile by tile in a core's cache; result (n, T, size)."""
        n_samples = self.tangent.n_samples
        result = np.empty((size, len(self), n_samples)).transpose(1, 2, 0)

        def tile(start: int, stop: int) -> None:
            result[start:stop] = function(*(array[start:stop] for array in arrays))

        for_tiles(tile, len(self), max(1, _TILE_SAMPLES // n_samples))
        return result
