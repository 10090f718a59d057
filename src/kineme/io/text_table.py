"""CSV and its relatives, at the speed of NumPy's C parser."""

from __future__ import annotations

import io
from collections.abc import Iterator
from functools import cache
from itertools import chain, islice
from typing import Any

import numpy as np

from kineme.errors import DataError
from kineme.io.columns import Roles, choose_roles
from kineme.io.dates import seconds_of_dates
from kineme.io.dialect import COMMENTS, Dialect, detect_dialect, is_skipped
from kineme.io.layout import Layout
from kineme.io.slow_table import read_slowly
from kineme.io.table import Table


def read_text_table(data: bytes, layout: Layout) -> tuple[Table, Roles]:
    """Read a table of samples by lines.

    Separated by comma, semicolon, tab or blanks; with a head line or without; quoted or not; with decimal commas
    where the separator is another mark. Empty lines and lines that begin with one of `COMMENTS` are skipped. A head
    may stand in the last comment, as `numpy.savetxt` writes it.

    Raises
    ------
    DataError
        No text, no samples, or no columns to be found.
    """
    encoding = _encoding(data)
    dialect = detect_dialect(_lines(data, encoding))
    roles = choose_roles(dialect.heads, dialect.kinds, layout, dialect.named)
    dated = roles.time is not None and dialect.kinds[roles.time] == "date"
    texts = {k for k in (*roles.movement, roles.label, *roles.ignored, roles.time if dated else None) if k is not None}
    dtype = np.dtype([(f"c{k}", "O" if k in texts else "f8") for k in range(len(dialect.heads))])
    faults: dict[int, str] = {}
    rows = _read_fast(data, encoding, dialect, dtype)
    if rows is None:
        rows, faults = read_slowly(_samples(data, encoding, dialect), dialect, dtype)

    @cache
    def lines() -> Any:
        return np.fromiter((line for line, _ in _samples(data, encoding, dialect)), np.intp)

    def line_of(row: int) -> int | None:
        return int(lines()[row])

    columns = [rows[name] for name in dtype.names or ()]
    if dated and roles.time is not None:
        columns[roles.time], others = seconds_of_dates(columns[roles.time].tolist())
        head = dialect.heads[roles.time]
        faults = {
            row: f"expected a date in {head!r}, got {cell or 'nothing'!r}" for row, cell in others.items()
        } | faults
    return Table(dialect.heads, columns, len(rows), line_of, faults, "s" if dated else None), roles


def _encoding(data: bytes) -> str:
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    if b"\0" in data:
        raise DataError("expected text, got bytes that are none")
    try:
        data if data.isascii() else data.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"  # degree signs and the like of older programs
    return "utf-8-sig"


def _lines(data: bytes, encoding: str) -> Iterator[str]:
    try:
        yield from io.TextIOWrapper(io.BytesIO(data), encoding=encoding)
    except UnicodeError as error:
        raise DataError(f"expected text, got bytes that are none ({error})") from error


def _samples(data: bytes, encoding: str, dialect: Dialect) -> Iterator[tuple[int, str]]:
    """Line number, counted from 1, and text of every sample."""
    numbered = enumerate(islice(_lines(data, encoding), dialect.first, None), dialect.first + 1)
    return ((k, line) for k, line in numbered if not is_skipped(line))


def _read_fast(data: bytes, encoding: str, dialect: Dialect, dtype: np.dtype[Any]) -> Any:
    """All samples as a structured array, or None if a line is not as the others."""
    has_text = any(dtype[name].kind == "O" for name in dtype.names or ())
    if dialect.decimal_comma and has_text:
        return None  # a comma in a name is not a decimal mark
    lines: Iterator[str] = islice(_lines(data, encoding), dialect.first, None)
    if any(mark.encode() in data for mark in COMMENTS):
        lines = (line for line in lines if not is_skipped(line))
    if dialect.decimal_comma:
        lines = (line.replace(",", ".") for line in lines)
    first = next((line for line in lines if not is_skipped(line)), None)
    if first is None:
        raise DataError("expected samples, got none below the heads")
    try:
        return np.loadtxt(
            chain((first,), lines), dtype, comments=None, delimiter=dialect.separator, quotechar='"', ndmin=1
        )
    except ValueError:
        return None
