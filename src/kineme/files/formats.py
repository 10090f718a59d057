"""The table of formats: file extension -> reader."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from kineme.errors import DataError
from kineme.files.arrays.arrays import arrays_movements, parsed_arrays
from kineme.files.arrays.matlab import read_demos
from kineme.files.arrays.npz import Npz
from kineme.files.limits import check_expanded
from kineme.files.tables.parquet import read_parquet_table
from kineme.files.tables.text_table import read_text_table
from kineme.movements.tables.layout import Layout
from kineme.movements.tables.parsed import Parsed
from kineme.movements.tables.table import table_movements

_NUMBER, _LIST = 32, 88  # bytes of a Python object


class Format(NamedTuple):
    """The reader of a format, and whether the name of the file is the label of its movements."""

    read: Callable[[bytes, Layout], Parsed]
    label_is_stem: bool = False


def _read_text(data: bytes, layout: Layout) -> Parsed:
    return table_movements(*read_text_table(data, layout), layout, "CSV")


def _read_parquet(data: bytes, layout: Layout) -> Parsed:
    return table_movements(*read_parquet_table(data, layout), layout, "Parquet")


def _read_npz(data: bytes, layout: Layout) -> Parsed:
    return arrays_movements(Npz(data, Path("it")), layout, "NPZ")


def _read_json(data: bytes, layout: Layout) -> Parsed:
    lists = data.count(b"[") + data.count(b"{")
    check_expanded(len(data) + _NUMBER * data.count(b",") + _LIST * lists)
    try:
        entries = json.loads(data, object_pairs_hook=_each_once)
    except json.JSONDecodeError as error:
        raise DataError(f"expected JSON, got a truncated or damaged file ({error}); write it again") from error
    if not isinstance(entries, dict):
        raise DataError(f"expected an object with times and positions, got a {type(entries).__name__}")
    return arrays_movements(entries, layout, "JSON")


def _each_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    entries = dict(pairs)
    if len(entries) < len(pairs):
        twice = next(name for name in entries if sum(one == name for one, _ in pairs) > 1)
        raise DataError(f"expected each entry once, got {twice!r} several times")
    return entries


def _read_matlab(data: bytes, layout: Layout) -> Parsed:
    demos = read_demos(data)
    return parsed_arrays(
        demos.positions, demos.times, ([demos.name] * len(demos.times), "t"), layout, ("MATLAB", "demos")
    )


def _read_bag(data: bytes, layout: Layout) -> Parsed:
    raise DataError("a ROS bag, which is not supported yet; write its topics to CSV or Parquet")


#: File ending -> format. A reader raises a `DataError` or any `ValueError`, `KeyError` or `TypeError`.
FORMATS: dict[str, Format] = {
    ".csv": Format(_read_text),
    ".tsv": Format(_read_text),
    ".txt": Format(_read_text),
    ".npz": Format(_read_npz),
    ".json": Format(_read_json),
    ".parquet": Format(_read_parquet),
    ".mat": Format(_read_matlab, label_is_stem=True),
    ".bag": Format(_read_bag),
    ".db3": Format(_read_bag),
    ".mcap": Format(_read_bag),
}
