"""The arc-length phase: the share of its path that a movement has covered, independent of its timing."""

from __future__ import annotations

import numpy as np

from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.validation import Array

_OPERATIONS_PER_SAMPLE = 5
_TIME_SHARE = 1e-3  # of the phase; keeps it increasing through pauses


def arc_length_phase(paths: Array, share: float = 1.0) -> Array:
    """Phase in [0, 1] of evenly sampled paths, as a blend of arc length and time.

    ``phase = a s / s_total + (1 - a) t / tau`` with s the length of the polygon through the samples and
    ``a = 0.999 share``: the thousandth of time keeps the phase strictly increasing where the movement pauses.

    Parameters
    ----------
    paths : ndarray of shape (n, d, T)
        Smooth the paths first: noise adds length, and at 3 % of the extent it is longer than the movement itself.
    share : float, default 1.0
        Weight of the arc length: 1 is arc length, 0 is time.

    Returns
    -------
    ndarray of shape (n, T)
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
