"""Differentiation on an even grid as matrices."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from kineme.validation import Array


@lru_cache(maxsize=64)
def differentiation_matrices(n_points: int) -> tuple[Array, Array]:
    """First and second differentiation matrices D1, D2 (T, T) in u on T even points of [0, 1].

    Central differences inside, one-sided ones at the ends; second order everywhere, exact for
    quadratics (D1) and cubics (D2).
    """
    h = 1.0 / (n_points - 1)
    inner = np.arange(1, n_points - 1)
    D1, D2 = np.zeros((n_points, n_points)), np.zeros((n_points, n_points))
    D1[inner, inner - 1], D1[inner, inner + 1] = -0.5, 0.5
    D1[0, :3] = -1.5, 2.0, -0.5
    D1[-1, -3:] = 0.5, -2.0, 1.5
    D2[inner, inner - 1], D2[inner, inner], D2[inner, inner + 1] = 1.0, -2.0, 1.0
    D2[0, :4] = 2.0, -5.0, 4.0, -1.0
    D2[-1, -4:] = -1.0, 4.0, -5.0, 2.0
    D1, D2 = D1 / h, D2 / h**2
    D1.setflags(write=False)
    D2.setflags(write=False)
    return D1, D2
