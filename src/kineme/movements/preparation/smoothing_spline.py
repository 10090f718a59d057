"""The smoothing splines of many movements as one banded system; the plain twin of the compiled loops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kineme.validation import Array

_FAR = 1e200  # gap between movements, so large that they do not influence each other


def smoothing_spline(times: Array, positions: Array, offsets: NDArray[np.intp], scales: Array) -> tuple[Array, Array]:
    """Smoothed positions minus the first recorded one, and second derivatives, of all movements.

    In the time ``v = scale t`` in which the penalty is 1: with Q the second divided differences and R the Gram matrix
    of hat functions, both banded, the second derivatives m of the spline solve ``(R + Q'Q) m = Q'x``, and the smoothed
    positions are ``x - Q m``.

    Parameters
    ----------
    times, positions : ndarray of shape (total,) and (total, d)
        Samples of all movements, at least three each.
    offsets : ndarray of shape (n + 1,)
    scales : ndarray of shape (n,)
        ``penalty ** (-1/3)``, with the penalty in the unit of the times.

    Returns
    -------
    smoothed, m : ndarray of shape (total, d)

    References
    ----------
    C. H. Reinsch, "Smoothing by spline functions", Numerische Mathematik 10, 1967.
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
    rows = np.sum([w[:, :, None] * one for w, one in zip(weights, values, strict=True)], axis=0)
    return np.ascontiguousarray(rows.transpose(0, 2, 1))
