"""Parquet tables; the roles of the columns are found as in text tables."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from kineme.errors import DataError
from kineme.files.limits import check_expanded
from kineme.movements.tables.columns import Roles, choose_roles
from kineme.movements.tables.layout import Layout
from kineme.movements.tables.parsed import no_lines
from kineme.movements.tables.table import Table
from kineme.movements.tables.time_stamps import nanoseconds

_ROWS = 2**18  # rows that are decompressed at a time


def read_parquet_table(data: bytes, layout: Layout) -> tuple[Table, Roles]:
    """Read the columns that have a role. Dates and durations are nanoseconds; missing values are NaN.

    Raises
    ------
    DataError
        Not a Parquet file, damaged, or the package that reads it is not installed; the message names the extra.
    """
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError as error:
        raise DataError("expected the package pyarrow to read Parquet; pip install 'kineme[parquet]'") from error
    try:
        file = parquet.ParquetFile(io.BytesIO(data))
        heads = tuple(file.schema_arrow.names)
        kinds = tuple(_kind(pa, kind) for kind in file.schema_arrow.types)
        roles = choose_roles(heads, kinds, layout)
        needed = sorted({*range(len(heads))} - {*roles.ignored})
        check_expanded(8 * max(file.metadata.num_rows, 0) * len(needed))
        _refuse_twins(heads, needed)
        texts = {*roles.movement, roles.label}
        if nested := [k for k in needed if k in texts and pa.types.is_nested(file.schema_arrow.types[k])]:
            raise DataError(f"expected names in {heads[nested[0]]!r}, got {file.schema_arrow.types[nested[0]]}")
        named = [heads[k] for k in needed if k in texts]  # kept as dictionaries: few different texts in many rows
        file = parquet.ParquetFile(io.BytesIO(data), read_dictionary=named)
        table = pa.Table.from_batches(_batches(file, [heads[k] for k in needed]))
        read = {k: (_texts if k in texts else _numbers)(table.column(heads[k]), heads[k]) for k in needed}
    except (pa.ArrowException, OSError) as error:
        if isinstance(error, DataError):
            raise
        raise DataError(f"expected a Parquet file, got something foreign, truncated or damaged ({error})") from error
    if table.num_rows == 0:
        raise DataError("expected samples, got a table without rows")
    columns = [read.get(k) for k in range(len(heads))]
    dated = roles.time is not None and kinds[roles.time] == "date"
    return Table(heads, columns, table.num_rows, no_lines, dates_in="ns" if dated else None), roles


def _kind(pa: Any, kind: Any) -> str:
    of = pa.types
    if of.is_timestamp(kind) or of.is_date(kind) or of.is_duration(kind):
        return "date"
    return "number" if of.is_integer(kind) or of.is_floating(kind) or of.is_decimal(kind) else "text"


def _batches(file: Any, needed: Sequence[str]) -> list[Any]:
    """The columns, some rows at a time; refused once they take more memory than the limit.

    The metadata about the pages of columns are not used: pyarrow ends the process if they are damaged.
    """
    batches, n_bytes = [], 0
    for batch in file.iter_batches(_ROWS, columns=list(needed)):
        n_bytes += batch.nbytes
        check_expanded(n_bytes)
        batches.append(batch)
    if not batches:
        raise DataError("expected samples, got a table without rows")
    return batches


def _refuse_twins(heads: Sequence[str], needed: Sequence[int]) -> None:
    counts = Counter(heads)
    if twins := [heads[k] for k in needed if counts[heads[k]] > 1]:
        raise DataError(f"expected columns of different names, got {twins[0]!r} {counts[twins[0]]} times")


def _texts(column: Any, head: str) -> Any:
    """Names as texts, empty for missing ones."""
    import pyarrow as pa

    if not pa.types.is_dictionary(column.type):
        column = column.dictionary_encode()
    parts = [np.empty(0, dtype=object)]
    for chunk in column.chunks:
        known = np.array([*(_text(one, head) for one in chunk.dictionary.to_pylist()), ""], dtype=object)
        which = chunk.indices.cast(pa.int64()).fill_null(len(known) - 1).to_numpy()
        if len(which) and not 0 <= which.min() <= which.max() < len(known):  # pyarrow does not check the indices
            raise DataError(f"expected names in {head!r}, got numbers of names that are not there: damaged bytes")
        parts.append(known[which])
    return np.concatenate(parts)


def _text(one: Any, head: str) -> str:
    if isinstance(one, bytes):
        return one.decode("utf-8", "replace")
    if one != one:  # noqa: PLR0124 - only NaN differs from itself
        raise DataError(f"expected names in {head!r}, got {one!r}")
    return "" if one is None else str(one)


def _numbers(column: Any, head: str) -> Any:
    values = column.to_numpy()
    if values.dtype.kind in "Mm":
        return nanoseconds(values)
    try:
        return values.astype(np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise DataError(f"expected numbers in the column {head!r}, got {column.type}") from error
