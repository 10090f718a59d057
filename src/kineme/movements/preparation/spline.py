"""Interpolation on an even grid by cubic splines, movement by movement or as one matrix.

The spline is the not-a-knot cubic spline of `scipy.interpolate.CubicSpline`: fourth order, exact for
cubics, and twice continuously differentiable, as the second derivative in the fit requires.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.validation import Array

_OPERATIONS_PER_SAMPLE = 100  # elementary operations that SciPy's spline costs per sample and dimension
_LONGEST = 20_000  # samples; the compiled splines need two kilobytes for each


@lru_cache(maxsize=64)
def spline_matrix(n_in: int, n_out: int) -> Array:
    """The linear map (n_out, n_in) from `n_in` even samples to `n_out` even samples.

    With the B-spline values B at the samples and C at the points, the map is ``C B^-1``; solving with the transposed,
    banded B needs no more memory than the result.
    """
    from scipy.interpolate import BSpline
    from scipy.sparse.linalg import splu

    u, v = np.linspace(0.0, 1.0, n_in), np.linspace(0.0, 1.0, n_out)
    if n_in == n_out:
        matrix = np.eye(n_in)
    else:
        knots = np.concatenate((np.zeros(4), u[2:-2], np.ones(4)))  # not-a-knot: none next to the ends
        at_samples, at_points = (BSpline.design_matrix(points, knots, 3) for points in (u, v))
        matrix = np.ascontiguousarray(splu(at_samples.T.tocsc()).solve(at_points.T.toarray()).T)
    matrix.setflags(write=False)
    return matrix


def spline_rows(parameter: Array, positions: Array, offsets: NDArray[np.intp], n_points: int) -> Array:
    """Interpolate movements on `n_points` even values of their parameter, relative to their start.

    Parameters
    ----------
    parameter : ndarray of shape (total,)
        Strictly increasing within each movement: time, or arc length.
    positions : ndarray of shape (total, d)
        Samples of all movements.
    offsets : ndarray of shape (n + 1,)
        Where each movement begins in `parameter` and `positions`.
    n_points : int
        Points per movement.

    Returns
    -------
    ndarray of shape (n, d, n_points)
        Positions minus the first position: a large offset costs no digits.
    """
    n, n_dims = len(offsets) - 1, positions.shape[1]
    rows = np.empty((n, n_dims, n_points))
    # Decided for the whole block, although callers pass one tile at a time.
    whole, now = (
        _OPERATIONS_PER_SAMPLE * n_dims * n_samples for n_samples in (len(positions), offsets[-1] - offsets[0])
    )
    if fits_lanes(offsets) and use_compiled(whole, now):
        compiled_module("kineme.movements.preparation._splines").fill_spline_rows(parameter, positions, offsets, rows)
    else:
        _fill_spline_rows(parameter, positions, offsets, rows)
    return rows


def fits_lanes(offsets: NDArray[np.intp]) -> bool:
    """Whether all movements are short enough for the compiled splines, which need much memory per sample."""
    return bool(np.diff(offsets).max() <= _LONGEST)


def _fill_spline_rows(parameter: Array, positions: Array, offsets: NDArray[np.intp], rows: Array) -> None:
    """The plain twin of the compiled loop: SciPy's spline, movement by movement."""
    from scipy.interpolate import CubicSpline

    for i in range(len(rows)):
        movement = slice(offsets[i], offsets[i + 1])
        u = parameter[movement]
        spline = CubicSpline(u - u[0], positions[movement] - positions[offsets[i]])
        rows[i] = spline(np.linspace(0.0, u[-1] - u[0], rows.shape[2])).T
