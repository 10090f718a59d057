"""Compiled twin of ``rotation.best_products``, pair by pair.

The result of a pair does not depend on the other pairs. S is diagonalized by Jacobi rotations of two axes at a time,
which rotate z too; three sweeps nearly always suffice, since each squares the error.
"""

from __future__ import annotations

import math

import numpy as np

from kineme.kernels.rotation import CLOSE, LEAST_STEP, STEPS
from kineme.runtime.compiled import jit

_SWEEPS = 8  # at most; three nearly always suffice
_SMALL = 1e-17  # of the largest entry


@jit
def fill_best_products(products, c, s, best):  # type: ignore[no-untyped-def]
    """``best[i, j]`` of the covariance ``products[3 i : 3 i + 3, 3 j : 3 j + 3]``, c and s of half the limit."""
    z, m = np.empty(3), np.empty(3)
    S = np.empty((3, 3))
    for i in range(best.shape[0]):
        for j in range(best.shape[1]):
            scale = 0.0
            finite = True
            for k in range(3):
                for h in range(3):
                    S[k, h] = products[3 * i + k, 3 * j + h]
                    finite &= math.isfinite(S[k, h])
                    scale = max(scale, abs(S[k, h]))
            if not finite:
                best[i, j] = math.nan
            elif scale == 0.0:
                best[i, j] = 0.0
            else:
                best[i, j] = scale * _best(S, scale, z, m, c, s)


@jit
def _best(C, scale, z, m, c, s):  # type: ignore[no-untyped-def]
    """The largest product of a covariance divided by `scale`; overwrites C, z and m."""
    for k in range(3):
        for h in range(3):
            C[k, h] /= scale
    z[0], z[1], z[2] = C[2, 1] - C[1, 2], C[0, 2] - C[2, 0], C[1, 0] - C[0, 1]
    trace = C[0, 0] + C[1, 1] + C[2, 2]
    for k in range(3):
        C[k, k] = 2.0 * C[k, k] - trace
        for h in range(k):
            C[k, h] += C[h, k]
            C[h, k] = C[k, h]
    _diagonalize(C, z)
    top = max(C[0, 0], C[1, 1], C[2, 2])
    for k in range(3):
        m[k] = top - C[k, k]
        z[k] *= z[k]
    x = _root_at_limit(z, m, c, s)
    below = top - trace
    rest = z[0] / (x + m[0]) + z[1] / (x + m[1]) + z[2] / (x + m[2])
    if below + x < rest:
        return top + _root_within(z, m, below, x)
    return c * c * trace + s * s * (top + x) + c * c * rest


@jit
def _diagonalize(S, z):  # type: ignore[no-untyped-def]
    for _ in range(_SWEEPS):
        if max(abs(S[0, 1]), abs(S[0, 2]), abs(S[1, 2])) <= _SMALL:
            return
        _turn(S, z, 0, 1, 2)
        _turn(S, z, 0, 2, 1)
        _turn(S, z, 1, 2, 0)


@jit
def _turn(S, z, p, q, r):  # type: ignore[no-untyped-def]
    """Turn axes p and q so that ``S[p, q]`` vanishes; r is the third."""
    off = S[p, q]
    if abs(off) <= _SMALL:
        return
    half = 0.5 * (S[q, q] - S[p, p])
    t = off / (abs(half) + math.sqrt(half * half + off * off))
    if half < 0:
        t = -t
    cosine = 1.0 / math.sqrt(1.0 + t * t)
    sine = t * cosine
    S[p, p] -= t * off
    S[q, q] += t * off
    S[p, q] = S[q, p] = 0.0
    a, b = S[p, r], S[q, r]
    S[p, r] = S[r, p] = cosine * a - sine * b
    S[q, r] = S[r, q] = sine * a + cosine * b
    a, b = z[p], z[q]
    z[p], z[q] = cosine * a - sine * b, sine * a + cosine * b


@jit
def _root_at_limit(squares, gaps, c, s):  # type: ignore[no-untyped-def]
    ratio = c / s
    x = ratio * math.sqrt(squares[0] + squares[1] + squares[2]) - max(gaps[0], gaps[1], gaps[2])
    for k in range(3):
        x = max(x, ratio * math.sqrt(squares[k]) - gaps[k])
    x = max(x, LEAST_STEP)
    for _ in range(STEPS):
        size = slope = 0.0
        for k in range(3):
            inverse = 1.0 / (x + gaps[k])
            term = ratio * ratio * squares[k] * inverse * inverse
            size += term
            slope += term * inverse
        if slope == 0.0:
            return x
        step = (math.sqrt(size) - 1.0) * size / slope
        x = max(x + step, LEAST_STEP)
        if abs(step) <= CLOSE * x:
            return x
    return x


@jit
def _root_within(squares, gaps, below, x):  # type: ignore[no-untyped-def]
    for k in range(3):
        half = 0.5 * (gaps[k] - below)
        x = max(x, half + math.sqrt(half * half + squares[k]) - gaps[k])
    for _ in range(STEPS):
        total, slope = 0.0, 1.0
        for k in range(3):
            inverse = 1.0 / (x + gaps[k])
            term = squares[k] * inverse
            total += term
            slope += term * inverse
        step = (total - below - x) / slope
        x = max(x + step, LEAST_STEP)
        if abs(step) <= CLOSE * x:
            return x
    return x
