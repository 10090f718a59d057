"""Compiled best rotations in space under a prior: twins of those in ``rotation.py``; for lanes see `_rotation`."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from kineme.kernels.rotation import CONVERGED, NEWTON_STEPS, ROUNDING, TIE, TIE_BREAK
from kineme.runtime.compiled import jit

_LANES = 32  # pairs at once: with fewer the processor waits for roots and divisions


class _Lanes(NamedTuple):
    """Numbers of each pair, the last axis of every array."""

    M: Any  # (3, 3, lanes), divided by their norms
    cofactors: Any  # (3, 3, lanes)
    R: Any  # (3, 3, lanes)
    size: Any  # (lanes,), the norm of M
    square: Any  # 1, or more where a tie was broken
    determinant: Any
    last: Any
    top: Any  # the largest root
    divisor: Any


@jit
def _room():  # type: ignore[no-untyped-def]
    three, six = np.empty((3, 3, 3, _LANES)), np.empty((6, _LANES))
    return _Lanes(three[0], three[1], three[2], six[0], six[1], six[2], six[3], six[4], six[5])


@jit
def fill_soft_products(products, a, b, F, best):  # type: ignore[no-untyped-def]
    """``best[i, j]`` of the covariance ``products[3 i : 3 i + 3, 3 j : 3 j + 3]``, norms a[i] and b[j], and F."""
    lanes = _room()
    for first in range(0, best.size, _LANES):
        _fill_lanes(products, a, b, F, best, lanes, first)


@jit
def fill_soft_rotations(products, a, b, F, best, rotations):  # type: ignore[no-untyped-def]
    """The same, and the rotations (n, m, 3, 3)."""
    lanes, n_columns = _room(), best.shape[1]
    for first in range(0, best.size, _LANES):
        width = _fill_lanes(products, a, b, F, best, lanes, first)
        _rotate(lanes)
        if _break_ties(lanes, width):
            _solve(lanes)
            _rotate(lanes)
        for lane in range(width):
            i, j = divmod(first + lane, n_columns)
            for k in range(3):
                for h in range(3):
                    rotations[i, j, k, h] = lanes.R[k, h, lane]


@jit
def _fill_lanes(products, a, b, F, best, lanes, first):  # type: ignore[no-untyped-def] # noqa: PLR0913, PLR0917
    """Solve the pairs from number `first` on, one in each lane, and write their ``best``; how many they are."""
    n_columns, prior = best.shape[1], F[0, 0] + F[1, 1] + F[2, 2]
    width = min(_LANES, best.size - first)
    _load(products, a, b, F, lanes, first, width, n_columns)
    _solve(lanes)
    for lane in range(width):
        i, j = divmod(first + lane, n_columns)
        best[i, j] = lanes.top[lane] * lanes.size[lane] - prior * a[i] * b[j]
    return width


@jit
def _load(products, a, b, F, lanes, first, width, n_columns):  # type: ignore[no-untyped-def] # noqa: PLR0913, PLR0917
    M = lanes.M
    for lane in range(_LANES):
        i, j = divmod(first + min(lane, width - 1), n_columns)
        norms, square = a[i] * b[j], 0.0
        for k in range(3):
            for h in range(3):
                M[k, h, lane] = products[3 * i + k, 3 * j + h] + norms * F[k, h]
                square += M[k, h, lane] ** 2
        size = math.sqrt(square)
        lanes.size[lane] = size
        for k in range(3):
            for h in range(3):
                M[k, h, lane] = M[k, h, lane] / size if size > 0 else (1.0 if k == h else 0.0)


@jit
def _solve(lanes):  # type: ignore[no-untyped-def]
    """Cofactors, invariants and the largest root."""
    M, A = lanes.M, lanes.cofactors
    square, determinant, last, top = lanes.square, lanes.determinant, lanes.last, lanes.top
    for k in range(3):
        p, q = (k + 1) % 3, (k + 2) % 3
        for h in range(3):
            u, v = (h + 1) % 3, (h + 2) % 3
            for lane in range(_LANES):
                A[k, h, lane] = M[p, u, lane] * M[q, v, lane] - M[p, v, lane] * M[q, u, lane]
    square[:], last[:] = 0.0, 0.0
    for k in range(3):
        for h in range(3):
            for lane in range(_LANES):
                square[lane] += M[k, h, lane] * M[k, h, lane]
                last[lane] += 4.0 * A[k, h, lane] * A[k, h, lane]
    for lane in range(_LANES):
        determinant[lane] = (
            M[0, 0, lane] * A[0, 0, lane] + M[0, 1, lane] * A[0, 1, lane] + M[0, 2, lane] * A[0, 2, lane]
        )
        top[lane] = math.sqrt(square[lane] + math.sqrt(3.0 * last[lane]))
    for _ in range(NEWTON_STEPS):
        moving = 0.0
        for lane in range(_LANES):
            x = top[lane]
            over = x * x - square[lane]
            slope = 4.0 * x * over - 8.0 * determinant[lane]
            value = over * over - 8.0 * x * determinant[lane] - last[lane]
            goes_on = slope > 0.0 and value > CONVERGED * x * slope and value > ROUNDING * square[lane] * square[lane]
            step = value / slope if goes_on else 0.0
            top[lane] = x - step
            moving += step
        if not moving > 0.0:
            break


@jit
def _rotate(lanes):  # type: ignore[no-untyped-def]
    M, A, R = lanes.M, lanes.cofactors, lanes.R
    for lane in range(_LANES):
        k = 0.5 * (lanes.top[lane] ** 2 - lanes.square[lane])
        lanes.divisor[lane] = k * lanes.top[lane] - lanes.determinant[lane]
    for row in range(3):
        for column in range(3):
            for lane in range(_LANES):
                k = 0.5 * (lanes.top[lane] ** 2 + lanes.square[lane])
                cubic = 0.0
                for h in range(3):
                    gram = M[row, 0, lane] * M[h, 0, lane]
                    gram += M[row, 1, lane] * M[h, 1, lane] + M[row, 2, lane] * M[h, 2, lane]
                    cubic += gram * M[h, column, lane]
                sum_ = k * M[row, column, lane] + lanes.top[lane] * A[row, column, lane] - cubic
                R[row, column, lane] = sum_ / lanes.divisor[lane]


@jit
def _break_ties(lanes, width):  # type: ignore[no-untyped-def]
    """Change the matrices for which two rotations are equally good; whether there are any."""
    tied = False
    for lane in range(width):
        if not abs(lanes.divisor[lane]) >= TIE:
            for k in range(3):
                lanes.M[k, k, lane] += TIE_BREAK[k]
            tied = True
    return tied
