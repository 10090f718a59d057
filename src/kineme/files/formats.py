"""The tables of formats: file extension -> reader, and what marks a folder that is one data set -> reader."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from kineme.errors import DataError
from kineme.files.arrays.arrays import arrays_movements, parsed_arrays
from kineme.files.arrays.matlab import read_demos
from kineme.files.arrays.npz import Npz
from kineme.files.limits import check_expanded
from kineme.files.ros.read_bag import read_bag
from kineme.files.tables.parquet import read_parquet_table
from kineme.files.tables.text_table import read_text_table
from kineme.movements.tables.layout import Layout
from kineme.movements.tables.parsed import Parsed
from kineme.movements.tables.table import table_movements

_NUMBER, _LIST = 32, 88  # bytes of a Python object


class Format(NamedTuple):
    """The reader of a format: of the bytes of a file, or of its path.

    A reader of a path keeps only what it returns, so that files may be larger than the memory; it alone checks
    `kineme.files.limits`, against what it keeps. `read_bytes` or `read_path` is given, never both.

    Attributes
    ----------
    read_bytes, read_path : callable or None
    label_is_stem : bool
        Whether the name of the file is the label of its movements.
    """

    read_bytes: Callable[[bytes, Layout], Parsed] | None = None
    read_path: Callable[[Path, Layout], Parsed] | None = None
    label_is_stem: bool = False


class DataSet(NamedTuple):
    """A folder that is one source: its files have a meaning only together.

    Attributes
    ----------
    marker : str
        Path of the file that makes a folder such a data set.
    beside : tuple of str
        Patterns of file names in the folder, one of which must be there too; empty if the marker is enough.
    parts : tuple of str
        Patterns of the files that are read; their bytes identify the source.
    format : Format
        It reads the path of the folder.
    """

    marker: str
    beside: tuple[str, ...]
    parts: tuple[str, ...]
    format: Format

    def files(self, folder: Path) -> list[Path]:
        """The files that are read, sorted; hidden ones are passed over."""
        found = {path for pattern in (self.marker, *self.parts) for path in folder.glob(pattern) if path.is_file()}
        relative = sorted(path.relative_to(folder) for path in found)
        return [folder / one for one in relative if not any(part.startswith(".") for part in one.parts)]


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


#: File ending -> format. A reader raises a `DataError` or any `ValueError`, `KeyError` or `TypeError`.
FORMATS: dict[str, Format] = {
    ".csv": Format(_read_text),
    ".tsv": Format(_read_text),
    ".txt": Format(_read_text),
    ".npz": Format(_read_npz),
    ".json": Format(_read_json),
    ".parquet": Format(_read_parquet),
    ".mat": Format(_read_matlab, label_is_stem=True),
    ".bag": Format(read_path=read_bag),
    ".db3": Format(read_path=read_bag),
    ".mcap": Format(read_path=read_bag),
}

#: Folders that are one source.
DATA_SETS: tuple[DataSet, ...] = (
    DataSet("metadata.yaml", ("*.db3*", "*.mcap*"), ("*.db3*", "*.mcap*"), Format(read_path=read_bag)),
)


def data_set_of(folder: Path) -> DataSet | None:
    """The row of `DATA_SETS` for a folder; None for a folder of files and for what is no folder."""
    return next((one for one in DATA_SETS if _is_marked(folder, one)), None)


def _is_marked(folder: Path, data_set: DataSet) -> bool:
    try:
        return (folder / data_set.marker).is_file() and (not data_set.beside or any(_matches(folder, data_set.beside)))
    except OSError:
        return False


def _matches(folder: Path, patterns: tuple[str, ...]) -> Iterator[Path]:
    return (path for pattern in patterns for path in folder.glob(pattern))
