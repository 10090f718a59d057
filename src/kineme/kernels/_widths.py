"""Median heuristics for kernel widths: a typical pair of training rows then lies on the slope of the kernel."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kineme.errors import SpecificationError
from kineme.kernels._rows import Rows
from kineme.kernels._sums import Term, fill_gram
from kineme.sampling import evenly_spaced

_MAX_ROWS = 1000
_MAX_DIFFERENCES = 2**21


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
