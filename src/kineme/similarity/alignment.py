"""Maps from one movement onto another: translation, size and rotation, as far as the comparison takes them out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.styles.parameters import from_numbers, shared_label, to_numbers
from kineme.kernels.procrustes import Procrustes
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.similarity.describe import N_POINTS, even_paths, recorded_paths
from kineme.similarity.representation import POSITIONS, Normalization
from kineme.similarity.specification import Compares, specification_of
from kineme.validation import Array


class Maps(NamedTuple):
    """n affine maps ``x -> matrix x + shift``, each ``matrix = scale R``, or ``diag(size) R diag(1 / own size)``."""

    matrices: Array  # (n, d, d)
    shifts: Array  # (n, d)
    rotations: Array  # (n, d, d), R
    scales: Array  # (n, d), size over own size: equal numbers unless sizes are per dimension

    def move(self, paths: Array) -> Array:
        """Return paths (n, d, T), each by its map."""
        return np.asarray(self.matrices @ paths + self.shifts[:, :, None])


def fit_maps(paths: Array, targets: Array, normalization: Normalization, procrustes: Procrustes) -> Maps:
    """Return maps of each path (n, d, S) onto the target of the same index (n, d, S), or onto the only one (1, d, S).

    Center onto center, size onto size, and the rotation within the limit that brings samples closest (Procrustes).
    Translation and size are mapped only if the normalization removes them.
    """
    n, d = paths.shape[:2]
    centers, sizes = normalization.center(paths), normalization.size(paths)
    center, size = normalization.center(targets), normalization.size(targets)
    rows = ((paths - centers) / sizes).reshape(n, -1)
    R = procrustes.rotations(((targets - center) / size).reshape(len(targets), -1), rows)
    matrices = size * R / sizes.transpose(0, 2, 1)
    shifts = (center - matrices @ centers)[:, :, 0]
    return Maps(matrices, shifts, R, np.broadcast_to((size / sizes)[:, :, 0], (n, d)))


def maps_onto(paths: Array, onto: Array, like: Compares | None = None) -> Maps:
    """Return maps of each path (n, d, T) onto one path (d, T): the best fit over arc length within the invariances.

    See `fit_maps`; it is fitted to positions at even arc lengths.
    """
    how = specification_of(like)
    along, target = POSITIONS.along(paths), POSITIONS.along(onto[None])
    return fit_maps(along, target, how.normalization, how.procrustes(paths.shape[1]))


def paths_of(movements: Demonstrations | Primitives, like: Compares | None = None) -> Array:
    """Return paths at even times (n, d, T) in recorded coordinates; smoothed as for comparison, or rolled out."""
    if isinstance(movements, Primitives):
        return np.ascontiguousarray(movements.rollout(n_samples=N_POINTS).positions.transpose(0, 2, 1))
    return recorded_paths(movements, even_paths(movements, 0, len(movements), specification_of(like).cutoff))


def moved(primitives: Primitives, maps: Maps) -> Primitives:
    """Return primitives whose paths are the mapped paths of the given ones; exact, without learning again.

    A path is linear in theta = [W, x0, g, tau v0], and the coefficients of x0 and g sum to 1 at every phase, so
    ``x -> M x + b`` is ``theta -> M theta``, with b added to x0 and to g.
    """
    theta = maps.matrices @ to_numbers(primitives)
    theta[:, :, -3:-1] += maps.shifts[:, :, None]
    return from_numbers(primitives.dmp, theta, primitives.durations, shared_label(primitives))
