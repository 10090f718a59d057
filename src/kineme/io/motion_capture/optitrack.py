"""CSV exports of OptiTrack Motive, versions 1.2 and later of the format.

Source: OptiTrack, "Data Export: CSV". The first line holds names and values in turn: ``Format Version,1.23,...,Export
Frame Rate,120,...,Length Units,Meters``. After an empty line there are rows with the type, the name, the id and, since
version 1.25, the parent of each column, then one with what it holds, and the row of heads ``Frame,Time (Seconds),X``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from kineme.errors import DataError
from kineme.io.motion_capture.export_heads import ExportHead, positive, without_common_subject
from kineme.units import unit_named

_EXPECTED = ("rigid body marker", "bone marker", "trained markerset marker")  # computed from the pose, not measured


def optitrack_head(lines: Sequence[str], cells_of: Callable[[str, str], list[str]]) -> ExportHead | None:
    """The head of an export of Motive, or None if the first line does not look like one."""
    known = cells_of(lines[0], ",") if lines else []
    if not known or known[0].lower() != "format version":
        return None
    said = dict(zip((cell.lower() for cell in known[::2]), known[1::2], strict=False))
    rows = [cells_of(line, ",") for line in lines]
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
    plain = without_common_subject(names[2:])
    quaternions = "quaternion" in said.get("rotation type", "quaternion").lower()
    heads, units = ["frame", "time [s]"], ["", "s"]
    axes = [cell.lower() for cell in rows[at][2:]]
    for kind, name, content, axis in zip(kinds[2:], plain, contents[2:], axes, strict=True):
        what = content.lower()
        left_out = (solved and kind.lower() in _EXPECTED) or axis not in "xyzw" or not axis
        if left_out or what not in ("position", "rotation"):
            heads.append("")
        elif what == "position":
            heads.append(f"{name}.position.{axis}" if solved else f"{name}.{axis}")
        else:
            heads.append(f"{name}.{'orientation' if quaternions else 'rotation'}.{axis}")
        units.append(
            "" if not heads[-1] or (what == "rotation" and quaternions) else "deg" if what == "rotation" else length
        )
    rate = positive(said.get("export frame rate") or said.get("capture frame rate") or "")
    timed = len(rows[at]) > 1 and rows[at][1].lower().startswith("time")
    if not timed:
        heads[1] = ""
    return ExportHead("OptiTrack", ",", tuple(heads[:n]), tuple(units[:n]), at + 1, None, rate)
