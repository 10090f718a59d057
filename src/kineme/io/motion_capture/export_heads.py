"""The heads of text exports of motion capture systems: which columns there are, their units, and the rate."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

from kineme.errors import DataError
from kineme.movements.tables.time_stamps import UNIX
from kineme.movements.trajectories.movements import axis_names
from kineme.units import unit_named

_SECTIONS = ("trajectories", "segments", "objects", "joints", "model outputs", "devices")  # the first one there is read
_OTHERS = ("events",)
_QUATERNION = ("rx", "ry", "rz", "rw")

_FASTEST = 1000.0  # Hz
_EULER = re.compile(r"\b[xyz]{3}\b")
_FIRST = "PathFileType"
_EMPTY = " \t\r\n,;"  # what a line without values consists of

_POSES = ("x", "y", "z", "roll", "pitch", "yaw", "residual", *(f"rot[{k}]" for k in range(9)))

_EXPECTED = ("rigid body marker", "bone marker", "trained markerset marker")  # computed from the pose, not measured

_KEY = re.compile(
    r"(version|nrows|ncolumns|indegrees|datatype|datarate|opensimversion|num_\w+)\s*=|(datacolumns|datarows)\s+\d",
    re.IGNORECASE,
)
_END = "endheader"
_AXES = {"quaternion": "wxyz", "vec3": "xyz", "unitvec3": "xyz"}
#: A column that has one of these words is no coordinate, and its unit is not said by ``inDegrees``.
_OTHER = re.compile(
    r"force|torque|moment|activation|excitation|length|veloc|speed|accel|power|emg|fiber|tendon|control|reserve|residual"
    r"|(^|_)[vp][xyz]$|multiplier|lambda|/forceset/"
)
_TRANSLATION = re.compile(r"_t[xyz](/value)?$")
_NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)(e[-+]?\d+)?|nan", re.IGNORECASE)

STAMP = "time [s]"  # head of the times


class ExportHead(NamedTuple):
    """The head of an export, above its samples."""

    maker: str  # such as ``"OptiTrack"``
    separator: str | None  # None: blanks
    heads: tuple[str, ...]  # one per column; empty for columns that are not coordinates, such as residuals
    measured_in: tuple[str, ...]  # unit of each column, empty if unknown
    first: int  # line of the first sample, counted from 0
    end: int | None = None  # line after the last sample; None: the samples reach to the end of the file
    rate: float | None = None  # samples per second, where the head says it
    zeros_are_gaps: bool = False  # whether three zeros in place of a marker mean that it was not found
    start: float = 0.0  # time of the first sample [s], where the head says the rate
    packed: bool = False  # whether cells hold several numbers between commas; `heads` has one for each number

    @property
    def is_timed(self) -> bool:
        """True if a column has the times."""
        return STAMP in self.heads


def filled(cells: Iterable[str]) -> Iterator[str]:
    """Yield cells, the empty ones with what stands before them: names above the first of several columns."""
    last = ""
    for cell in cells:
        last = cell or last
        yield last


def positive(cell: str) -> float | None:
    """Return a cell as a rate, or None if it is none."""
    try:
        rate = float(cell.replace(",", "."))
    except ValueError:
        return None
    return rate if 0 < rate < float("inf") else None


def without_common_subject(names: Iterable[str]) -> list[str]:
    """Return names such as ``subject:marker`` without the subject where there is but one."""
    parts = [name.partition(":") for name in names]
    subjects = {first for first, colon, _ in parts if colon}
    return [rest if colon and len(subjects) == 1 else first + colon + rest for first, colon, rest in parts]


def opensim_head(lines: Sequence[str], cells_of: Callable[[str, str], list[str]]) -> ExportHead | None:
    """Return the head of a motion or storage file of OpenSim, or None if the first lines do not look like one.

    Source: OpenSim, "Motion (.mot) Files" and "Storage (.sto) Files". Lines such as ``inDegrees=yes``, or of SIMM
    ``datarows 153``, end with ``endheader``; then come a row of names, the first of them ``time``, and the samples.
    Where ``DataType`` says ``Quaternion`` or ``Vec3``, a cell holds several numbers between commas.
    """
    if not any(_KEY.match(line.strip().lstrip("\ufeff")) for line in lines[:3]):
        return None
    at = next((k for k, line in enumerate(lines) if line.strip().lower() == _END), None)
    if at is None:
        raise DataError(f"expected {_END!r} at the end of the head of an OpenSim file, got none")
    pairs = [line.partition("=") for line in lines[:at] if "=" in line]
    said = {key.strip().lower(): value.strip() for key, _, value in pairs}
    named = next((k for k in range(at + 1, len(lines)) if lines[k].strip()), None)
    sample = None if named is None else next((k for k in range(named + 1, len(lines)) if lines[k].strip()), None)
    if named is None or sample is None:
        raise DataError(f"expected names and samples below {_END!r} of an OpenSim file, got none")
    separator = "\t" if "\t" in lines[sample].strip() else None
    names = cells_of(lines[named], "\t") if "\t" in lines[named].strip() else lines[named].split()
    while names and not names[-1]:
        names.pop()
    if not names or names[0].lower() != "time":
        raise DataError(f"expected 'time' as first column of an OpenSim file, got {names[:1]}")
    kind = said.get("datatype", "double").lower()
    packed = kind not in ("double", "float", "int")
    heads, units = [STAMP], ["s"]
    if packed:
        cells = cells_of(lines[sample], "\t")[1:]
        for name, cell in zip(names[1:], cells, strict=False):
            n = cell.count(",") + 1
            axes = _AXES.get(kind, "") if n == len(_AXES.get(kind, "")) else [str(k) for k in range(n)]
            heads += [f"{name}.{axis}" for axis in axes]
            units += [said.get("units", "") if kind == "vec3" else ""] * n
    else:
        heads += names[1:]
        units += [_unit(name, said.get("indegrees", ""), lines[0]) for name in names[1:]]
    return ExportHead("OpenSim", separator, tuple(heads), tuple(units), named + 1, packed=packed)


def _unit(name: str, in_degrees: str, title: str) -> str:
    """Return the unit of a column, where ``inDegrees``, its name and the title tell it for certain."""
    plain = name.lower()
    coordinates = "coordinates" in title.lower() or plain.endswith("/value")
    if in_degrees.lower() not in ("yes", "no") or _OTHER.search(plain):
        return ""
    if any(word in title.lower() for word in ("force", "speed", "accel", "control", "activation")):
        return ""
    if _TRANSLATION.search(plain):
        return "m"
    return "deg" if in_degrees.lower() == "yes" else "rad" if coordinates else ""


def empatica_head(lines: Sequence[str], cells_of: Callable[[str, str], list[str]]) -> ExportHead | None:
    """Return the head of a sensor's file of an Empatica E4, or None if the first lines do not look like one.

    Source: Empatica, "E4 data: export format". A row of the time of the first sample, in seconds since 1970, a row of
    the rate, both once for each column, and the samples.
    """
    separator = next((mark for mark in ",;\t" if lines and mark in lines[0]), ",")
    rows = [cells_of(line, separator) for line in lines[:3]]
    if len(rows) < 3 or len({*map(len, rows)}) > 1 or any(len({*row}) > 1 for row in rows[:2]):
        return None
    start, rate = (positive(row[0]) for row in rows[:2])
    if start is None or not UNIX[0] <= start <= UNIX[1] or rate is None or rate > _FASTEST:
        return None
    heads = axis_names(len(rows[0]))
    return ExportHead("Empatica", separator, tuple(heads), ("",) * len(heads), 2, None, rate, start=start)


def optitrack_head(lines: Sequence[str], cells_of: Callable[[str, str], list[str]]) -> ExportHead | None:
    """Return the head of an export of Motive, or None if the first line does not look like one.

    Source: OptiTrack, "Data Export: CSV", versions 1.2 and later. The first line holds names and values in turn:
    ``Format Version,1.23,...,Length Units,Meters``. After an empty line there are rows with the type, the name, the id
    and more of each column, then one with what it holds, and the row of heads ``Frame,Time (Seconds),X``.
    """
    marks = (mark for mark in ",;\t" if lines and cells_of(lines[0], mark)[0].lower() == "format version")
    if (separator := next(marks, None)) is None:
        return None
    cells = cells_of(lines[0], separator)
    said = dict(zip((cell.lower() for cell in cells[::2]), cells[1::2], strict=False))
    rows = [cells_of(line, separator) for line in lines]
    at = next((k for k, row in enumerate(rows) if [cell.lower() for cell in row[:1]] == ["frame"]), None)
    if at is None:
        raise DataError("expected an OptiTrack export with a row of heads 'Frame, Time (Seconds), X, ...', got none")
    above = [row for row in rows[1:at] if any(row)]
    if len(above) < 3:
        raise DataError("expected an OptiTrack export with rows of types, names and contents above the heads")
    length = unit.symbol if (unit := unit_named(said.get("length units", ""))) is not None else ""
    n = len(rows[at])
    kinds, names, contents = ((row + [""] * n)[:n] for row in (above[0], above[1], above[-1]))
    solved = any(kind.lower() in ("rigid body", "bone") for kind in kinds)
    rotations = said.get("rotation type", "quaternion").lower()
    quaternions, order = "quaternion" in rotations, _EULER.search(rotations)
    # Of three angles the order is in the name where it is not that of most exports: others are other angles.
    turning = "orientation" if quaternions else f"rotation_{order[0]}" if order and order[0] != "xyz" else "rotation"
    timed = n > 1 and rows[at][1].lower().startswith("time")
    heads, units = ["frame", *[STAMP] * timed], ["", *["s"] * timed]
    before = len(heads)
    plain, axes = without_common_subject(names[before:]), [cell.lower() for cell in rows[at][before:]]
    for kind, name, content, axis in zip(kinds[before:], plain, contents[before:], axes, strict=True):
        what = content.lower()
        left_out = (solved and kind.lower() in _EXPECTED) or axis not in "xyzw" or not axis
        if left_out or what not in ("position", "rotation"):
            heads.append("")
        elif what == "position":
            heads.append(f"{name}.position.{axis}" if solved else f"{name}.{axis}")
        else:
            heads.append(f"{name}.{turning}.{axis}")
        units.append(
            "" if not heads[-1] or (what == "rotation" and quaternions) else "deg" if what == "rotation" else length
        )
    rate = positive(said.get("export frame rate") or said.get("capture frame rate") or "")
    return ExportHead("OptiTrack", separator, tuple(heads[:n]), tuple(units[:n]), at + 1, None, rate)


def qualisys_head(lines: Sequence[str], cells_of: Callable[[str, str], list[str]]) -> ExportHead | None:
    """Return the head of an export of Qualisys Track Manager, or None if the first line does not look like one.

    Source: Qualisys, "Motion data (.tsv)" and "6DOF data (.tsv)". Lines of a keyword, a tab and its value; then, if
    asked for, a row of heads; then the samples, with or without a frame and a time before them. Positions are in mm.
    """
    if not lines or lines[0].lstrip("\ufeff").split("\t")[0].strip() not in ("NO_OF_FRAMES", "FILE_VERSION"):
        return None
    said: dict[str, list[str]] = {}
    at = 0
    for line in lines:
        key, *values = cells_of(line, "\t")
        if not key.isupper() or not key.replace("_", "").isalnum():
            break
        said.setdefault(key, values)
        at += 1
    bodies = "BODY_NAMES" in said
    names = [name for name in said.get("BODY_NAMES" if bodies else "MARKER_NAMES", []) if name]
    if not names:
        raise DataError("expected a Qualisys export of 3D or 6DOF data with MARKER_NAMES or BODY_NAMES, got neither")
    row = cells_of(lines[at], "\t") if at < len(lines) else []
    headed = bool(row) and not any(_NUMBER.fullmatch(cell) for cell in row)
    at += headed
    sample = cells_of(lines[at], "\t") if at < len(lines) else []
    while sample and not sample[-1]:
        sample.pop()
    heads, units = _columns(names, bodies)
    before = ["frame", "time [s]"] if len(sample) == len(heads) + 2 else []
    n = len(heads) + len(before)
    if len(sample) != n:
        raise DataError(f"expected {n} columns for the names {names[:3]} ... of a Qualisys export, got {len(sample)}")
    rate = positive("".join(said.get("FREQUENCY", [])[:1]))
    if rate is None and not before:
        raise DataError(f"expected a FREQUENCY in hertz or a column of times, got {said.get('FREQUENCY')}")
    measured_in = (*("" for _ in before), *units)
    return ExportHead("Qualisys", "\t", (*before, *heads), measured_in, at, None, rate, zeros_are_gaps=True)


def _columns(names: Sequence[str], bodies: bool) -> tuple[list[str], list[str]]:
    """Return heads and units; residuals and the rotation matrix beside the angles are left aside."""
    if not bodies:
        return [f"{name}.{axis}" for name in names for axis in "xyz"], ["mm"] * 3 * len(names)
    groups = [("position.", "mm")] * 3 + [("", "deg")] * 3 + [("", "")] * 10
    heads = [
        f"{name}.{group}{what}" if unit else ""
        for name in names
        for what, (group, unit) in zip(_POSES, groups, strict=True)
    ]
    return heads, [unit for _ in names for _, unit in groups]


def trc_head(lines: Sequence[str], cells_of: Callable[[str, str], list[str]]) -> ExportHead | None:
    """Return the head of a TRC file, tracked markers over time, or None if the first line does not look like one.

    Source: OpenSim, "Marker (.trc) Files". A line ``PathFileType 4 (X/Y/Z) name.trc``, a row of keys and one of their
    values, a row with ``Frame#``, ``Time`` and the name above the first column of each marker, a row of axes
    ``X1 Y1 Z1``, mostly an empty line, and the samples; a program for tables may have made commas of the tabs.
    """
    first = lines[0].lstrip("\ufeff") if lines else ""
    if not first.startswith(_FIRST):
        return None
    separator = next((mark for mark in ",;" if first[len(_FIRST) :].startswith(mark)), "\t")
    if len(lines) < 6:
        raise DataError(f"expected a TRC file with keys, names and samples, got {len(lines)} lines")
    keys, values, names, axes = (cells_of(line, separator) for line in lines[1:5])
    said = dict(zip((key.lower() for key in keys), values, strict=False))
    if [cell.lower() for cell in names[:2]] != ["frame#", "time"]:
        raise DataError(f"expected the heads 'Frame#', 'Time' and names in line 4 of a TRC file, got {names[:2]}")
    # Names may end in more tabs than samples.
    n = max((k + 1 for k, cell in enumerate(axes) if cell), default=len(names))
    plain, ends = list(filled((names + [""] * n)[:n])), (axes + [""] * n)[:n]
    columns = [
        f"{name}.{end[0].lower()}" if end[:1] in "XYZ" and end else "" for name, end in zip(plain, ends, strict=True)
    ]
    unit = said.get("units", "")
    heads = ("frame", "time [s]", *columns[2:])
    measured_in = ("", "s", *(unit if head else "" for head in heads[2:]))
    first_sample = 5 if any(cells_of(lines[5], separator)) else 6
    rate = positive(said.get("datarate", ""))
    return ExportHead("TRC", separator, heads, measured_in, first_sample, None, rate, zeros_are_gaps=True)


def vicon_head(lines: Sequence[str], cells_of: Callable[[str, str], list[str]]) -> ExportHead | None:
    """Return the head of the first section of `_SECTIONS` in an export of Vicon, or None.

    Source: Vicon, "Nexus User Guide: Export data to ASCII". A section is a line with its name, one with its rate, a row
    with ``subject:marker`` above the first column of each, the row of heads ``Frame,Sub Frame,X,Y,Z,...``, a row of
    units, and the samples up to an empty line.
    """
    first = next((k for k, line in enumerate(lines) if line.strip(_EMPTY)), None)
    if first is None or _name(lines[first]) not in (*_SECTIONS, *_OTHERS):
        return None
    starts = {_name(line): k for k, line in reversed(list(enumerate(lines))) if _name(line) in _SECTIONS}
    section = next((name for name in _SECTIONS if name in starts), None)
    if section is None:
        raise DataError("expected a Vicon export with trajectories, segments or joints, got events alone")
    at = starts[section]
    if len(lines) < at + 5:
        raise DataError(f"expected samples below the section {section!r} of a Vicon export, got its head alone")
    separator = next((mark for mark in "\t;" if mark in lines[at + 3]), ",")
    rate = positive(lines[at + 1].strip(_EMPTY))
    names, heads, units = (cells_of(line, separator) for line in lines[at + 2 : at + 5])
    if rate is None or not heads or heads[0].lower() != "frame":
        raise DataError(f"expected a rate, names and the heads 'Frame, Sub Frame, ...' below the section {section!r}")
    n = len(heads)
    plain = without_common_subject(filled((names + [""] * n)[:n]))
    turned = [False] * n  # columns of RX, RY, RZ, RW side by side
    for k in range(n - 3):
        if tuple(head.lower() for head in heads[k : k + 4]) == _QUATERNION:
            turned[k : k + 4] = [True] * 4
    columns = [_head(section, *column) for column in zip(plain, heads[:n], turned, strict=True)]
    columns[0] = "frame"
    columns[1] = "sub frame" if n > 1 and heads[1].lower() == "sub frame" else columns[1]
    end = next((k for k in range(at + 5, len(lines)) if not lines[k].strip(_EMPTY)), None)
    measured_in = tuple(
        "" if quaternion else unit for unit, quaternion in zip((units + [""] * n)[:n], turned, strict=True)
    )
    return ExportHead("Vicon", separator, tuple(columns), measured_in, at + 5, end, rate)


def _name(line: str) -> str:
    return line.strip(f"{_EMPTY}\ufeff").lower()


def _head(section: str, name: str, head: str, quaternion: bool) -> str:
    axis = head.lower()
    name = name.removeprefix("Global Angle (Quaternion) ")
    if quaternion:
        return f"{name}.orientation.{axis[1]}"
    if section in ("segments", "objects") and len(axis) == 2 and axis[0] in "rt" and axis[1] in "xyz":
        return f"{name}.{'rotation' if axis[0] == 'r' else 'position'}.{axis[1]}"
    return f"{name}.{axis if axis in ('x', 'y', 'z') else head}"
