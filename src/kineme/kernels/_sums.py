"""Sums over coordinates, for every kernel of the form h(sum_j g(d(x_j, y_j))), Eq. (5)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from kineme.errors import SpecificationError
from kineme.kernels._rows import Rows, contiguous
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.runtime.parallel import for_tiles
from kineme.sampling import evenly_spaced

_MAX_ROWS = 1000
_MAX_DIFFERENCES = 2**21

# Pairs of 256 x 256 rows: large enough to repay packing the columns, small enough for the cache.
_TILE = 256
# Elements of a temporary array in the twin.
_TWIN_CHUNK = 2**17

TileSums = Callable[[Rows, Rows, Any, Rows], None]


@dataclass(frozen=True)
class Term:
    """The term that one coordinate adds to the sum: g(d(x, y)), with one constant c.

    `load_compiled`: returns the compiled loop; called only if it is used, because it imports Numba.
    """

    twin: Callable[[Rows, Rows, Any], Any]  # the definition, ``twin(x, y, c)`` over arrays
    load_compiled: Callable[[], TileSums]
    cost: int = 4  # elementary operations of NumPy per evaluation of the twin
    symmetric: bool = True  # whether term(x, y) always equals term(y, x)


def _builtin(name: str) -> Callable[[], TileSums]:
    def load() -> TileSums:
        loop: TileSums = getattr(compiled_module("kineme.kernels._compiled"), name)
        return loop

    return load


def _canberra(x: Rows, y: Rows, _c: Any) -> Rows:
    size = np.abs(x) + np.abs(y)
    return np.abs(x - y) / np.where(size > 0, size, 1)


ABSOLUTE = Term(lambda x, y, c: np.abs(x - y), _builtin("absolute_sums"))
SQUARED = Term(lambda x, y, c: (x - y) ** 2, _builtin("squared_sums"))
TRUNCATED = Term(lambda x, y, c: np.minimum(np.abs(x - y), c), _builtin("truncated_sums"))
CANBERRA = Term(_canberra, _builtin("canberra_sums"), cost=8)


def fill_gram(term: Term, c: float, finish: Callable[[Rows], object], A: Rows, B: Rows | None, gram: Rows) -> None:
    """Write h(sums of `term` over coordinates) to `gram`, tile by tile, in threads.

    - `c`: the constant of the term.
    - `finish`: h of Eq. (5): changes a tile of sums in place.
    - `A`, `B` (n_A, p), (n_B, p).
    - `gram` (n_A, n_B).
    """
    mirrored = B is None and term.symmetric
    A = contiguous(A, A.dtype)
    columns = A if B is None else contiguous(B, A.dtype)
    n_pairs = gram.size // (2 if mirrored else 1)
    tile_sums = tile_sums_of(term, n_pairs * A.shape[1])
    constant = A.dtype.type(c)
    tiles = [(i, j) for i in range(0, len(A), _TILE) for j in range(0, i + 1 if mirrored else len(columns), _TILE)]

    def work(first: int, last: int) -> None:
        for i, j in tiles[first:last]:
            a, b = A[i : i + _TILE], columns[j : j + _TILE]
            tile = np.empty((len(a), len(b)), A.dtype)
            tile_sums(a, b, constant, tile)
            finish(tile)
            gram[i : i + _TILE, j : j + _TILE] = tile
            if mirrored and i != j:
                gram[j : j + _TILE, i : i + _TILE] = tile.T

    for_tiles(work, len(tiles), 1)


def tile_sums_of(term: Term, n_terms: int) -> TileSums:
    """The loop to use for `n_terms` evaluations of the term: compiled if that repays its overhead, else plain."""
    if use_compiled(n_terms * term.cost):
        return term.load_compiled()

    def twin_sums(A: Rows, B: Rows, c: Any, sums: Rows) -> None:
        step = max(1, _TWIN_CHUNK // A.shape[1])
        for i, x in enumerate(A):
            for j in range(0, len(B), step):
                sums[i, j : j + step] = term.twin(x, B[j : j + step], c).sum(axis=1)

    return twin_sums


def median_of_sums(term: Term, finish: Callable[[Rows], object], X: Rows) -> float:
    """Median over pairs of different rows of finish(sum of `term` over coordinates), in place.

    Of large X, 1000 evenly spaced rows are used, so the result is deterministic. Pairs of equal rows are
    left out: copies of a row say nothing about the distances between different rows.
    """
    rows = _some_rows(X, _MAX_ROWS)
    sums = np.empty((len(rows), len(rows)))
    fill_gram(term, 0.0, finish, rows, None, sums)
    return _median_of_positive(sums[np.triu_indices(len(rows), 1)], len(X))


def median_difference(X: Rows) -> float:
    """Median over pairs of rows and coordinates of the differences ``|x_i - y_i|`` that are not zero.

    Of large X, as many evenly spaced rows are used as give about two million differences.
    """
    rows = _some_rows(X, max(10, min(_MAX_ROWS, int((2 * _MAX_DIFFERENCES / X.shape[1]) ** 0.5))))
    first, second = np.triu_indices(len(rows), 1)
    return _median_of_positive(np.abs(rows[first] - rows[second]), len(X))


def _some_rows(X: Rows, most: int) -> Rows:
    """At most `most` evenly spaced rows, in double precision."""
    return np.ascontiguousarray(X[evenly_spaced(len(X), most)] if len(X) > most else X, np.float64)


def _median_of_positive(values: Rows, n_rows: int) -> float:
    positive = values[values > 0]
    if not positive.size:
        raise SpecificationError(
            f"expected training rows that differ, got {n_rows} row(s), all equal, which say nothing about "
            "the widths; pass the widths as numbers, or more rows"
        )
    return float(np.median(positive))
