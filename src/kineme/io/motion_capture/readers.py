"""Files of motion capture systems as tables: C3D, BVH and MVNX.

Sources: of C3D, Motion Lab Systems, "The C3D File Format User Guide", and of its rotations C-Motion,
"ROTATION_DATA_TYPE": for each frame and segment 16 numbers of a matrix, column by column, and one that is negative
where it is unknown. Of BVH, Meredith and Maddock, "Motion Capture File Formats Explained", 2001; rotations are in
degrees, positions in a unit that no file says. Of MVNX, Xsens, "MVN User Manual": ``<segments>`` and ``<joints>`` name
what the numbers of each ``<frame time="16" type="normal">`` are of, in meters, degrees and milliseconds.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Sequence
from itertools import islice
from typing import Any
from xml.parsers import expat

import numpy as np

from kineme.errors import DataError
from kineme.io.limits import check_expanded
from kineme.io.motion_capture.export_heads import STAMP, positive, without_common_subject
from kineme.io.records import damaged_as, needs
from kineme.movements.channels.column_match import Columns
from kineme.movements.tables.columns import Roles, choose_roles
from kineme.movements.tables.layout import Layout, distinct, no_lines
from kineme.movements.tables.table import Segments, Table

_DEEPEST = 32
_MOST = 10_000  # segments and joints, or channels
_MOST_LABELS = 260  # parameters of labels, of 255 each
_COMPUTED = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS")  # parameters that list such points
_OFF = 1e-2  # of a matrix that counts as a rotation, from orthonormal


#: Element of a frame -> whose numbers it holds, what columns are called, and their unit. Those of segments are learned
#: unless columns are chosen.
_QUANTITIES = {
    "position": ("segment", [f"position.{axis}" for axis in "xyz"], "m"),
    "orientation": ("segment", [f"orientation.{axis}" for axis in "wxyz"], ""),
    "jointAngle": ("joint", [f"angle.{axis}" for axis in "xyz"], "deg"),
}


class _Content:
    """What an MVNX file says of one subject."""

    def __init__(self, path: Sequence[str] = ()) -> None:
        self.rate = self.label = ""
        self.names: dict[str, list[str]] = {"segment": [], "joint": []}
        self.stamps: list[str] = []
        self.texts: dict[str, list[str]] = {name: [] for name in _QUANTITIES}
        self.path = [*path]
        self._is_normal = False
        self._text: list[str] | None = None

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        name = tag.rpartition(":")[2]
        self.path.append(name)
        if len(self.path) > _DEEPEST:
            raise DataError(f"expected MVNX of at most {_DEEPEST} elements within each other, got more")
        if name == "subject":
            self.rate, self.label = attributes.get("frameRate", ""), attributes.get("label", "")
        elif name in self.names and self.path[-2:-1] == [f"{name}s"]:
            self.names[name].append(attributes.get("label", f"{name} {len(self.names[name]) + 1}"))
            if len(self.names[name]) > _MOST:
                raise DataError(f"expected at most {_MOST:,} {name}s in MVNX, got more")
        elif name == "frame":
            self._is_normal = attributes.get("type", "normal") == "normal"
            if self._is_normal:
                self.stamps.append(attributes.get("time", ""))
        elif self._is_normal and name in _QUANTITIES and self.path[-2:-1] == ["frame"]:
            self._text = []

    def end(self, tag: str) -> None:
        name = self.path.pop()
        if self._text is not None and name in _QUANTITIES:
            texts = self.texts[name]
            texts += [""] * (len(self.stamps) - 1 - len(texts))  # frames before that lack it
            texts.append("".join(self._text))
            self._text = None
        elif name == "frame":
            self._is_normal = False

    def characters(self, text: str) -> None:
        if self._text is not None:
            self._text.append(text)


def read_mvnx_table(data: bytes, layout: Layout) -> tuple[Table, Roles]:
    """Read an MVNX file: ``Pelvis.position.x``, ``Pelvis.orientation.w``; angles where there are no segments."""
    check_expanded(3 * len(data))
    subjects = [content for content in _parsed(data) if content.stamps]
    if not subjects:
        raise DataError("expected frames of type 'normal' in an MVNX file, got none")
    heads, units, columns, faults = _columns(subjects[0])
    parts = [columns]
    offsets = np.cumsum([0, *(len(content.stamps) for content in subjects)])
    for content, first in zip(subjects[1:], offsets[1:].tolist(), strict=False):
        names, _, more, wrong = _columns(content)
        if names != heads:
            raise DataError(
                "expected the same segments and joints of all subjects of an MVNX file, got others of "
                f"{content.label!r} than of {subjects[0].label!r}; export each to a file of its own"
            )
        parts.append(more)
        faults |= {first + row: reason for row, reason in wrong.items()}
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    places = distinct([content.label or "subject" for content in subjects])
    several = Segments(offsets, [*places], [None] * len(places)) if len(places) > 1 else None
    roles = choose_roles(heads, ("number",) * len(heads), layout)
    segments = tuple(k for k in roles.positions if ".angle." not in heads[k])
    if layout.coordinates is None and segments:
        others = tuple(k for k in roles.positions if k not in {*segments})
        roles = roles._replace(positions=segments, ignored=(*roles.ignored, *others))
    n_rows = int(offsets[-1])
    return Table(tuple(heads), columns, n_rows, no_lines, faults, None, units, several, "Xsens"), roles


def _columns(content: _Content) -> tuple[list[str], list[str], list[Any], dict[int, str]]:
    """Return heads, units and values of the columns of a subject, and what is wrong in which frame."""
    count = len(content.stamps)
    heads, units, columns, faults = [STAMP], ["s"], [_times(content)], dict[int, str]()
    for name, (kind, ends, unit) in _QUANTITIES.items():
        owners = content.names[kind]
        if not any(content.texts[name]) or not owners:
            continue
        width = len(owners) * len(ends)
        check_expanded(16 * count * width)
        heads += [f"{owner}.{end}" for owner in owners for end in ends]
        units += [unit] * width
        texts = content.texts[name] + [""] * (count - len(content.texts[name]))
        values, wrong = _numbers(texts, width, f" in {name!r}")
        # What a frame lacks altogether is a gap.
        faults |= {row: reason for row, reason in wrong.items() if texts[row].strip()}
        columns += [*values.T]
    if len(heads) == 1:
        raise DataError(f"expected {', '.join(_QUANTITIES)} in the frames of an MVNX file, got none of them")
    return heads, units, columns, faults


def _parsed(data: bytes) -> list[_Content]:
    contents, parser = [_Content()], expat.ParserCreate()
    parser.buffer_text = True

    def start(tag: str, attributes: dict[str, str]) -> None:
        if tag.rpartition(":")[2] == "subject" and any(contents[-1].names.values()):  # another one
            contents.append(_Content(contents[-1].path))
        contents[-1].start(tag, attributes)
        parser.EndElementHandler, parser.CharacterDataHandler = contents[-1].end, contents[-1].characters

    parser.StartElementHandler = start
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = _refuse
    with damaged_as("expected an MVNX file, got something foreign, truncated or damaged", expat.ExpatError):
        parser.Parse(data, True)
    return contents


def _refuse(*_: Any) -> None:
    raise DataError("expected MVNX without a document type, got one, which may hold entities that grow without bound")


def _times(content: _Content) -> Any:
    """Give seconds, from the stamps of the frames [ms], or from the rate where these are missing or do not increase."""
    try:
        times = np.array([float(stamp) for stamp in content.stamps]) / 1e3
    except ValueError:
        times = np.zeros(len(content.stamps))
    rate = positive(content.rate)
    even = np.arange(len(times)) / (rate or 1.0)
    if rate is not None and np.abs(times - times[0] - even).max() <= 1e-3:  # stamps are whole milliseconds
        return even + times[0]
    if (np.diff(times) > 0).all():
        return times
    if rate is None:
        raise DataError(f"expected a frameRate in hertz or times of frames in an MVNX file, got {content.rate!r}")
    return even


def _numbers(texts: Sequence[str], width: int, where: str) -> tuple[Any, dict[int, str]]:
    """Parse the numbers (T, width) of all frames, NaN in one that has not so many, and say what is wrong there."""
    values, faults = np.full((len(texts), width), np.nan), {}
    for row, text in enumerate(texts):
        words = text.split()
        if len(words) != width:
            faults[row] = f"expected {width} numbers{where}, got {len(words)}"
            continue
        try:
            values[row] = [float(word) for word in words]
        except ValueError:
            faults[row] = f"expected {width} numbers{where}, got {text.strip()[:40]!r}"
    return values, faults


def read_c3d_table(data: bytes, layout: Layout) -> tuple[Table, Roles]:
    """Read the positions of points, else the poses of segments, NaN where lost; the others if columns name them."""
    with needs("c3d", "read C3D files", "mocap"):
        import c3d
    if data[1:2] != b"\x50":
        raise DataError("expected a C3D file, got something foreign")
    # The package raises much on damaged files, even names that it did not assign.
    with damaged_as("expected a C3D file, got a truncated or damaged one", Exception), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of frames that are missing, which are counted below
        reader = c3d.Reader(io.BytesIO(data))
        names, values, units, rate = _content(reader, data)
        is_point = [True] * len(names)
        if int(reader.point_used) > 0:
            computed = [unit for unit in _computed(reader, len(names) // 3) for _ in "xyz"]
            is_point = [unit is None for unit in computed]
            units = [own if unit is None else unit for own, unit in zip(units, computed, strict=True)]
            used = reader.get("ROTATION:USED")
            if used is not None and used.int16_value > 0:  # the poses of segments beside points
                owners, poses, measured_in, same = _rotations(reader, data, len(values), units[0])
                if same == rate and len(poses) == len(values):
                    names, values, units = [*names, *owners], np.hstack([values, poses]), [*units, *measured_in]
                    is_point += [False] * len(owners)
    heads = (STAMP, *names)
    is_read = is_point if layout.coordinates is None and any(is_point) else [True] * len(names)
    kinds = ("number", *("number" if is_number else "text" for is_number in is_read))
    roles = choose_roles(heads, kinds, layout)
    columns = [np.arange(len(values)) / rate, *values.T]
    return Table(heads, columns, len(values), no_lines, measured_in=("s", *units)), roles


def _content(reader: Any, data: bytes) -> tuple[list[str], Any, list[str], float]:
    """Return names of the columns, their values (T, d), their units, and the rate [Hz]."""
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


def _computed(reader: Any, count: int) -> list[str | None]:
    """Return the unit of each point that holds an angle, a force or the like, as of Vicon's Plug-in Gait, else None."""
    unit_of: dict[str, str] = {}
    for kind in _COMPUTED:
        unit = reader.get(f"POINT:{kind.removesuffix('S')}_UNITS")
        said = unit.string_value.strip() if unit is not None else ""
        unit_of |= {label.strip(): said for label in _labels(reader, "POINT", kind)}
    labels = [label.strip() for label in _labels(reader, "POINT")][:count]
    return [*(unit_of.get(label) if label else None for label in labels), *[None] * (count - len(labels))]


