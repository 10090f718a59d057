"""The table of formats: file extension -> reader."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from kineme.errors import DataError
from kineme.files.arrays.arrays import POSITIONS, arrays_movements, parsed_arrays
from kineme.files.arrays.json_trees import json_lines_movements, json_movements
from kineme.files.arrays.matlab import read_demos
from kineme.files.arrays.npz import Npz, array_of_npy
from kineme.files.arrays.tree_movements import nested, tree_movements
from kineme.files.motion_capture.bvh import read_bvh_table
from kineme.files.motion_capture.c3d import read_c3d_table
from kineme.files.tables.parquet import read_parquet_table
from kineme.files.tables.text_table import read_text_table
from kineme.movements.tables.layout import Layout
from kineme.movements.tables.parsed import Parsed
from kineme.movements.tables.table import table_movements


class Format(NamedTuple):
    """The reader of a format, and whether the name of the file is the label of its movements."""

    read: Callable[[bytes, Layout], Parsed]
    label_is_stem: bool = False


def _read_text(data: bytes, layout: Layout) -> Parsed:
    return table_movements(*read_text_table(data, layout), layout, "CSV")


def _read_parquet(data: bytes, layout: Layout) -> Parsed:
    return table_movements(*read_parquet_table(data, layout), layout, "Parquet")


def _read_npz(data: bytes, layout: Layout) -> Parsed:
    arrays = Npz(data, Path("it"))
    known = any(name in arrays or f"{name}_0" in arrays for name in POSITIONS)
    return arrays_movements(arrays, layout, "NPZ") if known or not arrays else _read_keyed(arrays, layout)


def _read_keyed(arrays: Npz, layout: Layout) -> Parsed:
    return tree_movements(nested(arrays), layout, "NPZ")


def _read_npy(data: bytes, layout: Layout) -> Parsed:
    return arrays_movements({POSITIONS[0]: array_of_npy(data, Path("it"))}, layout, "NPY")


def _read_matlab(data: bytes, layout: Layout) -> Parsed:
    demos = read_demos(data)
    return parsed_arrays(
        demos.positions, demos.times, ([demos.name] * len(demos.times), "t"), layout, ("MATLAB", "demos")
    )


def _read_bvh(data: bytes, layout: Layout) -> Parsed:
    return table_movements(*read_bvh_table(data, layout), layout, "BVH")


def _read_c3d(data: bytes, layout: Layout) -> Parsed:
    return table_movements(*read_c3d_table(data, layout), layout, "C3D")


def _read_bag(data: bytes, layout: Layout) -> Parsed:
    raise DataError("a ROS bag, which is not supported yet; write its topics to CSV or Parquet")


#: File ending -> format. A reader raises a `DataError` or any `ValueError`, `KeyError` or `TypeError`.
FORMATS: dict[str, Format] = {
    ".csv": Format(_read_text),
    ".tsv": Format(_read_text),
    ".txt": Format(_read_text),
    ".npz": Format(_read_npz),
    ".npy": Format(_read_npy),
    ".json": Format(json_movements),
    ".jsonl": Format(json_lines_movements),
    ".parquet": Format(_read_parquet),
    ".mat": Format(_read_matlab, label_is_stem=True),
    ".bvh": Format(_read_bvh),
    ".c3d": Format(_read_c3d),
    ".bag": Format(_read_bag),
    ".db3": Format(_read_bag),
    ".mcap": Format(_read_bag),
}
