"""Options of poses as positions and rotation vectors: starts and goals, rates, via points, limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kineme.dmp.discrete.modulate import Measured, path_at
from kineme.dmp.discrete.position_limits import as_limits
from kineme.dmp.discrete.rollout import Rollout
from kineme.dmp.discrete.via_points import ViaLike, ViaPoints, broadcast_length, per_movement, via_points
from kineme.dmp.pose.rates import rotation_vector_rate
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.rotations import conjugate, log, nearest, normalized, product
from kineme.validation import Array

_RADIAN = 1.0  # an orientation within it is no mistake of unit or frame, however little the movement turns
_ROUNDING = 1e-9  # of the largest position: so far is no way


def checked_poses(option: ArrayLike | None, name: str, n_positions: int, n_columns: int) -> Array | None:
    """Poses (1 or n, n_columns) with quaternions of norm 1.

    Raises `TrajectoryError`: another shape; a quaternion that is none.
    """
    poses = per_movement(option, name, n_columns)
    if poses is None:
        return None
    try:
        turned = [normalized(poses[:, at : at + 4]) for at in range(n_positions, n_columns, 4)]
        return np.concatenate((poses[:, :n_positions], *turned), axis=1)
    except TrajectoryError as error:
        raise TrajectoryError(f"{name}: {error}") from error


def rates_in_tangent(velocity: ArrayLike | None, places: Array, n_positions: int, name: str) -> Array | None:
    """Rates (n, p + 3 k) of positions and rotation vectors at places of this shape, of linear and angular velocities.

    Raises `TrajectoryError`: another shape, or another number of movements.
    """
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
    """Via points (d,) of poses in the coordinates of a tangent movement: each orientation the vector nearest its path.

    `movement`: in positions and rotation vectors; `references` (1 or n, 4 k): the orientations that the rotation
    vectors refer to; `via` as in `PosePrimitives.rollout`. Raises `SpecificationError` or `TrajectoryError`: as
    `via_points`; quaternions that are none, or of which some numbers are free.
    """
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
    """Limits (low, high) of the positions as those of all coordinates, of which rotation vectors have none.

    Raises `SpecificationError`: limits of orientations alone; limits that are no two numbers, or (p,) of p positions;
    low not below high.
    """
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
