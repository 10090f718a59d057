"""Text exports of motion capture systems as tables: their heads, and the gaps of markers that were not found."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import chain, islice
from typing import Any

import numpy as np

from kineme.errors import DataError
from kineme.io.limits import check_expanded
from kineme.io.motion_capture import export_heads
from kineme.io.tables.dialect import COMMA_NUMBER, Dialect, check_line, split
from kineme.movements.tables.table import Table

_HEAD_LINES = 400  # of an export with a head of its own, at most
_FIRST = 3  # lines among which the first line of an export is
_MAKERS = {
    "OptiTrack": export_heads.optitrack_head,
    "Vicon": export_heads.vicon_head,
    "Qualisys": export_heads.qualisys_head,
    "TRC": export_heads.trc_head,
    "OpenSim": export_heads.opensim_head,
}
_LINE = 100  # bytes of a line in Python, beside its characters
_SAMPLES = 5  # in which decimal commas are looked for
_ROUNDED = 1e-5  # s by which written times may differ from those of frames at the rate


def export_head(lines: Iterable[str], n_bytes: int) -> tuple[export_heads.ExportHead, Dialect] | None:
    """The head of an export of `_MAKERS` and how its samples are written; None for other tables."""
    lines = iter(lines)
    some = list(islice(lines, _FIRST))
    for line in some:
        check_line(line)
    if (maker := _head(some, probe=True)) is None:
        return None
    if maker == "Vicon":  # the section that is read may stand anywhere
        check_expanded(2 * n_bytes + _LINE)
        some += list(lines)
    else:
        some += list(islice(lines, _HEAD_LINES))
    head = _head(some)
    assert isinstance(head, export_heads.ExportHead)
    rows = [split(line, head.separator) for line in some[head.first : head.end][:_SAMPLES] if line.strip()]
    if not rows:
        raise DataError(f"expected samples below the heads of a {head.maker} export, got none")
    wide = max(0, len(rows[0]) - len(head.heads))
    heads, units = ((*given, *[""] * wide) for given in (head.heads, head.measured_in))
    comma = (
        not head.packed and head.separator != "," and any(COMMA_NUMBER.fullmatch(cell) for row in rows for cell in row)
    )
    kinds = ("number",) * len(heads)
    return head, Dialect(head.separator, comma, heads, True, head.first, kinds, units, head.end)


def _head(lines: Sequence[str], probe: bool = False) -> Any:
    """The head of an export, or None; with `probe` the name of its maker from the first lines alone."""
    for maker, find in _MAKERS.items():
        try:
            head = find(lines, split)
        except DataError:
            if not probe:
                raise
            return maker  # the head is longer than the first lines
        if head is not None:
            return maker if probe else head
    return None


def with_times(
    head: export_heads.ExportHead, dialect: Dialect
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Heads, kinds and units of the columns, and of one more for the times that follow from the rate."""
    more = head.rate is not None and not head.is_timed
    return (
        (*dialect.heads, *[export_heads.STAMP] * more),
        (*dialect.kinds, *["number"] * more),
        (*dialect.measured_in, *["s"] * more),
    )


def export_table(head: export_heads.ExportHead, table: Table) -> Table:
    """A table with times, and NaN for markers that were not found."""
    columns = list(table.columns)
    if head.rate is not None and not head.is_timed:
        columns.append(_stamps(table, columns, head.rate))
    elif head.rate is not None and "frame" in head.heads:
        k, frames = head.heads.index(export_heads.STAMP), columns[head.heads.index("frame")]
        even = columns[k][0] + (frames - frames[0]) / head.rate
        columns[k] = np.where(np.abs(columns[k] - even) <= _ROUNDED, even, columns[k])
    if head.zeros_are_gaps:
        # NaN in place of the zeros that stand for a marker or a body that was not found.
        groups: dict[str, list[int]] = {}
        for k, name in enumerate(table.heads[: len(columns)]):
            if name[-2:] in (".x", ".y", ".z"):
                groups.setdefault(name[:-2].removesuffix(".position"), []).append(k)
        for name, members in groups.items():
            lost = np.all([columns[k] == 0 for k in members], axis=0)
            if lost.any():
                angles = [k for k, head in enumerate(table.heads[: len(columns)]) if head.startswith(f"{name}.")]
                for k in chain(members, angles):
                    columns[k] = np.where(lost, np.nan, columns[k])
    return Table(
        table.heads, columns, table.n_rows, table.line_of, table.faults, None, table.measured_in, None, head.maker
    )


def _stamps(table: Table, columns: Sequence[Any], rate: float) -> Any:
    """Times [s] from the numbers of the frames, or of the rows where frames are divided or not counted."""
    counted = {name: columns[k] for k, name in enumerate(table.heads[: len(columns)]) if name in ("frame", "sub frame")}
    frames, parts = counted.get("frame"), counted.get("sub frame")
    if frames is None or (parts is not None and parts.any()):
        return np.arange(table.n_rows) / rate
    return (frames - frames[0]) / rate
