"""CSV and text exports of Vicon Nexus, Tracker and Shogun.

Source: Vicon, "Nexus User Guide: Export data to ASCII". A file has one or more sections: a line with the name of the
section, a line with its rate, a row with ``subject:marker`` above the first column of each, the row of heads
``Frame,Sub Frame,X,Y,Z,...``, a row of units, and the samples up to an empty line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from kineme.errors import DataError
from kineme.io.motion_capture.export_heads import ExportHead, filled, positive, without_common_subject

_SECTIONS = ("trajectories", "segments", "objects", "joints", "model outputs", "devices")  # the first one there is read
_OTHERS = ("events",)
_QUATERNION = ("rx", "ry", "rz", "rw")


def vicon_head(lines: Sequence[str], cells_of: Callable[[str, str], list[str]]) -> ExportHead | None:
    """The head of the first section of markers, else of segments, objects, joints, outputs, devices; or None."""
    first = next((k for k, line in enumerate(lines) if line.strip(" \t\r\n,")), None)
    if first is None or _name(lines[first]) not in (*_SECTIONS, *_OTHERS):
        return None
    found = {_name(line): k for k, line in reversed(list(enumerate(lines))) if _name(line) in _SECTIONS}
    section = next((one for one in _SECTIONS if one in found), None)
    if section is None:
        raise DataError("expected a Vicon export with trajectories, segments or joints, got events alone")
    at = found[section]
    if len(lines) < at + 5:
        raise DataError(f"expected samples below the section {section!r} of a Vicon export, got its head alone")
    separator = "\t" if "\t" in lines[at + 3] else ","
    rate = positive(lines[at + 1].strip(" \t\r\n,"))
    names, heads, units = (cells_of(line, separator) for line in lines[at + 2 : at + 5])
    if rate is None or not heads or heads[0].lower() != "frame":
        raise DataError(f"expected a rate, names and the heads 'Frame, Sub Frame, ...' below the section {section!r}")
    n = len(heads)
    plain = without_common_subject(filled((names + [""] * n)[:n]))
    turned = _quaternions(heads[:n])
    columns = [_head(section, *one) for one in zip(plain, heads[:n], turned, strict=True)]
    columns[0] = "frame"
    columns[1] = "sub frame" if n > 1 and heads[1].lower() == "sub frame" else columns[1]
    end = next((k for k in range(at + 5, len(lines)) if not lines[k].strip(" \t\r\n,")), None)
    measured_in = tuple(
        "" if quaternion else unit for unit, quaternion in zip((units + [""] * n)[:n], turned, strict=True)
    )
    return ExportHead("Vicon", separator, tuple(columns), measured_in, at + 5, end, rate)


def _name(line: str) -> str:
    return line.strip(" \t\r\n,\ufeff").lower()


def _quaternions(heads: Sequence[str]) -> list[bool]:
    """Per column whether it is one of RX, RY, RZ, RW side by side."""
    plain, turned = [head.lower() for head in heads], [False] * len(heads)
    for k in range(len(plain) - 3):
        if tuple(plain[k : k + 4]) == _QUATERNION:
            turned[k : k + 4] = [True] * 4
    return turned


def _head(section: str, name: str, head: str, quaternion: bool) -> str:
    axis = head.lower()
    name = name.removeprefix("Global Angle (Quaternion) ")
    if quaternion:
        return f"{name}.orientation.{axis[1]}"
    if section in ("segments", "objects") and len(axis) == 2 and axis[0] in "rt" and axis[1] in "xyz":
        return f"{name}.{'rotation' if axis[0] == 'r' else 'position'}.{axis[1]}"
    return f"{name}.{axis if axis in ('x', 'y', 'z') else head}"
