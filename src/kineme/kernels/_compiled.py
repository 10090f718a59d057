"""Compiled sums over coordinates, twins of those in ``_sums.py``. Importing this module imports Numba."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from inspect import isfunction
from typing import Any

import numpy as np
from numba.core.errors import NumbaError  # noqa: F401 - what a call of `user_sums` may raise
from numba.extending import register_jitable

from kineme.kernels._rows import Rows
from kineme.runtime.compiled import jit

# Columns of B that are packed together: one strip of sums and four strips of features stay in L1.
_PANEL = 128


def _sum_over_coordinates(term: Callable[..., Any], A: Rows, B: Rows, c: Any, sums: Rows) -> None:
    """``sums[i, j] = sum_k term(A[i, k], B[j, k], c)`` for C-contiguous arrays.

    The rows of B are packed feature by feature, so that the innermost loop runs over neighboring
    columns of the Gram matrix: it vectorizes without reordering a sum, so the value of a pair does not
    depend on its position in the tile. Four features at a time share one load and store of the strip.
    """
    p = A.shape[1]
    panel = np.empty((p, _PANEL), A.dtype)
    strip = np.empty(_PANEL, A.dtype)
    for start in range(0, B.shape[0], _PANEL):
        width = min(_PANEL, B.shape[0] - start)
        for j in range(width):
            for k in range(p):
                panel[k, j] = B[start + j, k]
        for i in range(A.shape[0]):
            a = A[i]
            strip[:] = 0
            for k in range(0, p - 3, 4):
                x0, x1, x2, x3 = a[k], a[k + 1], a[k + 2], a[k + 3]
                y0, y1, y2, y3 = panel[k], panel[k + 1], panel[k + 2], panel[k + 3]
                for j in range(width):
                    strip[j] += (term(x0, y0[j], c) + term(x1, y1[j], c)) + (term(x2, y2[j], c) + term(x3, y3[j], c))
            for k in range(p - p % 4, p):
                for j in range(width):
                    strip[j] += term(a[k], panel[k, j], c)
            sums[i, start : start + width] = strip[:width]


# Not cached on disk, since its key would contain functions; the loops below, which inline it, are cached.
_sum = jit(_sum_over_coordinates, cache=False)


@register_jitable
def _absolute(x: Any, y: Any, c: Any) -> Any:
    return abs(x - y)


@register_jitable
def _squared(x: Any, y: Any, c: Any) -> Any:
    t = x - y
    return t * t


@register_jitable
def _truncated(x: Any, y: Any, c: Any) -> Any:
    t = abs(x - y)
    return t if t < c else c  # one instruction; min() would test for NaN first


@register_jitable
def _canberra(x: Any, y: Any, c: Any) -> Any:
    size = abs(x) + abs(y)
    return abs(x - y) / (size if size > 0 else np.float32(1))  # an integer 1 would widen float32 to float64


@jit
def absolute_sums(A: Rows, B: Rows, c: Any, sums: Rows) -> None:
    """Sums of |x - y|."""
    _sum(_absolute, A, B, c, sums)


@jit
def squared_sums(A: Rows, B: Rows, c: Any, sums: Rows) -> None:
    """Sums of (x - y)²."""
    _sum(_squared, A, B, c, sums)


@jit
def truncated_sums(A: Rows, B: Rows, c: Any, sums: Rows) -> None:
    """Sums of min(c, |x - y|)."""
    _sum(_truncated, A, B, c, sums)


@jit
def canberra_sums(A: Rows, B: Rows, c: Any, sums: Rows) -> None:
    """Sums of |x - y| / (|x| + |y|), 0 where both are 0."""
    _sum(_canberra, A, B, c, sums)


@lru_cache(maxsize=32)
def user_sums(d: Callable[..., Any], g: Callable[..., Any]) -> Callable[[Rows, Rows, Any, Rows], None]:
    """Sums of g(d(x, y)) for a caller's scalar functions, compiled once per process."""
    # Builtins such as abs need no compilation, and compiled functions are used as they are.
    distance, transform = (jit(f, cache=False) if isfunction(f) else f for f in (d, g))
    term = jit(lambda x, y, c: transform(distance(x, y)), cache=False)

    def sums_of_tile(A: Rows, B: Rows, c: Any, sums: Rows) -> None:
        _sum(term, A, B, c, sums)

    return sums_of_tile


@jit
def fill_products(few: Rows, many: Rows, products: Rows) -> None:
    """``products[i, j] = few[i] . many[j]``, reading `many` once; the twin is ``few @ many.T``."""
    for j in range(many.shape[0]):
        row = many[j]
        for i in range(few.shape[0]):
            total = few.dtype.type(0)
            for k in range(few.shape[1]):
                total += few[i, k] * row[k]
            products[i, j] = total
