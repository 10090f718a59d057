"""Parquet: columns with types; what they mean is decided as for text."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from kineme.errors import DataError
from kineme.io.columns import Roles, choose_roles
from kineme.io.layout import Layout
from kineme.io.table import Table


def _no_lines(row: int) -> None:
    return None


def read_parquet_table(data: bytes, layout: Layout) -> tuple[Table, Roles]:
    """Read the columns that are needed. Dates and durations count in nanoseconds; what is missing is NaN.

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
        table = file.read(columns=[heads[k] for k in needed])
        texts = {*roles.movement, roles.label}
        read = {k: _column(table.column(i), k in texts, heads[k]) for i, k in enumerate(needed)}
    except (pa.ArrowException, OSError) as error:
        if isinstance(error, DataError):
            raise
        raise DataError(f"expected a Parquet file, got something foreign, truncated or damaged ({error})") from error
    if table.num_rows == 0:
        raise DataError("expected samples, got a table without rows")
    columns = [read.get(k) for k in range(len(heads))]
    dated = roles.time is not None and kinds[roles.time] == "date"
    return Table(heads, columns, table.num_rows, _no_lines, dates_in="ns" if dated else None), roles


def _kind(pa: Any, kind: Any) -> str:
    of = pa.types
    if of.is_timestamp(kind) or of.is_date(kind) or of.is_duration(kind):
        return "date"
    return "number" if of.is_integer(kind) or of.is_floating(kind) or of.is_decimal(kind) else "text"


def _column(column: Any, is_text: bool, head: str) -> Any:
    if is_text:
        known = column.unique().to_pylist()  # names are few, rows many
        texts = np.array(["" if one is None else str(one) for one in known], dtype=object)
        codes = {one: k for k, one in enumerate(known)}
        return texts[np.fromiter((codes[one] for one in column.to_pylist()), np.intp, len(column))]
    values = column.to_numpy()
    if values.dtype.kind in "Mm":
        counts = values.astype(f"{values.dtype.kind}8[ns]")
        return np.where(np.isnat(counts), np.nan, counts.astype(np.int64))
    try:
        return values.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise DataError(f"expected numbers in the column {head!r}, got {column.type}") from error
