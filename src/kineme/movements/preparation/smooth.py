"""Smooth movements with the cubic smoothing spline, and interpolate them on an even grid by cubic splines.

The interpolating spline is not-a-knot: twice continuously differentiable, as the second derivative in the fit requires.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import Movements
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.runtime.parallel import for_tiles
from kineme.validation import Array, check_number

_SPLINE_OPERATIONS = 100  # elementary operations that SciPy's spline costs per sample and dimension
_LONGEST = 20_000  # samples; the compiled splines need two kilobytes for each

_FAR = 1e200  # gap between movements, so large that they do not influence each other

_OPERATIONS_PER_SAMPLE = 40  # elementary operations that the banded system costs per sample and dimension
_TILE_MOVEMENTS = 256
_CUTOFFS = 1e-9, 1e9  # cycles per movement, smallest and largest: the fourth powers are far from overflow


@dataclass(frozen=True)
class Smooth:
    """Replace each movement by its cubic smoothing spline, at its own time stamps.

    The spline g minimizes ``sum_j (x_j - g(u_j))^2 + lam * integral g''(u)^2 du`` in normalized time
    ``u = (t - t0) / tau``. On even samples h apart that is the low-pass filter ``1 / (1 + (nu / cutoff)^4)``, with
    ``lam = 1 / (h (2 pi cutoff)^4)``: zero phase, flat at low frequency, unbiased at both ends.

    Parameters
    ----------
    cutoff : float, default 20.0
        Frequency nu that is halved, in cycles per movement: ``cutoff / duration`` in hertz. Measured per
        movement, so that the same gesture, done faster, comes out the same.

    References
    ----------
    C. H. Reinsch, "Smoothing by spline functions", Numerische Mathematik 10, 1967.
    """

    cutoff: float = 20.0

    def __post_init__(self) -> None:
        check_number("cutoff", self.cutoff, above=0.0, smallest=_CUTOFFS[0], most=_CUTOFFS[1])

    def apply(self, demonstrations: Demonstrations) -> Movements:
        """The movements, smoothed."""
        smoothed = np.empty_like(demonstrations.positions)

        def smooth_tile(start: int, stop: int) -> None:
            offsets, scales = _tile(demonstrations, start, stop, self.cutoff)
            times, positions = demonstrations.movements.spread, demonstrations.positions
            if _compiled(demonstrations, offsets):
                splines = compiled_module("kineme.movements.preparation._splines")
                splines.fill_smoothed(times, positions, offsets, scales, smoothed)
                return
            starts = np.repeat(positions[offsets[:-1]], np.diff(offsets), axis=0)
            smoothed[offsets[0] : offsets[-1]] = smoothing_spline(times, positions, offsets, scales)[0] + starts

        for_tiles(smooth_tile, len(demonstrations), _TILE_MOVEMENTS)
        return replace(demonstrations.movements.positions_only, positions=smoothed)


def smooth_rows(demonstrations: Demonstrations, start: int, stop: int, cutoff: float, n_points: int) -> Array:
    """Smoothing splines of movements start:stop, see `Smooth`, at `n_points` even times: (stop - start, d, n_points).

    These splines themselves are evaluated; `Smooth` followed by `Resample` would fit others through their values. The
    first recorded position is subtracted, so that a large offset costs no digits.
    """
    offsets, scales = _tile(demonstrations, start, stop, cutoff)
    times, positions = demonstrations.movements.spread, demonstrations.positions
    if not _compiled(demonstrations, offsets):
        first, lengths = offsets[0], np.diff(offsets)
        smoothed, m = smoothing_spline(times, positions, offsets, scales)
        elapsed = times[first : offsets[-1]] - np.repeat(times[offsets[:-1]], lengths)
        return even_rows_of_spline(elapsed * np.repeat(scales, lengths), smoothed, m, offsets - first, n_points)
    rows = np.empty((stop - start, demonstrations.n_dims, n_points))
    compiled_module("kineme.movements.preparation._splines").fill_smooth_rows(times, positions, offsets, scales, rows)
    return rows


def _compiled(demonstrations: Demonstrations, offsets: NDArray[np.intp]) -> bool:
    """Tell whether to run compiled, decided for all movements together although they are smoothed in tiles."""
    total, now = demonstrations.positions.size, demonstrations.n_dims * int(offsets[-1] - offsets[0])
    return fits_lanes(demonstrations.offsets) and use_compiled(
        _OPERATIONS_PER_SAMPLE * total, _OPERATIONS_PER_SAMPLE * now
    )


def _tile(demonstrations: Demonstrations, start: int, stop: int, cutoff: float) -> tuple[NDArray[np.intp], Array]:
    """Offsets of movements start:stop, and the factor on their times that makes the penalty 1."""
    offsets = demonstrations.offsets[start : stop + 1]
    penalties = (np.diff(offsets) - 1) / (2.0 * np.pi * cutoff) ** 4
    return offsets, 1.0 / (np.cbrt(penalties) * demonstrations.durations[start:stop])


def smoothing_spline(times: Array, positions: Array, offsets: NDArray[np.intp], scales: Array) -> tuple[Array, Array]:
    """Smoothed positions minus the first recorded one, and second derivatives, of all movements.

    In the time ``v = scale t`` in which the penalty is 1, `scales` (n,) being ``penalty ** (-1/3)``: with Q the second
    divided differences and R the Gram matrix of hat functions, both banded, the second derivatives m of the spline
    solve ``(R + Q'Q) m = Q'x``, and the smoothed positions are ``x - Q m``. Source: Reinsch, see `Smooth`.
    """
    from scipy.linalg import solve_banded

    lengths = np.diff(offsets)
    first, last = offsets[0], offsets[-1]
    x = positions[first:last] - np.repeat(positions[offsets[:-1]], lengths, axis=0)
    moving = np.repeat(np.logical_or.reduceat(x != 0, offsets[:-1] - first, axis=0), lengths, axis=0)
    gaps = np.diff(times[first:last]) * np.repeat(scales, lengths)[:-1]
    gaps[offsets[1:-1] - first - 1] = _FAR
    inverse = 1.0 / gaps
    a, b = inverse[:-1], inverse[1:]
    bands = np.zeros((5, len(x) - 2))  # of the inner knots
    bands[2] = (gaps[:-1] + gaps[1:]) / 3.0 + a * a + b * b + (a + b) ** 2
    bands[1, 1:] = gaps[1:-1] / 6.0 - b[:-1] * (a[:-1] + 2.0 * b[:-1] + b[1:])
    bands[0, 2:] = inverse[1:-2] * inverse[2:-1]
    bands[3, :-1], bands[4, :-2] = bands[1, 1:], bands[0, 2:]
    m = np.zeros_like(x)
    slopes = np.diff(x, axis=0) * inverse[:, None]
    # LU, not Cholesky: with nearly equal stamps the rounded matrix may not be positive definite.
    m[1:-1] = solve_banded((2, 2), bands, np.diff(slopes, axis=0), overwrite_ab=True, check_finite=False)
    bends = np.diff(m, axis=0) * inverse[:, None]
    x[:-1] -= bends
    x[1:] += bends
    # What reaches a movement that does not move from those beside it is tiny, and would yet be all of its size.
    return np.where(moving, x, 0.0), np.where(moving, m, 0.0)


def even_rows_of_spline(v: Array, x: Array, m: Array, offsets: NDArray[np.intp], n_points: int) -> Array:
    """Cubics with values x and second derivatives m at the knots v, each from 0, at even v: rows (n, d, n_points)."""
    n, lengths = len(offsets) - 1, np.diff(offsets)
    span = v[offsets[1:] - 1]
    # One increasing parameter for all movements, so that one search finds the knots without a Python loop.
    shift = 2.0 * np.arange(n)
    knots = v / np.repeat(span, lengths) + np.repeat(shift, lengths)
    even = np.linspace(0.0, 1.0, n_points)
    left = np.searchsorted(knots, even + shift[:, None], side="right") - 1
    left = np.minimum(left, offsets[1:, None] - 2)
    gap = v[left + 1] - v[left]
    s = (even * span[:, None] - v[left]) / gap
    r, sixth = 1.0 - s, gap**2 / 6.0
    weights = r, s, sixth * (r**3 - r), sixth * (s**3 - s)
    values = (x[left], x[left + 1], m[left], m[left + 1])
    rows = np.sum([w[:, :, None] * value for w, value in zip(weights, values, strict=True)], axis=0)
    return np.ascontiguousarray(rows.transpose(0, 2, 1))


@lru_cache(maxsize=64)
def spline_matrix(n_in: int, n_out: int) -> Array:
    """The linear map (n_out, n_in) between even samples: ``C B^-1``, of B-spline values B at the ones, C at others."""
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
    """Interpolate movements on `n_points` even values of their parameter, relative to their start, (n, d, n_points).

    The parameter (total,) increases within each movement: time, or arc length.
    """
    n, n_dims = len(offsets) - 1, positions.shape[1]
    rows = np.empty((n, n_dims, n_points))
    # Decided for the whole block, although callers pass one tile at a time.
    total, now = (_SPLINE_OPERATIONS * n_dims * n_samples for n_samples in (len(positions), offsets[-1] - offsets[0]))
    if fits_lanes(offsets) and use_compiled(total, now):
        compiled_module("kineme.movements.preparation._splines").fill_spline_rows(parameter, positions, offsets, rows)
    else:
        # The plain twin of the compiled loop: SciPy's spline, movement by movement.
        from scipy.interpolate import CubicSpline

        for i in range(len(rows)):
            movement = slice(offsets[i], offsets[i + 1])
            u = parameter[movement]
            spline = CubicSpline(u - u[0], positions[movement] - positions[offsets[i]])
            rows[i] = spline(np.linspace(0.0, u[-1] - u[0], rows.shape[2])).T
    return rows


def fits_lanes(offsets: NDArray[np.intp]) -> bool:
    """Tell whether all movements are short enough for the compiled splines, which need much memory per sample."""
    return bool(np.diff(offsets).max() <= _LONGEST)
