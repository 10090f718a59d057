"""Read a table of labels: CSV, JSON, ELAN's documents and tab-delimited exports, Audacity's label tracks."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from kineme.errors import DataError
from kineme.io.annotations.label_table import Heads, LabelRow, heads_of, heads_of_cells, row_of
from kineme.io.limits import check_expanded, read_limited

_SKIPPED = ("\\", '"#', "#")  # frequencies of Audacity, and what ELAN says of the media
_CELL = 200  # bytes that a character of a table may take in Python, at most
_EXPECTED = "expected a table with columns start, end and label"
_MILLISECONDS = Heads(0, 1, 2, None, None, ("ms", "ms"), True)


class LabelTable(NamedTuple):
    """Labels beside a recording.

    Attributes
    ----------
    name : str
        Of the file.
    rows : tuple of LabelRow
    since_start : bool
        Whether times count from the first sample, as in ELAN and Audacity; else they are by the recording's clock.
    """

    name: str
    rows: tuple[LabelRow, ...]
    since_start: bool


def read_labels(path: Path) -> LabelTable:
    """Read the labels in a file.

    Parameters
    ----------
    path : Path
        ``.eaf`` is a document of ELAN, ``.json`` a list of objects; anything else is a table whose cells are separated
        by tabs, semicolons or commas. With heads, these name the columns; without, as Audacity and ELAN export tables,
        the first two times are start and end, and the last column is the label.

    Raises
    ------
    DataError
        No such table; the message names the file, and the line if there is one.
    OSError
        The file cannot be read.
    """
    with path.open("rb") as file:
        data = read_limited(file)
    readers = {".eaf": _elan, ".json": _json}
    try:
        check_expanded(_CELL * len(data) if path.suffix.lower() in readers else 10 * len(data), "a table of labels")
        rows, since_start = readers.get(path.suffix.lower(), _table)(data)
        if not rows:
            raise DataError(f"{_EXPECTED}, got no labels")
    except (DataError, ValueError, RecursionError, csv.Error, ElementTree.ParseError) as error:
        raise DataError(f"labels {path}: {error}") from error
    return LabelTable(str(path), tuple(rows), since_start)


def _table(data: bytes) -> tuple[list[LabelRow], bool]:
    text = data.decode("utf-8-sig")
    first = next((one for one in text.splitlines() if one.strip() and not one.startswith(_SKIPPED)), "")
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=max("\t;,", key=first.count))
    cells = [(reader.line_num, row) for row in reader if any(row) and not row[0].startswith(("\\", "#"))]
    if not cells:
        return [], False
    if heads := heads_of(cells[0][1]):
        return [row_of(row, heads, k) for k, row in cells[1:]], heads.of_elan
    plain = heads_of_cells(cells[0][1])
    if plain is None:
        raise DataError(f"{_EXPECTED}, got {first[:80]!r}")
    return [row_of(row, plain, k) for k, row in cells], True


def _json(data: bytes) -> tuple[list[LabelRow], bool]:
    rows = json.loads(data)
    if not isinstance(rows, list) or not all(isinstance(one, dict) for one in rows):
        raise DataError("expected a list of objects with start, end and label, got something else")
    names = list(dict.fromkeys(str(name) for one in rows for name in one))
    heads = heads_of(names)
    if heads is None:
        raise DataError(f"expected objects with start, end and label, got {names[:20]}")
    return [row_of([_text(one.get(name)) for name in names], heads, k) for k, one in enumerate(rows, 1)], False


def _text(value: Any) -> str:
    return "" if value is None else str(value)


def _elan(data: bytes) -> tuple[list[LabelRow], bool]:
    root = ElementTree.fromstring(data)
    slots = {one.get("TIME_SLOT_ID"): one.get("TIME_VALUE", "") for one in root.iter("TIME_SLOT")}
    tiers = {one.get("TIER_ID", ""): one.findall(".//ALIGNABLE_ANNOTATION") for one in root.iter("TIER")}
    aligned = {name: found for name, found in tiers.items() if found}
    name = "symbol" if "symbol" in aligned else next(iter(aligned), None)
    if name is None:
        return [], True
    if name != "symbol" and len(aligned) > 1:
        raise DataError(
            f"expected one tier with annotations, or one named symbol, got {list(aligned)}; delete the others"
        )
    return [row_of(_cells(one, slots), _MILLISECONDS, k) for k, one in enumerate(aligned[name], 1)], True


def _cells(annotation: Any, slots: dict[str | None, str]) -> Sequence[str]:
    times = [slots.get(annotation.get(f"TIME_SLOT_REF{i}"), "") for i in (1, 2)]
    return [*times, annotation.findtext("ANNOTATION_VALUE") or ""]
