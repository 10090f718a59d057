"""Beginnings of movements, described independently of position and size."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from kineme.kernels.procrustes import Procrustes
from kineme.kernels.shapes import ElasticSpec, shapes_of
from kineme.movements.preparation.resample import arc_length_phase
from kineme.movements.preparation.smooth import Smooth
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.similarity.describe import N_POINTS, even_paths
from kineme.similarity.described import Described, Pairs
from kineme.similarity.representation import PAIR_QUANTITIES
from kineme.validation import Array

N_PREFIX = ElasticSpec().n_segments + 1  # samples along the arc length of a beginning: the ends of segments
LAST = 0.02  # share of a beginning's time in which the speed at its end is measured
LEAST_SPEED = 0.01  # of the mean speed
#: What beginnings are compared by pair by pair.
_PAIRS = tuple(PAIR_QUANTITIES.index(quantity) for quantity in ("elastic", "cloud"))


class Prefixes(NamedTuple):
    """G beginnings of each of n movements; S samples each, evenly spaced along their own arc length.

    Attributes
    ----------
    positions : ndarray of shape (n * G, d * S)
        Minus their mean, at root mean square distance 1 from it; rows have norm 1.
    timing : ndarray of shape (n * G, S)
        Time at each sample as a share of the beginning's, divided by sqrt(S): squared distances are mean squares.
    sizes, lengths : ndarray of shape (n * G,)
        Root mean square distance from the mean, and length of the path, in the unit of the data.
    elapsed : ndarray of shape (n * G,)
        Time that the beginning takes, as a share of the movement's.
    end_speeds : ndarray of shape (n * G,)
        Logarithm of the speed at the end by the mean speed.
    """

    positions: Array
    timing: Array
    sizes: Array
    lengths: Array
    elapsed: Array
    end_speeds: Array


def smooth_paths(movements: Demonstrations, cutoff: float | None) -> Array:
    """Movements as the recognizer smooths them, minus their start, at even times, shape (n, d, T)."""
    paths = even_paths(movements, 0, len(movements), cutoff)
    return paths - paths[:, :, :1]


@lru_cache(maxsize=8)
def smoother(cutoff: float) -> Array:
    """The smoothing spline on T even samples as a matrix (T, T): it is linear, so it acts on unit vectors."""
    units = Demonstrations.from_arrays([np.eye(N_POINTS)])
    matrix = Smooth(cutoff).apply(units).positions
    matrix.setflags(write=False)
    return matrix


def beginnings(paths: Array, progress: Array) -> Prefixes:
    """Describe the beginnings of smooth, evenly timed paths (n, d, T) until each share (G,) of their arc length.

    The path is compared along its arc length, so that hesitation does not deform it; when the samples were
    reached is kept apart, as `timing`.
    """
    n, d, n_samples = paths.shape
    phase = arc_length_phase(paths)
    shift = 2.0 * np.arange(n)[:, None, None]  # one increasing parameter for all movements
    targets = (progress[:, None] * np.linspace(0.0, 1.0, N_PREFIX) + shift).ravel()
    knots = (phase + shift[:, 0]).ravel()
    shape = (n * len(progress), N_PREFIX)
    along = np.stack([np.interp(targets, knots, paths[:, k].ravel()).reshape(shape) for k in range(d)], axis=1)
    elapsed = np.interp(targets, knots, np.tile(np.linspace(0.0, 1.0, n_samples), n)).reshape(shape)
    chords = np.sqrt((np.diff(along, axis=2) ** 2).sum(axis=1))
    centered = along - along.mean(axis=2, keepdims=True)
    sizes = np.sqrt((centered**2).sum(axis=1).mean(axis=1))
    return Prefixes(
        (centered / (_nonzero(sizes) * np.sqrt(N_PREFIX))[:, None, None]).reshape(len(along), -1),
        elapsed / (_nonzero(elapsed[:, -1:]) * np.sqrt(N_PREFIX)),
        sizes,
        chords.sum(axis=1),
        elapsed[:, -1],
        _end_speeds(phase, elapsed[:, -1].reshape(n, -1), progress),
    )


def _end_speeds(phase: Array, elapsed: Array, progress: Array) -> Array:
    """Logarithms (n * G,) of the speed over the last 2 % of the time by the mean speed of each beginning.

    Of movements with a `phase` (n, T) of arc length, whose beginnings end at `elapsed` (n, G) of their time.
    """
    even = np.linspace(0.0, 1.0, phase.shape[1])
    before = np.stack([np.interp((1.0 - LAST) * ends, even, one) for ends, one in zip(elapsed, phase, strict=True)])
    return np.asarray(np.log(np.maximum((1.0 - before / progress) / LAST, LEAST_SPEED)).ravel())


def describe_prefixes(prefixes: Prefixes, procrustes: Procrustes) -> Described:
    """Beginnings ready for comparison: positions sample by sample, elastic paths and point clouds pair by pair.

    In single precision, which is far finer than any width.
    """
    rows = prefixes.positions
    positions = procrustes.prepare(rows.astype(np.float32))
    shapes = shapes_of(math.sqrt(N_PREFIX) * rows.reshape(len(rows), -1, N_PREFIX))
    return Described((positions,), procrustes, pairs=Pairs(positions, shapes, _PAIRS))


def _nonzero(values: Array) -> Array:
    return np.where(values > 0, values, 1.0)
