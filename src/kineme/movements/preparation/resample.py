"""Bring every movement to the same number of samples, evenly spaced in the phase.

The arc-length phase is the share of its path that a movement has covered, independent of its timing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kineme.movements.preparation.smooth import spline_matrix, spline_rows
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import Movements
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.validation import MIN_SAMPLES, Array, check_count

_OPERATIONS_PER_SAMPLE = 5
_TIME_SHARE = 1e-3  # of the phase; keeps it increasing through pauses

_MOST = 1_000_000  # samples per movement


@dataclass(frozen=True)
class Resample:
    """Interpolate each movement at even times between its first and last stamp.

    Parameters
    ----------
    n_points : int, default 200
        Samples per movement afterwards, at most a million.

    Notes
    -----
    Cubic splines on the true time stamps, so irregular sampling costs accuracy, not correctness. Samples less than a
    tenth of the usual step apart are averaged first: a spline would magnify the noise between them (see
    `kineme.movements.trajectories.movements`). Resampling far below the recorded rate causes aliasing: `Smooth`
    first.
    """

    n_points: int = 200

    def __post_init__(self) -> None:
        check_count("n_points", self.n_points, MIN_SAMPLES, most=_MOST)

    def apply(self, demonstrations: Demonstrations) -> Movements:
        """The movements, evenly sampled."""
        return along(demonstrations, relative_rows(demonstrations, 0, len(demonstrations), self.n_points))


def along(demonstrations: Demonstrations, rows: Array) -> Movements:
    """The same movements along other, evenly sampled paths (n, d, T) relative to their starts."""
    n, d, n_samples = rows.shape
    first, last = demonstrations.offsets[:-1], demonstrations.offsets[1:] - 1
    starts, times = demonstrations.positions[first], demonstrations.movements.times
    if times is not None:  # without, they begin at 0
        times = np.linspace(times[first], times[last], n_samples, axis=1).ravel() if times[first].any() else None
    return replace(
        demonstrations.movements.positions_only,
        positions=(rows.transpose(0, 2, 1) + starts[:, None]).reshape(-1, d),
        offsets=np.arange(n + 1) * n_samples,
        times=times,
    )


def relative_rows(demonstrations: Demonstrations, start: int, stop: int, n_points: int) -> Array:
    """Movements start:stop at `n_points` even times, minus their start, shape (stop - start, d, n_points)."""
    n_samples = demonstrations.even_length
    if n_samples is None:
        movements = demonstrations.movements.separated
        return spline_rows(movements.stamps, movements.positions, movements.offsets[start : stop + 1], n_points)
    rows = even_rows(demonstrations, start, stop)
    return rows if n_points == n_samples else rows @ spline_matrix(n_samples, n_points).T


def even_rows(demonstrations: Demonstrations, start: int, stop: int) -> Array:
    """Evenly sampled movements start:stop as they are, minus their start, shape (stop - start, d, T)."""
    first, last = demonstrations.offsets[[start, stop]]
    block = demonstrations.positions[first:last].reshape(stop - start, -1, demonstrations.n_dims)
    rows = np.empty((len(block), block.shape[2], block.shape[1]))
    if use_compiled(block.size):
        compiled_module("kineme.movements.trajectories._compiled").fill_even_rows(block, rows)
        return rows
    by_dimension = block.transpose(0, 2, 1)
    return np.subtract(by_dimension, by_dimension[:, :, :1], out=rows)


def extents_of(demonstrations: Demonstrations, start: int, stop: int) -> Array:
    """Largest minus smallest recorded position of movements start:stop in each dimension, shape (stop - start, d)."""
    offsets = demonstrations.offsets[start : stop + 1]
    positions = demonstrations.positions[offsets[0] : offsets[-1]]
    if not use_compiled(positions.size):
        first = offsets[:-1] - offsets[0]
        return np.asarray(np.maximum.reduceat(positions, first) - np.minimum.reduceat(positions, first))
    extents = np.empty((stop - start, demonstrations.n_dims))
    compiled_module("kineme.movements.trajectories._compiled").fill_extents(positions, offsets - offsets[0], extents)
    return extents


def arc_length_phase(paths: Array, share: float = 1.0) -> Array:
    """Phase in [0, 1] of evenly sampled paths (n, d, T), as a blend of arc length and time.

    ``phase = a s / s_total + (1 - a) t / tau`` with s the length of the polygon through the samples and ``a = 0.999
    share``: the thousandth of time keeps the phase strictly increasing where the movement pauses. A share of 1 is arc
    length, 0 is time. Smooth the paths first: noise adds length, and at 3 % of the extent it is longer than the
    movement itself.
    """
    n, _, n_samples = paths.shape
    time = np.linspace(0.0, 1.0, n_samples)
    length = np.zeros((n, n_samples))
    np.cumsum(np.sqrt((np.diff(paths, axis=2) ** 2).sum(axis=1)), axis=1, out=length[:, 1:])
    total = length[:, -1:]
    a = (1.0 - _TIME_SHARE) * share
    with np.errstate(invalid="ignore", divide="ignore"):
        arc = np.where(total > 0, length / total, time)
    return a * arc + (1.0 - a) * time


def resample_by_arc_length(paths: Array, n_points: int, share: float = 1.0) -> Array:
    """Linear interpolation of paths (n, d, T) at `n_points` even values of `arc_length_phase`, (n, d, n_points).

    Linear, because the phase is the length of the polygon through the samples, and a spline through such uneven
    knots can overshoot.
    """
    if use_compiled(_OPERATIONS_PER_SAMPLE * paths.size):
        compiled = compiled_module("kineme.movements.trajectories._compiled")
        rows = np.empty((*paths.shape[:2], n_points))
        compiled.fill_arc_rows(np.ascontiguousarray(paths), (1.0 - _TIME_SHARE) * share, rows)
        return rows
    return resample_by_phase(paths, arc_length_phase(paths, share), n_points)


def resample_by_phase(paths: Array, phase: Array, n_points: int) -> Array:
    """Linear interpolation of paths (n, d, T) at `n_points` even values of any increasing phase (n, T)."""
    n, n_dims, _ = paths.shape
    # One increasing parameter for all movements, so that one call interpolates them without a Python loop.
    shift = 2.0 * np.arange(n)[:, None]
    targets, knots = (np.linspace(0.0, 1.0, n_points) + shift).ravel(), (phase + shift).ravel()
    result = np.empty((n, n_dims, n_points))
    for k in range(n_dims):
        result[:, k] = np.interp(targets, knots, paths[:, k].ravel()).reshape(n, n_points)
    return result
