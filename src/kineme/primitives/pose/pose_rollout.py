"""Generated orientations and poses with their velocities and accelerations in the world frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from kineme.movements.channels.channel import Channel, Channels
from kineme.movements.rotations.quaternions import product
from kineme.movements.rotations.rotation_vectors import exp
from kineme.primitives.base_rollout import BaseRollout
from kineme.primitives.batch import Batch
from kineme.primitives.discrete.rollout import Rollout
from kineme.primitives.pose.rates import angular_acceleration, angular_velocity
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
    references : ndarray of shape (n, 4)
        Goal orientations, from which the rotation vectors count.
    """

    tangent: Rollout
    references: Array

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
        """Unit quaternions (n, T, 4)."""
        return self._by_tiles(lambda p, r: product(exp(p), r), 4, self._vectors(0), self.references[:, None])

    @property
    def poses(self) -> Array:
        """The same as `positions`."""
        return self.positions

    @property
    def positions(self) -> Array:
        """What was demonstrated: orientations (n, T, 4), or positions and orientations (n, T, 7)."""
        return np.concatenate((self.tangent.positions[..., :-3], self.orientations), axis=-1)

    @cached_property
    def angular_velocities(self) -> Array:
        """Angular velocities in the world frame (n, T, 3) [rad/s]."""
        return self._by_tiles(angular_velocity, 3, self._vectors(0), self._vectors(1))

    @cached_property
    def angular_accelerations(self) -> Array:
        """Angular accelerations in the world frame (n, T, 3) [rad/s^2]."""
        return self._by_tiles(angular_acceleration, 3, self._vectors(0), self._vectors(1), self._vectors(2))

    @property
    def velocities(self) -> Array:
        """Angular velocities (n, T, 3), for poses after the linear ones (n, T, 6), in the world frame."""
        return np.concatenate((self.tangent.velocities[..., :-3], self.angular_velocities), axis=-1)

    @property
    def accelerations(self) -> Array:
        """Angular accelerations (n, T, 3), for poses after the linear ones (n, T, 6), in the world frame."""
        return np.concatenate((self.tangent.accelerations[..., :-3], self.angular_accelerations), axis=-1)

    @property
    def axis_names(self) -> list[str]:
        """What the columns of `positions` are called: x, y, z and qw, qx, qy, qz."""
        return [*"xyz"[: self.tangent.starts.shape[1] - 3], "qw", "qx", "qy", "qz"]

    @property
    def channels(self) -> Channels:
        """What the columns of `positions` are: positions, and an orientation (w, x, y, z)."""
        *positions, w, x, y, z = self.axis_names
        return (
            *(Channel(name, "position", (name,)) for name in positions),
            Channel("q", "orientation", (w, x, y, z), None, "wxyz"),
        )

    @property
    def rate_names(self) -> list[str]:
        """What the columns of `velocities` and `accelerations` are called: x, y, z and q.rx, q.ry, q.rz."""
        return [*"xyz"[: self.tangent.starts.shape[1] - 3], "q.rx", "q.ry", "q.rz"]

    @property
    def _batch(self) -> Batch:
        return self.tangent.primitives

    def _take(self, chosen: NDArray[np.intp]) -> PoseRollout:
        return PoseRollout(self.tangent[chosen], self.references[chosen])

    def _vectors(self, order: int) -> Array:
        """The rotation vectors (n, T, 3), or their first or second derivative in time."""
        return (self.tangent.positions, self.tangent.velocities, self.tangent.accelerations)[order][..., -3:]

    def _by_tiles(self, function: Callable[..., Array], size: int, *arrays: Array) -> Array:
        """Apply an elementwise function to movements, tile by tile in a core's cache; result (n, T, size)."""
        n_samples = self.tangent.n_samples
        result = np.empty((size, len(self), n_samples)).transpose(1, 2, 0)

        def tile(start: int, stop: int) -> None:
            result[start:stop] = function(*(array[start:stop] for array in arrays))

        for_tiles(tile, len(self), max(1, _TILE_SAMPLES // n_samples))
        return result
