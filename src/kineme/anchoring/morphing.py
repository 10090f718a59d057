"""The movement that lies between two others."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.styles.parameters import check_primitives, from_numbers, to_numbers
from kineme.errors import SpecificationError, TrajectoryError
from kineme.similarity.alignment import Maps, maps_onto, paths_of
from kineme.similarity.specification import Compares
from kineme.validation import Array


def morph(a: Primitives, b: Primitives, shares: ArrayLike, like: Compares | None = None) -> Primitives:
    """Movements on the way from `a` to `b`, one for each share of the way: 0 is a, 1 is b.

    b is laid onto a, and ``theta = (1 - s) theta_a + s theta_b`` is the mean of their paths at equal phase (see
    `kineme.dmp.styles.parameters`); then position, size (geometrically) and direction (about one axis) go the
    same share of the way back to b's own. So no movement shrinks half way because the two face different ways, as a
    plain mean of paths does.

    Parameters
    ----------
    a, b : Primitives
        Batches of one with the same specification: two prototypes, say.
    shares : array_like of shape (m,)
        From 0 to 1.
    like : Recognizer, Comparison or ComparisonSpecification, optional
        Whose invariances to take.

    Raises
    ------
    TrajectoryError
        Not one primitive each, or of different dimensions.
    SpecificationError
        Different specifications, or shares that are not between 0 and 1.
    """
    _check_pair(a, b)
    s = np.atleast_1d(np.asarray(shares, dtype=np.float64))
    if s.ndim != 1 or not ((s >= 0) & (s <= 1)).all():
        raise SpecificationError(f"expected shares of the way from 0 to 1, got {shares!r}")
    paths = np.concatenate((paths_of(a), paths_of(b)))
    back = maps_onto(paths[:1], paths[1], like)  # from a's frame to b's
    theta_a, theta_b = to_numbers(a)[0], to_numbers(b)[0]
    inverse = np.linalg.inv(back.matrices[0])
    laid = inverse @ theta_b
    laid[:, -3:-1] -= (inverse @ back.shifts[0])[:, None]
    theta = theta_a + s[:, None, None] * (laid - theta_a)
    part = _part_way(back, paths[0].mean(axis=1), s)
    theta = part.matrices @ theta
    theta[:, :, -3:-1] += part.shifts[:, :, None]
    durations = a.durations * (b.durations / a.durations) ** s
    return from_numbers(a.dmp, theta, durations)


def _check_pair(a: Primitives, b: Primitives) -> None:
    for symbol in (a, b):
        check_primitives(symbol)
        if len(symbol) != 1:
            raise TrajectoryError(f"expected one primitive at each end, got {len(symbol)}; choose one, primitives[0]")
    if a.n_dims != b.n_dims:
        raise TrajectoryError(f"expected primitives of the same dimensions, got {a.n_dims} and {b.n_dims}")
    if a.dmp != b.dmp:
        raise SpecificationError(f"expected primitives of one specification, got {a.dmp} and {b.dmp}; learn them again")


def _part_way(maps: Maps, center: Array, s: Array) -> Maps:
    """The share s (m,) of one map, about a center (d,) that moves evenly to where the map takes it."""
    R = _part_rotation(maps.rotations[0], s)
    scales = maps.scales[0] ** s[:, None]
    matrices = scales[:, :, None] * R if np.ptp(maps.scales[0]) == 0 else _part_matrix(maps, s)
    there = maps.matrices[0] @ center + maps.shifts[0]
    shifts = center + s[:, None] * (there - center) - matrices @ center
    return Maps(matrices, shifts, R, scales)


def _part_matrix(maps: Maps, s: Array) -> Array:
    """Sizes per dimension: the matrix goes evenly, since it is no rotation and one size."""
    d = maps.matrices.shape[1]
    return np.eye(d) + s[:, None, None] * (maps.matrices[0] - np.eye(d))


def _part_rotation(R: Array, s: Array) -> Array:
    """Rotations by the share s (m,) of the angle of R, about the same axis."""
    d = len(R)
    if d == 2:
        angle = s * np.arctan2(R[1, 0], R[0, 0])
        c, sn = np.cos(angle), np.sin(angle)
        return np.stack((np.stack((c, -sn), -1), np.stack((sn, c), -1)), -2)
    if d == 3:
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_rotvec(s[:, None] * Rotation.from_matrix(np.array(R)).as_rotvec()).as_matrix())
    return np.broadcast_to(np.eye(d), (len(s), d, d)).copy()
