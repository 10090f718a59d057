"""C3D: the points of a motion capture recording; its parameters are read by the package of that name."""

from __future__ import annotations

import io
import warnings
from typing import Any

import numpy as np

from kineme.errors import DataError
from kineme.files.limits import check_expanded
from kineme.files.motion_capture.export_heads import without_common_subject
from kineme.movements.tables.columns import Roles, choose_roles
from kineme.movements.tables.layout import Layout
from kineme.movements.tables.parsed import no_lines
from kineme.movements.tables.table import Table

_STAMP = "time [s]"


def read_c3d_table(data: bytes, layout: Layout) -> tuple[Table, Roles]:
    """The positions of all points over time; a sample without its point is NaN.

    Raises
    ------
    DataError
        Not a C3D file, damaged, without points, or the package that reads it is not installed; the message names the
        extra.
    """
    try:
        import c3d
    except ImportError as error:
        raise DataError("expected the package c3d to read C3D files; pip install 'kineme[mocap]'") from error
    if data[1:2] != b"\x50":
        raise DataError("expected a C3D file, got something foreign")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of frames that are missing, which are counted below
            reader = c3d.Reader(io.BytesIO(data))
            points, names, unit, rate = _content(reader, data)
    except DataError:
        raise
    except Exception as error:  # the package raises much on damaged files, even names that it did not assign
        raise DataError(f"expected a C3D file, got a truncated or damaged one ({error})") from error
    heads = (_STAMP, *(f"{name}.{axis}" for name in without_common_subject(names) for axis in "xyz"))
    roles = choose_roles(heads, ("number",) * len(heads), layout)
    columns = [np.arange(len(points)) / rate, *points.reshape(len(points), -1).T]
    units = ("s", *(unit for _ in heads[1:]))
    return Table(heads, columns, len(points), no_lines, measured_in=units), roles


def _content(reader: Any, data: bytes) -> tuple[Any, list[str], str, float]:
    """Points (T, n, 3), their names, the unit of their positions, and the rate [Hz]."""
    count, rate = int(reader.point_used), float(reader.point_rate)
    n_frames = int(reader.last_frame) - int(reader.first_frame) + 1
    if count < 1 or n_frames < 1 or not 0 < rate < float("inf"):
        raise DataError(
            f"expected points over time in a C3D file, got {count} points and {n_frames} frames at {rate:g} Hz"
        )
    check_expanded(40 * count * n_frames)
    points = _points(reader, data, count, n_frames)
    labels = [label.strip() for label in reader.point_labels][:count]
    names = [label or f"point {k}" for k, label in enumerate([*labels, *[""] * (count - len(labels))], 1)]
    unit = reader.get("POINT:UNITS")
    return points, names, unit.string_value.strip() if unit is not None else "", rate


def _points(reader: Any, data: bytes, count: int, n_frames: int) -> Any:
    """Points (T, n, 3), NaN where one was not found. A frame is four words for each point, then its analog samples.

    The frames are not read by the package: it refuses files whose analog offsets are not whole numbers.
    """
    is_float = reader.point_scale < 0
    dtype = np.dtype(reader._dtypes.float32 if is_float else reader._dtypes.int16)
    if reader._dtypes.is_dec and is_float:
        raise DataError(
            "expected a C3D file of Intel or MIPS numbers, got one of DEC; save it anew with a newer program"
        )
    wide = 4 * count + int(reader.header.analog_count)
    start, size = (int(reader.header.data_block) - 1) * 512, n_frames * wide * dtype.itemsize
    if not 0 < start <= len(data) - size:
        raise DataError(
            f"expected {n_frames} frames of {count} points in a C3D file, got fewer bytes: a truncated file"
        )
    words = np.frombuffer(data, dtype, n_frames * wide, start).reshape(n_frames, wide)[:, : 4 * count]
    values = words.reshape(n_frames, count, 4).astype(np.float64)
    lost = (values[:, :, 3] < 0) | ~np.isfinite(values).all(axis=2)
    return np.where(lost[:, :, None], np.nan, values[:, :, :3] * (1.0 if is_float else abs(reader.point_scale)))
