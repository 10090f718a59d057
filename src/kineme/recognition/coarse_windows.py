"""Windows in the order of a coarse distance to the demonstrations, at a fiftieth of the price of a full one.

A window and a demonstration are described by few points along their path, and compared after the same normalization and
the same rotations as in full. Nearly all windows that are near in full are among the first few by this distance.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.kernels.procrustes import Prepared
from kineme.movements.preparation.resample import Resample
from kineme.movements.segmentation.table import Motion, Rows, observe
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.runtime.parallel import single_threaded_blas
from kineme.sampling import evenly_spaced
from kineme.similarity.comparison import Comparison, References
from kineme.validation import Array

_N_POINTS = 16  # of a window
_OF_EACH = 4  # demonstrations of a class, evenly spaced
_PRIOR = 4.0  # demonstrations that the common scale counts for beside those of the class
_ALONE = 0.3  # scale of classes of one demonstration each, in distances to the nearest other one
_AT_ONCE = 4096  # windows that are described at a time


class CoarseReferences(NamedTuple):
    """Some demonstrations of each of C classes, by few points of each."""

    rows: Prepared
    first: NDArray[np.intp]  # (C,), index of the first demonstration of each class
    scales: Array  # (C,), typical distance to the nearest other demonstration of the class


def coarse_references(comparison: Comparison, references: References, resolution: float) -> CoarseReferences:
    """Describe some demonstrations of each class; kept with the references.

    `resolution`: as for `observe`, that of the windows that will be compared.
    """
    coarse: CoarseReferences | None = vars(references).get("_coarse")
    if coarse is None:
        chosen = [own.start + evenly_spaced(own.stop - own.start, _OF_EACH) for own in references.slices()]
        movements = references.all_movements()[np.concatenate(chosen)]
        even = Demonstrations.of_movements(Resample(_N_POINTS).apply(movements))
        motions = [  # too few samples do not tell noise from motion
            observe(movement if len(movement) >= _N_POINTS else even[i], resolution)
            for i, movement in enumerate(movements)
        ]
        rows = [_coarse_rows(comparison, motion, np.array([[0, len(motion.times) - 1]])) for motion in motions]
        prepared, counts = comparison.procrustes.prepare(np.concatenate(rows)), np.array([len(some) for some in chosen])
        first = np.cumsum(counts) - counts
        coarse = CoarseReferences(prepared, first, _scales(comparison, prepared, counts))
        vars(references)["_coarse"] = coarse
    return coarse


def _scales(comparison: Comparison, prepared: Prepared, counts: NDArray[np.intp]) -> Array:
    """Return mean distances (C,) to the nearest other demonstration of the class, shrunk towards their common mean."""
    distances = np.sqrt(comparison.procrustes.squared_distances(prepared, prepared))
    labels = np.repeat(np.arange(len(counts)), counts)
    same = labels[:, None] == labels
    others = np.where(same, np.inf, distances).min(axis=1)
    np.fill_diagonal(distances, np.inf)
    nearest = np.where(same, distances, np.inf).min(axis=1)
    nearest = np.where(np.isfinite(nearest), nearest, _ALONE * others)
    nearest = np.where(np.isfinite(nearest), nearest, 1.0)  # of the only one
    sums = np.bincount(labels, nearest)
    scales = (sums + _PRIOR * nearest.mean()) / (counts + _PRIOR)
    return np.asarray(np.where(scales > 0, scales, 1.0))


def coarse_distances(comparison: Comparison, coarse: CoarseReferences, motion: Motion, rows: Rows) -> Array:
    """Return distances (n, C) of the windows from sample rows[:, 0] to rows[:, 1] to each class, over its scale."""
    distances = np.empty((len(rows), len(coarse.first)))
    with single_threaded_blas():
        for begin in range(0, len(rows), _AT_ONCE):
            tile = slice(begin, begin + _AT_ONCE)
            prepared = comparison.procrustes.prepare(_coarse_rows(comparison, motion, rows[tile]))
            squares = comparison.procrustes.squared_distances(prepared, coarse.rows)
            distances[tile] = np.minimum.reduceat(squares, coarse.first, axis=1)
    return np.asarray(np.sqrt(distances) / coarse.scales)


def _coarse_rows(comparison: Comparison, motion: Motion, rows: Rows) -> NDArray[Any]:
    """Return normalized paths at even values of the phase, rows (n, d * S): arc length, or time if that is compared."""
    x = motion.positions
    by_time = x.shape[1] == 1 or all(item.arc_share == 0 for item in comparison.representations)
    steps = np.diff(motion.times) if by_time else np.linalg.norm(np.diff(x, axis=0), axis=1)
    phase = np.append(0.0, np.cumsum(steps))
    start, end = phase[rows].T[:, :, None]
    at = np.interp(start + (end - start) * np.linspace(0.0, 1.0, _N_POINTS), phase, np.arange(len(x)))
    below = np.minimum(at.astype(np.intp), len(x) - 2)
    weight = (at - below)[:, :, None]
    paths = np.ascontiguousarray((x[below] * (1.0 - weight) + x[below + 1] * weight).transpose(0, 2, 1))
    normalized = comparison.normalization.apply(paths, np.float32)
    return np.asarray(normalized.reshape(len(rows), -1))
