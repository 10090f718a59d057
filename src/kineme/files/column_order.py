"""Files with the same columns in several orders, such as quaternions w, x, y, z and x, y, z, w, in one order."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from kineme.files.read_file import FileRead
from kineme.movements.tables.parsed import Detected


def in_one_order(files: Sequence[FileRead]) -> list[FileRead]:
    """Files whose columns have the same names in the order of the first file that has them."""
    first: dict[frozenset[str], tuple[str, ...]] = {}
    return [_ordered(one, first.setdefault(frozenset(_columns(one)), _columns(one))) for one in files]


def notes_on_order(detected: Iterable[Detected], columns: Sequence[str]) -> list[str]:
    """A sentence if files have the columns in another order than they are read in."""
    others = [one.columns for one in detected if one.columns != columns and set(one.columns) == set(columns)]
    if not others:
        return []
    moved = [[a, b] for a, b in zip(others[0], columns, strict=True) if a != b]
    theirs, ours = (", ".join(names) for names in zip(*moved, strict=True))
    return [f"some files have the columns {theirs} in this order: they are read as {ours}, that of the first file"]


def _ordered(one: FileRead, heads: tuple[str, ...]) -> FileRead:
    columns = _columns(one)
    if columns == heads or one.detected is None or one.block is None:
        return one
    order = [columns.index(head) for head in heads]
    units = one.detected.measured_in and tuple(one.detected.measured_in[k] for k in order)
    return one._replace(
        detected=one.detected._replace(columns=heads, measured_in=units),
        block=replace(one.block, positions=one.block.positions[:, order]),
    )


def _columns(one: FileRead) -> tuple[str, ...]:
    return one.detected.columns if one.detected else ()
