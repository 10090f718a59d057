"""C3D: the points or rotations of a motion capture recording; its parameters are read by the package of that name.

Source: Motion Lab Systems, "The C3D File Format User Guide"; of rotations C-Motion, "ROTATION_DATA_TYPE": for each
frame and segment 16 numbers of a matrix, column by column, that turns and shifts it, and one that is negative where it
is unknown.
"""

from __future__ import annotations

import io
import warnings
from typing import Any

import numpy as np

from kineme.errors import DataError
from kineme.io.limits import check_expanded
from kineme.io.motion_capture.export_heads import without_common_subject
from kineme.io.records import needs
from kineme.movements.tables.columns import Roles, choose_roles
from kineme.movements.tables.layout import Layout, no_lines
from kineme.movements.tables.table import Table

_STAMP = "time [s]"
_MOST_LABELS = 260  # parameters of labels, of 255 each
_COMPUTED = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS")  # parameters that list such points
_OFF = 1e-2  # of a matrix that counts as a rotation, from orthonormal


def read_c3d_table(data: bytes, layout: Layout) -> tuple[Table, Roles]:
    """The positions of all points over time, of a file without points the poses of all segments; what is lost is NaN.

    Poses of segments beside points, and what a model computed instead of places, as the angles of joints, are left
    aside unless columns name them.
    """
    with needs("c3d", "read C3D files", "mocap"):
        import c3d
    if data[1:2] != b"\x50":
        raise DataError("expected a C3D file, got something foreign")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of frames that are missing, which are counted below
            reader = c3d.Reader(io.BytesIO(data))
            names, values, units, rate = _content(reader, data)
            is_point = [True] * len(names)
            if int(reader.point_used) > 0:
                computed = [unit for unit in _computed(reader, len(names) // 3) for _ in "xyz"]
                is_point = [unit is None for unit in computed]
                units = [own if unit is None else unit for own, unit in zip(units, computed, strict=True)]
            if int(reader.point_used) > 0 and (segments := _beside(reader, data, rate, len(values), units[0])):
                names, values = [*names, *segments[0]], np.hstack([values, segments[1]])
                units = [*units, *segments[2]]
                is_point += [False] * len(segments[0])
    except DataError:
        raise
    except Exception as error:  # the package raises much on damaged files, even names that it did not assign
        raise DataError(f"expected a C3D file, got a truncated or damaged one ({error})") from error
    heads = (_STAMP, *names)
    is_read = is_point if layout.coordinates is None and any(is_point) else [True] * len(names)
    kinds = ("number", *("number" if is_number else "text" for is_number in is_read))
    roles = choose_roles(heads, kinds, layout)
    columns = [np.arange(len(values)) / rate, *values.T]
    return Table(heads, columns, len(values), no_lines, measured_in=("s", *units)), roles


def _content(reader: Any, data: bytes) -> tuple[list[str], Any, list[str], float]:
    """Names of the columns, their values (T, d), their units, and the rate [Hz]."""
    count, rate = int(reader.point_used), float(reader.point_rate)
    n_frames = int(reader.last_frame) - int(reader.first_frame) + 1
    unit = reader.get("POINT:UNITS")
    length = unit.string_value.strip() if unit is not None else ""
    if count < 1 and n_frames > 0 and reader.get("ROTATION:USED") is not None:
        return _rotations(reader, data, n_frames, length)
    if count < 1 or n_frames < 1 or not 0 < rate < float("inf"):
        raise DataError(
            f"expected points over time in a C3D file, got {count} points and {n_frames} frames at {rate:g} Hz"
        )
    check_expanded(40 * count * n_frames)
    # Points (T, n, 3), NaN where one was not found. A frame is four words for each point, then its analog samples.
    # The package refuses files whose analog offsets are not whole numbers; so the frames are not read by it.
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
    lost = (values[:, :, 3] < 0) | ~np.isfinite(values).all(axis=2) | (values[:, :, :3] == 0).all(axis=2)
    points = np.where(lost[:, :, None], np.nan, values[:, :, :3] * (1.0 if is_float else abs(reader.point_scale)))
    names = without_common_subject(_names(_labels(reader, "POINT"), count, "point"))
    heads = [f"{name}.{axis}" for name in names for axis in "xyz"]
    return heads, points.reshape(n_frames, -1), [length] * len(heads), rate


def _beside(
    reader: Any, data: bytes, rate: float, n_frames: int, length: str
) -> tuple[list[str], Any, list[str]] | None:
    """The poses of segments beside points, as `_content`; None where there are none of the same rate."""
    used = reader.get("ROTATION:USED")
    if used is None or used.int16_value < 1:
        return None
    names, values, units, same = _rotations(reader, data, n_frames, length)
    return (names, values, units) if same == rate and len(values) == n_frames else None


def _computed(reader: Any, count: int) -> list[str | None]:
    """Return the unit of each point that holds an angle, a force, a moment or a power; None of places.

    Source: Vicon's Plug-in Gait, which lists the points of each kind in parameters such as POINT:ANGLES.
    """
    unit_of: dict[str, str] = {}
    for kind in _COMPUTED:
        unit = reader.get(f"POINT:{kind.removesuffix('S')}_UNITS")
        said = unit.string_value.strip() if unit is not None else ""
        unit_of |= {label.strip(): said for label in _labels(reader, "POINT", kind)}
    labels = [label.strip() for label in _labels(reader, "POINT")][:count]
    return [*(unit_of.get(label) if label else None for label in labels), *[None] * (count - len(labels))]


def _labels(reader: Any, group: str, kind: str = "LABELS") -> list[str]:
    """All labels of points or rotations; of more than 255 the others are in LABELS2, LABELS3 and so on."""
    labels: list[str] = []
    for name in (kind, *(f"{kind}{k}" for k in range(2, _MOST_LABELS))):
        if (parameter := reader.get(f"{group}:{name}")) is None:
            break
        labels += np.ravel(parameter.string_array).tolist()
    return labels


def _names(labels: Any, count: int, what: str) -> list[str]:
    """A name for each of so many points or segments, numbered where the file has none."""
    names = [label.strip() for label in labels][:count]
    return [label or f"{what} {k}" for k, label in enumerate([*names, *[""] * (count - len(names))], 1)]


def _rotations(reader: Any, data: bytes, n_frames: int, length: str) -> tuple[list[str], Any, list[str], float]:
    """Positions and orientations of segments, as `_content`; NaN where a matrix is unknown or no rotation."""
    said = {name: reader.get(f"ROTATION:{name}") for name in ("USED", "DATA_START", "RATIO", "RATE")}
    count, block = (0 if said[name] is None else said[name].int16_value for name in ("USED", "DATA_START"))
    ratio = 1 if said["RATIO"] is None else max(1, said["RATIO"].int16_value)
    rate = float(reader.point_rate) * ratio
    rate = rate if rate > 0 or said["RATE"] is None else said["RATE"].float_value
    if count < 1 or not 0 < rate < float("inf"):
        raise DataError(f"expected points or rotations over time in a C3D file, got {count} rotations at {rate:g} Hz")
    n_samples, start = n_frames * ratio, (block - 1) * 512
    check_expanded(3 * 8 * 17 * count * n_samples)
    if not 0 < start <= len(data) - 4 * 17 * count * n_samples:
        raise DataError(f"expected {n_samples} samples of {count} rotations in a C3D file, got fewer: a truncated file")
    dtype = np.dtype(reader._dtypes.float32)
    words = np.frombuffer(data, dtype, 17 * count * n_samples, start).reshape(n_samples * count, 17).astype(np.float64)
    poses = words[:, :16].reshape(-1, 4, 4).transpose(0, 2, 1)
    turns = poses[:, :3, :3]
    with np.errstate(invalid="ignore", over="ignore"):
        off = np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
        is_rotation = (words[:, 16] >= 0) & (off < _OFF) & (np.linalg.det(turns) > 0)
    values = np.full((len(poses), 7), np.nan)
    if is_rotation.any():
        from scipy.spatial.transform import Rotation

        values[is_rotation, :3] = poses[is_rotation, :3, 3]
        values[is_rotation, 3:] = Rotation.from_matrix(turns[is_rotation]).as_quat(scalar_first=True)
    names = [
        name.removesuffix("_4X4")
        for name in without_common_subject(_names(_labels(reader, "ROTATION"), count, "segment"))
    ]
    ends = [*(f"position.{axis}" for axis in "xyz"), *(f"orientation.{axis}" for axis in "wxyz")]
    heads = [f"{name}.{end}" for name in names for end in ends]
    return heads, values.reshape(n_samples, -1), [*[length] * 3, *[""] * 4] * count, rate
