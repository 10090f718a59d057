"""The contents of a file or a data set, where its format can tell them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from kineme.errors import DataError
from kineme.io.reading.entries import entries_of
from kineme.io.reading.formats import FORMATS, data_set_of
from kineme.io.records import Contents
from kineme.reporting.table import Table, to_text
from kineme.reporting.text import printable

_FILE = "file"  # head of the names of files
_SHOWN = 20  # rows that are listed whatever they hold
_IDLE = ("nothing", "is fixed")  # how the last cell of a row begins that holds no movement


def contents_of_all(paths: Sequence[Path], follow_links: bool = False) -> list[Contents]:
    """The contents of all recordings at these paths; of several that have some, each row begins with its file."""
    try:
        entries, _ = entries_of(paths, follow_links) if paths else ([], [])
    except (DataError, OSError):  # reading gives the reason
        return []
    listed = {entry.name: contents for entry in entries if (contents := contents_of(entry.path))}
    if len(listed) < 2:
        return next(iter(listed.values()), [])
    merged: dict[tuple[str, tuple[str, ...]], Contents] = {}
    for name, several in listed.items():
        for content in several:
            before = merged.get(
                (content.name, content.heads), Contents(content.name, (_FILE, *content.heads), (), content.note)
            )
            rows = tuple((name, *row) for row in content.rows)
            merged[content.name, content.heads] = before._replace(
                rows=before.rows + rows, note=before.note or content.note
            )
    return list(merged.values())


def contents_of(path: Path) -> list[Contents]:
    """The contents of one recording.

    There are none of a folder of files, of formats that hold movements alone, and of what cannot be opened: reading it
    gives the reason.
    """
    data_set = data_set_of(path)
    form = FORMATS.get(path.suffix.lower()) if data_set is None else data_set.format
    if form is None or form.contents is None or (data_set is None and not path.is_file()):
        return []
    try:
        return form.contents(path)
    except (DataError, OSError):
        return []


def contents_as_data(contents: list[Contents]) -> dict[str, Any]:
    """A list of dictionaries under each name."""
    return {content.name: [dict(zip(content.heads, row, strict=True)) for row in content.rows] for content in contents}


def contents_as_words(contents: list[Contents]) -> list[str]:
    """A table of each: what several files have alike once, and of a long list only what holds movements."""
    return [_in_words(_once(content)) for content in contents]


def _in_words(content: Contents) -> str:
    title = f"{content.name}{f' {content.note}' if content.note else ''}"
    rows = content.rows
    if len(rows) > _SHOWN:
        rows = tuple(row for row in rows if not any(str(cell).startswith(_IDLE) for cell in row[-2:]))
    n_idle = len(content.rows) - len(rows)
    more = f"\nand {n_idle} {content.name} that hold no movement; --json lists them" if n_idle else ""
    return to_text(Table(title, content.heads, [_row(row) for row in rows])) + more


def _once(content: Contents) -> Contents:
    """Rows that several files have alike but for their counts, once: the range of these, and in how many files."""
    if content.heads[0] != _FILE:
        return content
    n_files = len({file for file, *_ in content.rows})
    groups: dict[tuple[str, ...], list[list[str | int]]] = {}
    for _, *cells in content.rows:
        groups.setdefault(tuple(cell for cell in cells if isinstance(cell, str)), []).append(cells)
    rows = tuple(
        (*(_range([row[k] for row in alike]) for k in range(len(content.heads) - 1)), f"{len(alike)} of {n_files}")
        for alike in groups.values()
    )
    return content._replace(heads=(*content.heads[1:], "files"), rows=rows)


def _range(cells: list[str | int]) -> str:
    """A text that all rows have, or the least and the greatest of their numbers."""
    numbers = [cell for cell in cells if isinstance(cell, int)]
    if not numbers:
        return str(cells[0])
    least, greatest = min(numbers), max(numbers)
    return f"{least:,}" if least == greatest else f"{least:,} to {greatest:,}"


def _row(row: tuple[str | int, ...]) -> tuple[str, ...]:
    return tuple(f"{cell:,}" if isinstance(cell, int) else printable(cell) for cell in row)
