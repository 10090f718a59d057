"""Compiled sums over coordinates, twins of those in ``table.py``. Importing this module imports Numba."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from inspect import isfunction
from typing import Any

import numpy as np
from numba.core.errors import NumbaError  # noqa: F401 - what a call of `user_sums` may raise
from numba.extending import register_jitable

from kineme.kernels.base import Rows
from kineme.runtime.compiled import jit

# Bytes of each feature of those rows of B that are packed together, and rows of A that go over them at once. The strips
# of sums stay in L1, and each packed number that comes from L2 serves four pairs: see experiments/README.md for how
# near that is to the processor's limit.
_PANEL_BYTES = 512
_ROWS = 4


@jit
def _aligned(n_rows, n_columns, like):  # type: ignore[no-untyped-def]
    """An array on cache lines of 64 bytes; half of those that Numba makes begin in the middle of one."""
    size, per_line = n_rows * n_columns, 64 // like.itemsize
    block = np.empty(size + per_line, like.dtype)
    first = (-block.ctypes.data // like.itemsize) % per_line
    return block[first : first + size].reshape(n_rows, n_columns)


@jit
def _pack(rows, panel):  # type: ignore[no-untyped-def]
    for k in range(rows.shape[1]):
        for j in range(rows.shape[0]):
            panel[k, j] = rows[j, k]


@jit
def _unload(strips, n_rows, width, sums, i, start):  # type: ignore[no-untyped-def]
    for r in range(n_rows):
        for j in range(width):
            sums[i + r, start + j] = strips[r, j]


def _sum_over_coordinates(term: Callable[..., Any], A: Rows, B: Rows, c: Any, sums: Rows) -> None:
    """``sums[i, j] = sum_k term(A[i, k], B[j, k], c)`` for C-contiguous arrays.

    The rows of B are packed feature by feature, so that the innermost loop runs over neighboring
    columns of the Gram matrix: it vectorizes without reordering a sum, so the value of a pair does not
    depend on its position in the tile. Two features at a time share one load and store of the strips.
    """
    p = A.shape[1]
    n_columns = _PANEL_BYTES // A.itemsize
    panel, strips = _aligned(p, n_columns, A), _aligned(_ROWS, n_columns, A)
    s0, s1, s2, s3 = strips[0], strips[1], strips[2], strips[3]
    by_four = len(A) - len(A) % _ROWS
    for start in range(0, B.shape[0], n_columns):
        width = min(n_columns, B.shape[0] - start)
        _pack(B[start : start + width], panel)
        for i in range(0, by_four, _ROWS):
            a0, a1, a2, a3 = A[i], A[i + 1], A[i + 2], A[i + 3]
            strips[:] = 0
            for k in range(0, p - 1, 2):
                x0, x1, x2, x3 = a0[k], a1[k], a2[k], a3[k]
                y0, y1, y2, y3 = a0[k + 1], a1[k + 1], a2[k + 1], a3[k + 1]
                first, second = panel[k], panel[k + 1]
                for j in range(width):
                    s0[j] += term(x0, first[j], c) + term(y0, second[j], c)
                    s1[j] += term(x1, first[j], c) + term(y1, second[j], c)
                    s2[j] += term(x2, first[j], c) + term(y2, second[j], c)
                    s3[j] += term(x3, first[j], c) + term(y3, second[j], c)
            for k in range(p - p % 2, p):
                for r in range(_ROWS):
                    for j in range(width):
                        strips[r, j] += term(A[i + r, k], panel[k, j], c)
            _unload(strips, _ROWS, width, sums, i, start)
        for i in range(by_four, len(A)):
            s0[:] = 0
            for k in range(0, p - 1, 2):
                x0, y0, first, second = A[i, k], A[i, k + 1], panel[k], panel[k + 1]
                for j in range(width):
                    s0[j] += term(x0, first[j], c) + term(y0, second[j], c)
            for k in range(p - p % 2, p):
                for j in range(width):
                    s0[j] += term(A[i, k], panel[k, j], c)
            _unload(strips, 1, width, sums, i, start)


# Not cached on disk, since its key would contain functions; the loops below, which inline it, are cached. Each of the
# four rows is summed in the same order, so that a Gram matrix is symmetric to the last bit.
_sum = jit(_sum_over_coordinates, cache=False, reorder=False)


_absolute = register_jitable(lambda x, y, c: abs(x - y))
_squared = register_jitable(lambda x, y, c: (x - y) * (x - y))


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


@jit
def fill_pairs(rows: Rows, pairs: Rows) -> None:
    """Rows x_1 ... x_S, y_1 ... y_S as x_1, y_1, x_2, y_2 ...; the twin is `procrustes.as_complex`."""
    half = rows.shape[1] // 2
    for i in range(len(rows)):
        row, pair = rows[i], pairs[i]
        for k in range(half):
            pair[2 * k] = row[k]
            pair[2 * k + 1] = row[half + k]


@jit
def fill_soft_in_plane(parts: Rows, a: Any, b: Any, best: Any, rotations: Any) -> None:
    """Best products (n, m) under a prior, and cosines and sines (n, m, 2) if there is room for them.

    `parts` is what `procrustes._split` splits, in single precision, whose squares do not overflow; a and b are norms
    times the root of tr F. The twin is `rotation.soft_products_in_plane`.
    """
    n, m = best.shape
    below, beside = (n, 0) if len(parts) > n else (0, m)
    for i in range(n):
        for j in range(m):
            weight = a[i] * b[j]
            re, im = parts[i, j] + weight, np.float64(parts[i + below, j + beside])
            size = np.sqrt(re * re + im * im)
            best[i, j] = size - weight
            if rotations.size > 0:
                per = 1.0 / size if size > 0.0 else 0.0
                rotations[i, j, 0] = re * per if size > 0.0 else 1.0
                rotations[i, j, 1] = -im * per
