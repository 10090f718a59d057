"""Annotations as CSV and as JSON."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from kineme.io.annotations.annotation import Annotation
from kineme.reporting.atomic import write_atomically
from kineme.reporting.text import as_cell

HEADS = ("recording", "place", "start", "end", "symbol", "p_value", "confidence", "unknown")


def as_row(one: Annotation) -> dict[str, Any]:
    """An annotation as plain data, in the order of `HEADS`."""
    return {head: getattr(one, head) for head in HEADS}


def to_csv(annotations: Sequence[Annotation]) -> bytes:
    """A row for each annotation; the symbol of unknown motion is empty, times are by the recording's clock."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(HEADS)
    table.writerows([_cell(value) for value in as_row(one).values()] for one in annotations)
    return text.getvalue().encode("utf-8", "backslashreplace")


def write_csv(path: Path, annotations: Sequence[Annotation], source: Path | None) -> Path:
    """Write `to_csv`."""
    return write_atomically(path, to_csv(annotations))


def write_json(path: Path, annotations: Sequence[Annotation], source: Path | None) -> Path:
    """Write a list of objects, one for each annotation; the symbol of unknown motion is null."""
    text = json.dumps([as_row(one) for one in annotations], ensure_ascii=False, allow_nan=False, indent=1)
    return write_atomically(path, (text + "\n").encode("utf-8", "backslashreplace"))


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return as_cell(value) if isinstance(value, str) else "" if value is None else str(value)