def _labels(reader: Any, group: str, kind: str = "LABELS") -> list[str]:
    """Return all labels of points or rotations; of more than 255 the others are in LABELS2, LABELS3 and so on."""
    labels: list[str] = []
    for name in (kind, *(f"{kind}{k}" for k in range(2, _MOST_LABELS))):
        if (parameter := reader.get(f"{group}:{name}")) is None:
            break
        labels += np.ravel(parameter.string_array).tolist()
    return labels


def _names(labels: Any, count: int, what: str) -> list[str]:
    """Return a name for each of so many points or segments, numbered where the file has none."""
    names = [label.strip() for label in labels][:count]
    return [label or f"{what} {k}" for k, label in enumerate([*names, *[""] * (count - len(names))], 1)]


def _rotations(reader: Any, data: bytes, n_frames: int, length: str) -> tuple[list[str], Any, list[str], float]:
    """Return positions and orientations of segments, as `_content`; NaN where a matrix is unknown or no rotation."""
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


def read_bvh_table(data: bytes, layout: Layout) -> tuple[Table, Roles]:
    """Read the channels of a BVH file and its time stamps, from the time of a frame."""
    check_expanded(3 * len(data))
    lines = data.decode("utf-8", "replace").lstrip("\ufeff").splitlines()
    if not lines or next((line.strip() for line in lines if line.strip()), "").upper() != "HIERARCHY":
        raise DataError("expected a BVH file that begins with HIERARCHY, got something foreign")
    at = next((k for k, line in enumerate(lines) if line.strip().upper() == "MOTION"), None)
    if at is None:
        raise DataError("expected MOTION below the hierarchy of a BVH file, got none: a truncated file")
    channels = _channels(lines[:at])
    step, first = _step(lines, at)
    values, faults = _values(lines, first, len(channels))
    heads = (STAMP, *channels)
    units = ("s", *("deg" if name.lower().endswith("rotation") else "" for name in channels))
    columns = [np.arange(len(values)) * step, *values.T]
    numbered = [k for k in range(first, len(lines)) if lines[k].strip()]
    table = Table(heads, columns, len(values), lambda row: numbered[row] + 1, faults, measured_in=units, maker="")
    roles = choose_roles(heads, ("number",) * len(heads), layout)
    # Refuse rotations of a joint in another order than that of the file, which says which axis turns first.
    chosen, of_file = (
        Columns(tuple(heads[k] for k in places), ()).rotations for places in (roles.positions, sorted(roles.positions))
    )
    for joint, axes in chosen.items():
        if axes != of_file[joint]:
            raise DataError(
                f"expected the rotations of {joint!r} in the order {of_file[joint]}, as the file has them, got {axes}, "
                "which are other angles of the same turns; export all files in one order"
            )
    return table, roles


