"""Movements laid onto one of them: place, size and direction, as far as the recognizer takes them out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kineme.comparison.describe import N_POINTS
from kineme.comparison.normalization import Normalization
from kineme.comparison.representation import Representation
from kineme.kernels.procrustes import Procrustes
from kineme.movements.preparation.preprocess import preprocess
from kineme.movements.preparation.resample import relative_rows
from kineme.movements.preparation.smooth import Smooth
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.primitives.discrete.primitives import Primitives
from kineme.primitives.styles.parameters import from_numbers, shared_label, to_numbers
from kineme.recognition.recognizer import Recognizer
from kineme.validation import Array

_LOOK = Representation("positions", arc_share=1.0)  # uneven timing turns nothing


class Maps(NamedTuple):
    """n affine maps ``x -> matrix x + shift``, each ``matrix = scale R``, or ``diag(size) R diag(1 / own size)``."""

    matrices: Array  # (n, d, d)
    shifts: Array  # (n, d)
    rotations: Array  # (n, d, d), R
    scales: Array  # (n, d), size over own size: equal numbers unless sizes are per dimension

    def move(self, paths: Array) -> Array:
        """Paths (n, d, T), each by its map."""
        return np.asarray(self.matrices @ paths + self.shifts[:, :, None])


def maps_onto(paths: Array, onto: Array, like: Recognizer | None = None) -> Maps:
    """From each path (n, d, T) onto the one path (d, T): the best fit over arc length within the invariances.

    Center onto center, size onto size, and the rotation within the recognizer's `max_angle` that brings it closest
    (Procrustes), fitted to positions at even arc lengths. What the recognizer does not take out stays as it is.
    """
    like = like or Recognizer()
    n, d = paths.shape[:2]
    normalization = Normalization(like.translation, like.scale)
    along, target = _LOOK.along(paths), _LOOK.along(onto[None])
    centers, sizes = normalization.center(along), normalization.size(along)
    center, size = normalization.center(target), normalization.size(target)
    rows = ((along - centers) / sizes).reshape(n, -1)
    R = Procrustes(d, like._angle(d)).rotations(((target - center) / size).reshape(1, -1), rows)
    matrices = size * R / sizes.transpose(0, 2, 1)
    shifts = (center - matrices @ centers)[:, :, 0]
    return Maps(matrices, shifts, R, np.broadcast_to((size / sizes)[:, :, 0], (n, d)))


def paths_of(movements: Demonstrations | Primitives, like: Recognizer | None = None) -> Array:
    """Even paths over time (n, d, T) where they were recorded; smoothed as the recognizer does, or rolled out."""
    if isinstance(movements, Primitives):
        return np.ascontiguousarray(movements.rollout(n_samples=N_POINTS).positions.transpose(0, 2, 1))
    cutoff = (like or Recognizer()).cutoff
    if cutoff is not None and movements.lengths.min() > 4:
        movements = preprocess(movements, [Smooth(cutoff)])
    starts = movements.positions[movements.offsets[:-1]][:, :, None]
    return relative_rows(movements, 0, len(movements), N_POINTS) + starts


def moved(primitives: Primitives, maps: Maps) -> Primitives:
    """Primitives whose paths are those of the given ones, mapped; exact, nothing is learned again.

    A path is linear in theta = [W, x0, g, tau v0], and the coefficients of x0 and g sum to 1 at every phase, so
    ``x -> M x + b`` is ``theta -> M theta``, with b added to x0 and to g.
    """
    theta = maps.matrices @ to_numbers(primitives)
    theta[:, :, -3:-1] += maps.shifts[:, :, None]
    return from_numbers(primitives.dmp, theta, primitives.durations, shared_label(primitives))
