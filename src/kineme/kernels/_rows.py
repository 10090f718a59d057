"""Validation of feature rows: the only place that converts a caller's arrays for the kernels."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import SpecificationError

Rows = NDArray[np.floating]


def checked_pair(A: ArrayLike, B: ArrayLike | None) -> tuple[Rows, Rows | None]:
    """Check two sets of rows; B becomes None where both are the same object.

    scikit-learn calls ``kernel(X, X)`` with its training rows; recognizing that saves half of the work.
    """
    if B is None or B is A:
        return checked_rows(A, "A"), None
    A, B = checked_rows(A, "A"), checked_rows(B, "B")
    if A.shape[1] != B.shape[1]:
        raise SpecificationError(
            f"expected A and B with the same number of columns, got {A.shape[1]} and {B.shape[1]}; "
            "compute both with the same features"
        )
    dtype = np.result_type(A, B)
    return contiguous(A, dtype), contiguous(B, dtype)


def checked_rows(X: ArrayLike, name: str = "X") -> Rows:
    """Rows (n, p) as a read-only C-contiguous array; float32 stays, all else becomes float64.

    Raises `SpecificationError`: not numbers, not two-dimensional, no column, or a value that is NaN, infinite or so
    large that its square would overflow.
    """
    rows = np.asarray(X)
    if rows.ndim != 2:
        raise SpecificationError(
            f"expected {name} to be two-dimensional (rows, features), got shape {rows.shape}; "
            "pass a single row x as x[np.newaxis]"
        )
    if rows.shape[1] == 0:
        raise SpecificationError(f"expected {name} with at least one column, got shape {rows.shape}")
    if rows.dtype.kind not in "fiub":
        raise SpecificationError(f"expected {name} to hold real numbers, got dtype {rows.dtype}; convert it first")
    rows = contiguous(rows, rows.dtype if rows.dtype == np.float32 else np.dtype(np.float64))
    limit = largest_value(rows)
    # min and max need no array of absolute values, and NaN fails both comparisons.
    if rows.size and not (rows.min() >= -limit and rows.max() <= limit):
        bad_rows, bad_columns = np.nonzero(~(np.abs(rows) <= limit))
        row, column, n_bad = bad_rows[0], bad_columns[0], len(np.unique(bad_rows))
        what = f"{rows[row, column]} in row {row}, column {column} of {name}"
        if np.isfinite(rows[row, column]):
            raise SpecificationError(
                f"expected values up to {limit:.3g} in {rows.dtype}, got {what}; rescale the features or pass float64"
            )
        raise SpecificationError(
            f"expected finite numbers, got {what} ({n_bad} such rows); repair or leave out these rows"
        )
    return rows


def largest_value(rows: Rows) -> float:
    """Absolute value up to which a squared Euclidean distance between `rows` cannot overflow."""
    return float(np.sqrt(np.finfo(rows.dtype).max / rows.shape[1]) / 4)


def contiguous(rows: Rows, dtype: np.dtype[np.floating]) -> Rows:
    """Read-only C-contiguous view or copy of `rows`.

    Read-only even if the caller's array is writable: no code can write to it by mistake, and the compiled
    loops need one signature per dtype instead of two.
    """
    view = np.ascontiguousarray(rows, dtype).view()
    view.flags.writeable = False
    return view
