"""TSV exports of Qualisys Track Manager: motion data and rigid bodies (6DOF).

Source: Qualisys, "Motion data (.tsv)" and "6DOF data (.tsv)". Lines of a keyword, a tab and its value: ``FREQUENCY``,
``NO_OF_FRAMES``, ``MARKER_NAMES`` or ``BODY_NAMES``, ...; then, if asked for, a row of heads; then the samples, with
or without a frame and a time before them. Positions are in millimeters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from kineme.errors import DataError
from kineme.io.motion_capture.export_heads import ExportHead, positive

_POSES = ("x", "y", "z", "roll", "pitch", "yaw", "residual", *(f"rot[{k}]" for k in range(9)))


def qualisys_head(lines: Sequence[str], cells_of: Callable[[str, str], list[str]]) -> ExportHead | None:
    """The head of an export of Qualisys Track Manager, or None if the first line does not look like one."""
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
    headed = bool(row) and not any(_is_number(cell) for cell in row)
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
    """Heads and units; residuals and the rotation matrix beside the angles are left aside."""
    if not bodies:
        return [f"{name}.{axis}" for name in names for axis in "xyz"], ["mm"] * 3 * len(names)
    one = [("position.", "mm")] * 3 + [("", "deg")] * 3 + [("", "")] * 10
    heads = [
        f"{name}.{group}{what}" if unit else ""
        for name in names
        for what, (group, unit) in zip(_POSES, one, strict=True)
    ]
    return heads, [unit for _ in names for _, unit in one]


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True
