"""Compiled twin of the normalization of movements."""

from __future__ import annotations

import math

import numpy as np

from kineme.runtime.compiled import jit


@jit
def fill_normalized(paths, least, normalized):  # type: ignore[no-untyped-def]
    """Return paths (n, d, T) minus their center, divided by their size; see `specification.Normalization.apply`.

    Dimensions larger than a share `least` of the whole are divided by their own size, with infinity none.
    """
    n, n_dims, n_points = paths.shape
    away, squares = np.empty((n_dims, n_points)), np.empty(n_dims)  # contiguous, unlike every second sample of a path
    for i in range(n):
        for k in range(n_dims):
            own, total, square = away[k], 0.0, 0.0
            for t in range(n_points):
                own[t] = paths[i, k, t]
                total += own[t]
            center = total / n_points
            for t in range(n_points):
                own[t] -= center
                square += own[t] * own[t]
            squares[k] = square
        total_size = math.sqrt(squares.sum() / n_points)
        for k in range(n_dims):
            size = math.sqrt(squares[k] / n_points)
            size = size if size > least * total_size else total_size
            per = 1.0 / (size if size > 0.0 else 1.0)
            own, row = away[k], normalized[i, k]
            for t in range(n_points):
                row[t] = own[t] * per
