"""Data frames of pandas and polars; the roles of the columns are found as in files. Neither package is imported."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta
from decimal import Decimal
from math import isfinite
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.movements.tables.columns import Roles, choose_roles
from kineme.movements.tables.layout import Layout
from kineme.movements.tables.parsed import Parsed, no_lines
from kineme.movements.tables.table import Table, table_movements
from kineme.movements.tables.time_stamps import nanoseconds, seconds_of_dates
from kineme.validation import ROUNDED, too_long_integer

_KINDS = {"i": "number", "u": "number", "f": "number", "M": "date", "m": "date"}  # of NumPy -> of `choose_roles`
_NUMBERS = (Real, Decimal)


def parse_data_frame(frame: Any, layout: Layout) -> Parsed:
    """The movements of a data frame: one, or many that are told apart by columns.

    The levels of a pandas index that have a name, or hold dates, count as columns that cannot be coordinates.

    Raises
    ------
    DataError
        No column of times that is named so or that `layout` names, several of them, no coordinates, no rows, or
        something else than numbers where numbers are needed.
    """
    read = [(head, _values(series), inside) for head, series, inside in _columns(frame)]
    heads = tuple(head for head, _, _ in read)
    arrays = [values for _, values, _ in read]
    kinds = [_kind(values) if inside else "text" for _, values, inside in read]
    if not heads or not len(arrays[0]):
        raise DataError("expected samples, got a data frame without rows")
    roles = choose_roles(heads, kinds, layout)
    columns, dates_in = _by_role(heads, arrays, roles)
    parsed = table_movements(Table(heads, columns, len(arrays[0]), no_lines, dates_in=dates_in), roles, layout, "frame")
    if roles.label is not None and (kind := arrays[roles.label].dtype.kind) in "iuf":  # numbers stay numbers
        number = float if kind == "f" else int
        numbers = [None if one is None else number(one) for one in parsed.block.labels]
        parsed.block.labels[:] = numbers  # type: ignore[assignment]
    return parsed


def _columns(frame: Any) -> Iterator[tuple[str, Any, bool]]:
    """Head and values of each column, and whether it is one of the frame rather than of its index."""
    at = getattr(frame, "iloc", None)
    for k, name in enumerate(frame.columns):
        head = "_".join(map(str, name)) if isinstance(name, tuple) else str(name)
        yield head, frame[name] if at is None else at[:, k], True
    for level, name in enumerate(getattr(getattr(frame, "index", None), "names", ())):
        values = frame.index.get_level_values(level)
        if name is not None or getattr(values.dtype, "kind", "") in "Mm":
            yield "time" if name is None else str(name), values, False


def _values(series: Any) -> NDArray[Any]:
    """Numbers, dates, or texts as objects, numbers among them as they are; missing numbers are NaN, texts empty."""
    values: NDArray[Any] = np.asarray(series.to_numpy())
    if values.dtype.kind != "O":
        return values if values.dtype.kind in _KINDS or values.dtype.kind == "c" else _texts(values.tolist())
    known = [one for one in values.tolist() if not _is_missing(one)]
    if known and all(isinstance(one, datetime) for one in known):
        return np.asarray(series.to_numpy(dtype="datetime64[ns]"))
    if known and all(isinstance(one, timedelta) for one in known):
        return np.asarray(series.to_numpy(dtype="timedelta64[ns]"))
    if known and all(map(_is_number, known)):
        return np.array([np.nan if _is_missing(one) else float(one) for one in values.tolist()])
    texts = _texts(values.tolist())
    texts[:] = [one if _is_number(one) else text for one, text in zip(values.tolist(), texts, strict=True)]
    return texts


def _kind(values: NDArray[Any]) -> str:
    """What a column holds; one with a number among texts is one of numbers, and refused where it is a coordinate."""
    mixed = values.dtype.kind == "O" and (any(map(_is_number, values.tolist())) or _are_decimals(values.tolist()))
    return "number" if mixed or values.dtype.kind == "c" else _KINDS.get(values.dtype.kind, "text")


def _are_decimals(texts: list[str]) -> bool:
    """Whether texts are measured numbers, such as "0.25", and not codes, such as "07"."""
    known = [text for text in texts if text]
    try:
        return any("." in text for text in known) and all(map(isfinite, map(float, known)))
    except ValueError:
        return False


def _is_number(one: Any) -> bool:
    return isinstance(one, _NUMBERS) and not isinstance(one, bool) and not _is_missing(one)


def _texts(values: list[Any]) -> NDArray[Any]:
    texts = np.empty(len(values), dtype=object)
    texts[:] = ["" if _is_missing(one) else str(one) for one in values]
    return texts


def _is_missing(one: Any) -> bool:
    return one is None or type(one).__name__ in ("NAType", "NaTType") or (isinstance(one, float) and one != one)  # noqa: PLR0124


def _by_role(heads: tuple[str, ...], arrays: list[NDArray[Any]], roles: Roles) -> tuple[list[Any], str | None]:
    """Columns as `table_movements` takes them, and the unit of times that are dates."""
    columns: list[Any] = list(arrays)
    for k in (*roles.movement, *(() if roles.label is None else (roles.label,))):
        columns[k] = _texts(arrays[k].tolist())
    for k in (*roles.positions, *roles.clocks, *(() if roles.nanoseconds is None else (roles.nanoseconds,))):
        columns[k] = _numbers(heads[k], arrays[k])
        if k in roles.positions and (integer := too_long_integer(arrays[k])) is not None:
            raise DataError(f"expected numbers in the column {heads[k]!r} that floats can hold, got {integer}{ROUNDED}")
    dates_in, k = None, roles.time
    if k is not None and arrays[k].dtype.kind in "Mm":
        columns[k], dates_in = nanoseconds(arrays[k]), "ns"
    elif k is not None and arrays[k].dtype.kind == "O":
        columns[k], others = seconds_of_dates(_texts(arrays[k].tolist()).tolist())
        if others:
            raise DataError(
                f"expected numbers or dates in the column of times {heads[k]!r}, got the text "
                f"{next(iter(others.values()))!r}; if it is a number, write frame.astype({{{heads[k]!r}: float}})"
            )
        dates_in = "s"
    elif k is not None:
        columns[k] = _numbers(heads[k], arrays[k])
    return columns, dates_in


def _numbers(head: str, values: NDArray[Any]) -> NDArray[np.float64]:
    if _KINDS.get(values.dtype.kind) != "number":
        i, got = next(((i, one) for i, one in enumerate(values.tolist()) if not _is_number(one)), (0, values[0]))
        raise DataError(
            f"expected numbers in the column {head!r}, got {got!r} in row {i}; repair it, as by "
            f"frame.astype({{{head!r}: float}}), or say columns="
        )
    return values.astype(np.float64)
