"""The record of what happens when in a recording, as CSV, as JSON and as a label track of Audacity."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kineme.io.records import UNKNOWN
from kineme.reporting.atomic import write_atomically
from kineme.reporting.text import as_cell

HEADS = ("recording", "place", "start", "end", "symbol", "p_value", "confidence", "unknown")


@dataclass(frozen=True)
class Annotation:
    """A stretch of motion in a recording, and the symbol that it shows.

    Attributes
    ----------
    recording : str
        The recording, as `kineme.io.reading.merge_files.Source.path` names it.
    place : str
        Which movement of the file, such as the number of an episode; empty if the file holds but one.
    start, end : float
        Time stamps of the first and the last sample [s], by the clock of the recording.
    symbol : str or None
        None: motion that is like no symbol.
    p_value : float
        Share of movements of known symbols that would be as novel or more, see `kineme.recognition.answer.Answer`.
    confidence : float
        Probability that the symbol is right if the movement is one of the library's; if unknown, 1 minus `p_value`.
    origin : float
        Time stamp of the first sample of the recording [s].
    """

    recording: str
    place: str
    start: float
    end: float
    symbol: str | None
    p_value: float
    confidence: float
    origin: float = 0.0

    @property
    def unknown(self) -> bool:
        """True if the motion is like no symbol."""
        return self.symbol is None

    @property
    def span(self) -> tuple[float, float]:
        """Start and end in seconds since the first sample, as programs for videos count them."""
        return self.start - self.origin, self.end - self.origin


def as_row(annotation: Annotation) -> dict[str, Any]:
    """An annotation as plain data, in the order of `HEADS`."""
    return {head: getattr(annotation, head) for head in HEADS}


def to_csv(annotations: Sequence[Annotation]) -> bytes:
    """A row for each annotation; the symbol of unknown motion is empty, times are by the recording's clock."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(HEADS)
    table.writerows([_cell(value) for value in as_row(annotation).values()] for annotation in annotations)
    return text.getvalue().encode("utf-8", "backslashreplace")


def write_csv(path: Path, annotations: Sequence[Annotation], source: Path | None) -> Path:
    """Write `to_csv`."""
    return write_atomically(path, to_csv(annotations))


def write_json(path: Path, annotations: Sequence[Annotation], source: Path | None) -> Path:
    """Write a list of objects, one for each annotation; the symbol of unknown motion is null."""
    text = json.dumps([as_row(annotation) for annotation in annotations], ensure_ascii=False, allow_nan=False, indent=1)
    return write_atomically(path, (text + "\n").encode("utf-8", "backslashreplace"))


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return as_cell(value) if isinstance(value, str) else "" if value is None else str(value)


def write_audacity(path: Path, annotations: Sequence[Annotation], source: Path | None) -> Path:
    """Write ``start TAB end TAB label`` lines, in seconds since the first sample, as File > Import > Labels reads."""
    rows = [(*note.span, UNKNOWN if note.symbol is None else " ".join(note.symbol.split())) for note in annotations]
    lines = [f"{start:.6f}\t{end:.6f}\t{symbol}\n" for start, end, symbol in rows]
    return write_atomically(path, "".join(lines).encode("utf-8", "backslashreplace"))
