"""TRC: tracked markers over time, as Cortex of Motion Analysis writes them, and OpenSim, OptiTrack and others after it.

Source: OpenSim, "Marker (.trc) Files". A line ``PathFileType  4  (X/Y/Z)  name.trc``, a row of keys and one of their
values (``DataRate``, ``Units``, ...), a row with ``Frame#``, ``Time`` and the name above the first column of each
marker, a row of axes ``X1  Y1  Z1``, mostly an empty line, and the samples; all separated by tabs, or by
commas where a program for tables has saved the file.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from kineme.errors import DataError
from kineme.io.motion_capture.export_heads import ExportHead, filled, positive

_FIRST = "PathFileType"


def trc_head(lines: Sequence[str], cells_of: Callable[[str, str], list[str]]) -> ExportHead | None:
    """The head of a TRC file, or None if the first line does not look like one."""
    first = lines[0].lstrip("\ufeff") if lines else ""
    if not first.startswith(_FIRST):
        return None
    separator = next((one for one in ",;" if first[len(_FIRST) :].startswith(one)), "\t")
    if len(lines) < 6:
        raise DataError(f"expected a TRC file with keys, names and samples, got {len(lines)} lines")
    keys, values, names, axes = (cells_of(line, separator) for line in lines[1:5])
    said = dict(zip((key.lower() for key in keys), values, strict=False))
    if [cell.lower() for cell in names[:2]] != ["frame#", "time"]:
        raise DataError(f"expected the heads 'Frame#', 'Time' and names in line 4 of a TRC file, got {names[:2]}")
    n = max(
        (k + 1 for k, cell in enumerate(axes) if cell), default=len(names)
    )  # names may end in more tabs than samples
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
