"""The smoothing spline in 50 decimal digits: what is right where two solvers in double precision differ."""

from __future__ import annotations

import itertools
from decimal import Decimal, localcontext

import numpy as np
from scipy.interpolate import PPoly

_DIGITS = 50


def exact_smoothing_spline(t, x, lam):
    """The minimizer of ``sum (x - f(t))^2 + lam int f''^2`` of stamps (T,) and positions (T, d), as a function."""
    with localcontext() as context:
        context.prec = _DIGITS
        knots, weight = [Decimal(one) for one in t.tolist()], Decimal(lam)
        solved = [_solve(knots, [Decimal(one) for one in column.tolist()], weight) for column in x.T]
    values = np.array([[float(one) for one in smooth] for smooth, _ in solved]).T
    bends = np.array([[float(one) for one in bend] for _, bend in solved]).T
    h = np.diff(t)[:, None]
    slopes = np.diff(values, axis=0) / h - h * (2 * bends[:-1] + bends[1:]) / 6
    return PPoly(np.stack([np.diff(bends, axis=0) / h / 6, bends[:-1] / 2, slopes, values[:-1]]), t)


def _solve(t, x, lam):
    """Smoothed values and second derivatives at the knots: ``(R + lam Q'Q) m = Q'x``, then ``x - lam Q m``."""
    h = [b - a for a, b in itertools.pairwise(t)]
    columns = [(1 / a, -1 / a - 1 / b, 1 / b) for a, b in itertools.pairwise(h)]  # of Q, from row j on
    n = len(columns)
    A = [[lam * _overlap(columns, i, i + k) for k in range(3)] for i in range(n)]  # the upper bands
    for i in range(n):
        A[i][0] += (h[i] + h[i + 1]) / 3
        A[i][1] += h[i + 1] / 6
    right = [sum(q * one for q, one in zip(column, x[j:], strict=False)) for j, column in enumerate(columns)]
    for i in range(n):
        for k in range(1, min(3, n - i)):
            factor = A[i][k] / A[i][0]
            right[i + k] -= factor * right[i]
            for c in range(k, 3):
                A[i + k][c - k] -= factor * A[i][c]
    m = [Decimal(0)] * (n + 2)
    for i in reversed(range(n)):
        m[i] = (right[i] - A[i][1] * m[i + 1] - A[i][2] * m[i + 2]) / A[i][0]
    smooth = list(x)
    for j, column in enumerate(columns):
        for r, q in enumerate(column):
            smooth[j + r] -= lam * q * m[j]
    return smooth, [Decimal(0), *m[:n], Decimal(0)]


def _overlap(columns, i, j):
    """Of the columns i <= j of Q the scalar product."""
    if j >= len(columns):
        return Decimal(0)
    return sum(a * b for a, b in zip(columns[i][j - i :], columns[j], strict=False))