def _channels(lines: Sequence[str]) -> list[str]:
    joint, names = "", []
    for k, line in enumerate(lines, 1):
        words = line.split()
        key = words[0].upper() if words else ""
        if key in ("ROOT", "JOINT"):
            joint = " ".join(words[1:])
        elif key == "CHANNELS":
            count = words[1] if len(words) > 1 else ""
            if not joint or not count.isdecimal() or int(count) != len(words) - 2:
                raise DataError(
                    f"expected a joint's number of channels and their names in line {k}, got {line.strip()!r}"
                )
            names += [f"{joint}.{channel}" for channel in words[2:]]
    if not 0 < len(names) <= _MOST:
        raise DataError(f"expected joints with channels in the hierarchy of a BVH file, got {len(names)} channels")
    return names


def _step(lines: Sequence[str], at: int) -> tuple[float, int]:
    """Return seconds between frames, and the line of the first frame, counted from 0."""
    for k, line in enumerate(islice(lines, at + 1, at + 6), at + 1):
        key, colon, value = line.partition(":")
        if colon and key.strip().lower() == "frame time":
            if (step := positive(value.strip())) is None:
                raise DataError(f"expected the time of a frame above 0 s in line {k + 1}, got {value.strip()!r}")
            return step, k + 1
    raise DataError("expected 'Frame Time: SECONDS' below MOTION, got none: a truncated or damaged file")


def _values(lines: Sequence[str], first: int, width: int) -> tuple[Any, dict[int, str]]:
    rows = [line for line in lines[first:] if line.strip()]
    if not rows:
        raise DataError("expected frames below the time of a frame, got none")
    check_expanded(8 * width * len(rows))
    try:
        values = np.loadtxt(io.StringIO("\n".join(rows)), comments=None, ndmin=2)
        if values.shape == (len(rows), width):
            return values, {}
    except ValueError:
        pass
    return _numbers(rows, width, ", one for each channel")
