"""Parquet columns whose cells are lists of numbers: a vector in each row, as robots' data sets store their states."""

from __future__ import annotations

from typing import Any

import numpy as np

from kineme.errors import DataError
from kineme.validation import Array

_SHOWN = 1000  # faults that are told apart; more rows than that are left to their missing numbers


def is_list(kind: Any) -> bool:
    """Whether a type of Arrow is a list of numbers, or of lists of them."""
    import pyarrow as pa

    of = pa.types
    if not (of.is_list(kind) or of.is_large_list(kind) or of.is_fixed_size_list(kind)):
        return False
    inner = kind.value_type
    return is_list(inner) or of.is_integer(inner) or of.is_floating(inner) or of.is_boolean(inner)


def width_of(kind: Any, file: Any, name: str) -> int:
    """How many numbers each row of a list column has: by its type, else by its first row."""
    import pyarrow as pa

    width, inner = 1, kind
    while pa.types.is_fixed_size_list(inner):
        width, inner = width * inner.list_size, inner.value_type
    if not is_list(inner):
        return width
    for batch in file.iter_batches(64, columns=[name]):
        for row in batch.column(0):
            if (cells := row.as_py()) is not None:
                return int(np.size(np.array(cells, dtype=np.float64)))
    return 0


def rows_of_lists(column: Any, width: int, head: str) -> tuple[Array, dict[int, str]]:
    """A list column as numbers (T, width), NaN where a row has none, and row -> what is wrong there.

    Raises
    ------
    DataError
        The bytes are damaged.
    """
    parts, n_rows = [np.empty((0, width))], 0
    faults: dict[int, str] = {}
    for chunk in getattr(column, "chunks", [column]):
        part, wrong = _rows(chunk, width, head)
        faults |= {n_rows + row: reason for row, reason in wrong.items()}
        parts.append(part)
        n_rows += len(part)
    return np.concatenate(parts), faults


def _rows(array: Any, width: int, head: str) -> tuple[Array, dict[int, str]]:
    import pyarrow as pa
    from pyarrow import compute

    try:
        array.validate(full=True)  # pyarrow itself trusts the offsets of damaged files
    except pa.ArrowException as error:
        raise DataError(f"expected lists of numbers in {head!r}, got damaged bytes ({error})") from error
    lengths = compute.list_value_length(array).fill_null(0).to_numpy(zero_copy_only=False)
    valid = array.is_valid().to_numpy(zero_copy_only=False)
    flat = array
    while is_list(flat.type):
        flat = compute.list_flatten(flat)
    values = flat.to_numpy(zero_copy_only=False).astype(np.float64)
    inner = len(values) // max(int(lengths[valid].sum()), 1)  # numbers in each entry of the outer list
    good = valid & (lengths * inner == width)
    kept = values if good.all() else values[np.repeat(good, np.where(valid, lengths, 0) * inner)[: len(values)]]
    rows = np.full((len(array), width), np.nan)
    if kept.size != int(good.sum()) * width:
        raise DataError(f"expected lists of {width} numbers in {head!r}, got lists within lists that differ in length")
    rows[good] = kept.reshape(-1, width)
    return rows, {
        row: f"expected {width} numbers in {head!r}, got {int(lengths[row]) * inner if valid[row] else 'nothing'}"
        for row in np.flatnonzero(~good)[:_SHOWN].tolist()
    }
