"""Generated orientations and poses with their velocities and accelerations in the world frame."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from kineme.dmp.discrete.modulate import Measured, as_limits, path_at
from kineme.dmp.discrete.rollout import BaseRollout, Rollout
from kineme.dmp.discrete.via_points import ViaLike, ViaPoints, broadcast_length, per_movement, via_points
from kineme.dmp.pose.tangent import angular_acceleration, angular_velocity, rotation_vector_rate
from kineme.dmp.recorded_as import RecordedAs
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.channels.channel import Channel, Channels
from kineme.movements.rotations import conjugate, exp, log, nearest, normalized, product
from kineme.runtime.parallel import for_tiles
from kineme.validation import Array

_RADIAN = 1.0  # an orientation within it is no mistake of unit or frame, however little the movement turns
_ROUNDING = 1e-9  # of the largest position: so far is no way

_TILE_SAMPLES = 10_000  # samples in one tile: with its intermediate results it stays in a core's cache


@dataclass(frozen=True, eq=False, repr=False)
class PoseRollout(BaseRollout):
    """n generated movements of T samples; computed when asked for.

    A sequence of `Trajectory`, taken wherever movements are expected; see `BaseRollout`.

    - `tangent`: the movement in positions and rotation vectors.
    - `references` (n, 4): goal orientations, from which the rotation vectors count.
    """

    tangent: Rollout
    references: Array

    def __len__(self) -> int:
        return len(self.tangent)

    @property
    def times(self) -> Array:
        """Times of the samples (n, T) [s]."""
        return self.tangent.times

    @property
    def orientations(self) -> Array:
        """Unit quaternions (n, T, 4); of k orientations (n, T, 4 k), one after the other, as all that follows."""
        return self.positions[..., self._n_positions :]

    @property
    def poses(self) -> Array:
        """The same as `positions`."""
        return self.positions

    @property
    def angular_velocities(self) -> Array:
        """Angular velocities in the world frame (n, T, 3) [rad/s]."""
        return self.velocities[..., self._n_positions :]

    @property
    def angular_accelerations(self) -> Array:
        """Angular accelerations in the world frame (n, T, 3) [rad/s^2]."""
        return self.accelerations[..., self._n_positions :]

    @property
    def recorded_as(self) -> RecordedAs | None:
        """Channels of the recordings, where they are known."""
        return self.primitives.recorded_as

    def least_duration(self, velocity: ArrayLike | None = None, acceleration: ArrayLike | None = None) -> Array:
        """The least duration (n,) [s] as `Rollout.least_duration`, with limits in the columns of `velocities`."""
        tangent = self.tangent
        return self._least(tangent.durations, tangent.end, tangent.fixed_velocity, velocity, acceleration)

    def _with_samples(self, n_samples: int) -> PoseRollout:
        return replace(self, tangent=replace(self.tangent, n_samples=n_samples))

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
    def _shares(self) -> Array:
        return self.tangent._shares

    @property
    def _n_positions(self) -> int:
        return self.tangent.starts.shape[1] - 3 * (self.references.shape[1] // 4)

    def _derivative(self, order: int) -> Array:
        """Tile by tile in a core's cache, elementwise functions of the rotation vectors and their rates."""
        function = (lambda p, reference: product(exp(p), reference), angular_velocity, angular_acceleration)[order]
        motion = [getattr(self.tangent, name) for name in ("positions", "velocities", "accelerations")[: order + 1]]
        m, k, size = self._n_positions, self.references.shape[1] // 4, 3 if order else 4
        n, n_samples, _ = motion[order].shape
        result = np.empty((m + size * k, n, n_samples)).transpose(1, 2, 0)
        result[..., :m] = motion[order][..., :m]

        def tile(start: int, stop: int) -> None:
            for i in range(k):
                vectors = [x[start:stop, :, m + 3 * i : m + 3 * i + 3] for x in motion]
                if not order:
                    vectors.append(self.references[start:stop, None, 4 * i : 4 * i + 4])
                result[start:stop, :, m + size * i : m + size * (i + 1)] = function(*vectors)

        for_tiles(tile, n, max(1, _TILE_SAMPLES // n_samples))
        return result


def checked_poses(option: ArrayLike | None, name: str, n_positions: int, n_columns: int) -> Array | None:
    """Poses (1 or n, n_columns) with quaternions of norm 1."""
    poses = per_movement(option, name, n_columns)
    if poses is None:
        return None
    try:
        turned = [normalized(poses[:, at : at + 4]) for at in range(n_positions, n_columns, 4)]
        return np.concatenate((poses[:, :n_positions], *turned), axis=1)
    except TrajectoryError as error:
        raise TrajectoryError(f"{name}: {error}") from error


def rates_in_tangent(velocity: ArrayLike | None, places: Array, n_positions: int, name: str) -> Array | None:
    """Rates (n, p + 3 k) of positions and rotation vectors at these places, of linear and angular velocities."""
    option = per_movement(velocity, name, places.shape[1])
    if option is None:
        return None
    n, m = broadcast_length(len(places), {name: option}), n_positions
    vectors, turning = (columns[:, m:].reshape(len(columns), -1, 3) for columns in (places, option))
    rates = rotation_vector_rate(vectors, turning).reshape(n, -1)
    return np.concatenate((np.broadcast_to(option[:, :m], (n, m)), rates), axis=1)


def changes_in_tangent(
    movement: Rollout,
    references: Array,
    via: ViaLike | None,
    end_velocity: ArrayLike | None,
    position_limits: tuple[ArrayLike, ArrayLike] | None,
) -> tuple[ViaPoints | None, Array | None, tuple[Array, Array] | None, None, list[Measured]]:
    """Return what `modulated` takes, of what is asked for in poses; `references` (1 or n, 4 k)."""
    n_dims = movement.starts.shape[1]
    n_positions = n_dims - 3 * (references.shape[1] // 4)
    return (
        via_poses(movement, references, via),
        rates_in_tangent(end_velocity, movement.arrivals, n_positions, "end_velocity"),
        limits_of_positions(position_limits, n_positions, n_dims),
        None,
        measured_of(movement, n_positions),
    )


def via_poses(movement: Rollout, references: Array, via: ViaLike | None) -> ViaPoints | None:
    """Via points of poses in the coordinates of a tangent movement: each orientation the vector nearest to its path."""
    if via is None:
        return None
    k = references.shape[1] // 4
    m = movement.starts.shape[1] - 3 * k

    def learned(times: Array, points: Array) -> Array:
        if not len(times):
            return np.zeros((1, 0, m + 3 * k))
        near = path_at(movement, tuple(times.tolist())).transpose(0, 2, 1)  # (n, K, m + 3 k)
        q = points[:, :, m:].reshape(*points.shape[:2], k, 4)
        vectors = _vectors(q, references.reshape(-1, 1, k, 4), near[:, :, m:].reshape(*near.shape[:2], k, 3))
        positions = np.broadcast_to(points[:, :, :m], (len(vectors), *points.shape[1:2], m))
        return np.concatenate((positions, vectors.reshape(*vectors.shape[:2], 3 * k)), axis=2)

    return via_points(via, m + 4 * k, learned)


def _vectors(q: Array, references: Array, near: Array) -> Array:
    """Rotation vectors (n, K, k, 3) of quaternions, each nearest to another vector; NaN where all four are."""
    free = np.isnan(q)
    unset = np.asarray(free.all(axis=3))
    if (free.any(axis=3) & ~unset).any():
        raise TrajectoryError(
            "expected via orientations (w, x, y, z) of four numbers, or NaN in all four where one is free, got some NaN"
        )
    try:
        turned = normalized(np.where(unset[..., None], [1.0, 0.0, 0.0, 0.0], q))
    except TrajectoryError as error:
        raise TrajectoryError(f"via: {error}") from error
    vectors = nearest(log(product(turned, conjugate(references))), near)
    return np.where(unset[..., None], np.nan, vectors)


def limits_of_positions(
    limits: tuple[ArrayLike, ArrayLike] | None, n_positions: int, n_dims: int
) -> tuple[Array, Array] | None:
    """Limits (low, high) of the positions as those of all coordinates, of which rotation vectors have none."""
    if limits is None:
        return None
    if not n_positions:
        raise SpecificationError(
            "expected position_limits of movements with positions, got orientations alone, which have none"
        )
    low, high = as_limits(limits, n_positions)
    free = np.full(n_dims - n_positions, np.inf)
    return np.append(low, -free), np.append(high, free)


def measured_of(movement: Rollout, n_positions: int) -> list[Measured]:
    """Return the groups in which distances are measured: positions, and each orientation in radians."""
    ends = np.abs(np.concatenate((movement.starts, movement.goals))[:, :n_positions])
    positions = [
        Measured(slice(0, n_positions), "", _ROUNDING * max(float(ends.max(initial=0.0)), np.finfo(float).tiny))
    ]
    turns = [Measured(slice(at, at + 3), " rad", _RADIAN) for at in range(n_positions, movement.starts.shape[1], 3)]
    return (positions if n_positions else []) + turns
