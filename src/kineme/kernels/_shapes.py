"""Compiled twin of `pair_distances.shapes_of`: each movement's arrays are filled while it is in the cache."""

from __future__ import annotations

import math

import numpy as np

from kineme.runtime.compiled import jit


@jit
def fill_shapes(paths, no_length, at, segments, points):  # type: ignore[no-untyped-def]
    """Fill what `Shapes` holds of paths (n, d, S).

    `no_length` is the largest length of a vector without a direction; `at` two pairs of arrays, the positions before
    the ends of segments and before points, and the shares of the next ones. `segments` are tangents, midpoints and
    turning angles, `points` are points, tangents and turning angles there.
    """
    n_dims, n_segments, n_points = paths.shape[1], segments[2].shape[1], points[2].shape[1]
    ends, x = np.empty((n_dims, n_segments + 1)), np.empty((n_dims, n_points))
    t, steps, slopes = np.empty_like(ends), np.empty_like(x), np.empty_like(x)
    directed, turned = np.empty(max(ends.shape[1], n_points)), np.empty(max(ends.shape[1], n_points))
    for i in range(paths.shape[0]):
        _interpolate(paths[i], at[0], ends)
        for k in range(n_dims):
            for p in range(n_segments):
                t[k, p] = ends[k, p + 1] - ends[k, p]
                segments[1][i, p, k] = 0.5 * (ends[k, p + 1] + ends[k, p])
        _normalize(t, n_segments, no_length, directed)
        _write(t, segments[0][i])
        _angles(t, 2, n_segments - 2, directed, turned, segments[2][i])
        for p in range(1, n_segments - 1):
            segments[2][i, p] *= directed[p]
        _interpolate(paths[i], at[1], x)
        _write(x, points[0][i])
        for k in range(n_dims):
            for p in range(n_points - 1):
                steps[k, p] = x[k, p + 1] - x[k, p]
            slopes[k, 0], slopes[k, n_points - 1] = steps[k, 0], steps[k, n_points - 2]
            for p in range(1, n_points - 1):
                slopes[k, p] = 0.5 * (x[k, p + 1] - x[k, p - 1])
        _normalize(slopes, n_points, no_length, directed)
        _write(slopes, points[1][i])
        _normalize(steps, n_points - 1, no_length, directed)
        _angles(steps, 1, n_points - 2, directed, turned, points[2][i])


@jit
def _interpolate(path, at, x):  # type: ignore[no-untyped-def]
    """``x[k, p]`` between the positions ``path[k, before[p]]`` and the next."""
    before, share = at
    for k in range(len(path)):
        own, out = path[k], x[k]
        for p in range(len(before)):
            out[p] = own[before[p]] * (1.0 - share[p]) + own[before[p] + 1] * share[p]


@jit
def _normalize(v, n, no_length, directed):  # type: ignore[no-untyped-def]
    """Divide the first n columns of v (d, n) by their lengths; `directed` is 1, or 0 where they have none."""
    directed[:n] = 0.0
    for k in range(len(v)):
        own = v[k]
        for p in range(n):
            directed[p] += own[p] * own[p]
    for p in range(n):
        directed[p] = math.sqrt(directed[p])
    for k in range(len(v)):
        own = v[k]
        for p in range(n):
            own[p] = own[p] / directed[p] if directed[p] > no_length else 0.0
    for p in range(n):
        directed[p] = 1.0 if directed[p] > no_length else 0.0


@jit
def _write(v, rows):  # type: ignore[no-untyped-def]
    for k in range(len(v)):
        own = v[k]
        for p in range(len(rows)):
            rows[p, k] = own[p]


@jit
def _angles(v, apart, n, directed, angles, row):  # type: ignore[no-untyped-def]
    """Angles between columns p and p + apart, divided by pi, for n columns p; they are written from 1 on.

    The arc cosine is Eq. 4.4.46 of M. Abramowitz and I. A. Stegun, "Handbook of Mathematical Functions", 1964, with an
    error of at most 2e-8; a call of the exact one for each angle takes longer than all the rest.
    """
    angles[:n] = 0.0
    for k in range(len(v)):
        own = v[k]
        for p in range(n):
            angles[p] += own[p] * own[p + apart]
    for p in range(n):
        cosine = angles[p]
        c = min(abs(cosine), 1.0)
        series = 0.0308918810 + c * (-0.0170881256 + c * (0.0066700901 - c * 0.0012624911))
        series = 1.5707963050 + c * (-0.2145988016 + c * (0.0889789874 + c * (-0.0501743046 + c * series)))
        angle = math.sqrt(1.0 - c) * series
        angle = angle if cosine > 0.0 else math.pi - angle
        angles[p] = angle * directed[p] * directed[p + apart] * (1.0 / math.pi)
    row[0] = row[n + 1] = 0.0
    for p in range(n):
        row[p + 1] = angles[p]
