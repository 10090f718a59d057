"""What was found in opened recordings, what a person corrected of it, and the table of corrections beside them."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from threading import Lock
from typing import NamedTuple

from kineme.errors import DataError
from kineme.io.reading.read_labels import read_labels
from kineme.io.writing.annotations import Annotation, to_csv
from kineme.reporting.atomic import write_atomically
from kineme.studio.server.refusals import ConflictError

_ENDING = "-corrections.csv"

Movement = tuple[str, str]  # recording and place, as in `Annotation`


class Lane(NamedTuple):
    """The symbols of one movement."""

    annotations: tuple[Annotation, ...] = ()
    corrected: bool = False  # whether a person has changed any, and so has looked at all of them


class Corrections:
    """The lanes of all movements that were looked at, and a table of those that a person corrected.

    The table lies beside what was opened, ``demos-corrections.csv`` beside ``demos``; one that is there is read, so
    that work goes on where it ended. A table that is none is left as it is, and is a problem.
    """

    def __init__(self, opened: Path) -> None:
        place = Path(os.path.abspath(opened))  # beside a link, not what it leads to
        self.path = place.with_name(f"{place.name if place.is_dir() else place.stem}{_ENDING}")
        self.problem: str | None = None
        self.saved = True  # whether the table holds all that was corrected
        self._lanes: dict[Movement, Lane] = {}
        self._bytes: bytes | None = None  # of the table as it was read or written last; None: there was none
        self._turn = Lock()
        if self.path.is_file():
            self._read()

    def _read(self) -> None:
        lanes: dict[Movement, list[Annotation]] = {}
        try:
            for row in read_labels(self.path).rows:
                note = Annotation(row.recording, row.place, row.start, row.end, row.label, float("nan"), 1.0)
                lanes.setdefault((row.recording, row.place), []).append(note)
            self._bytes = self.path.read_bytes()
        except (DataError, OSError) as error:
            self.problem = f"{self.path.name} was not read: {error}"
        else:
            self._lanes = {key: Lane(tuple(notes), corrected=True) for key, notes in lanes.items()}

    def add(self, annotations: Iterable[Annotation]) -> None:
        """Add what is known of movements from elsewhere, but for those that a person corrected."""
        lanes: dict[Movement, list[Annotation]] = {}
        for note in annotations:
            lanes.setdefault((note.recording, note.place), []).append(note)
        self._lanes = {key: Lane(tuple(notes)) for key, notes in lanes.items()} | self._lanes

    def lane(self, movement: Movement) -> Lane:
        """Return what was found in a movement, or corrected."""
        return self._lanes.get(movement, Lane())

    def put(self, movement: Movement, lane: Lane) -> None:
        """Replace it."""
        with self._turn:
            self.saved = self.saved and not (lane.corrected or self.lane(movement).corrected)
            self._lanes[movement] = lane

    @property
    def corrected(self) -> Sequence[Annotation]:
        """All annotations of movements that a person corrected, in the order in which they were first looked at."""
        return [note for lane in list(self._lanes.values()) if lane.corrected for note in lane.annotations]

    def table(self) -> bytes:
        """Return `corrected` as `kineme annotate` writes annotations."""
        return to_csv(self.corrected)

    def save(self, *, replace: bool = False) -> Path:
        """Write the table; a ConflictError if it was written by others since, unless that is to be replaced."""
        with self._turn:
            now = self.path.read_bytes() if self.path.is_file() else None
            if now is not None and now != self._bytes and not replace:
                raise ConflictError(
                    f"expected {self.path.name} as this studio left it, others wrote it; replace it, or download yours"
                )
            table = self.table()
            try:
                write_atomically(self.path, table)
            except OSError as error:
                raise DataError(
                    f"expected to write {self.path.name} beside the recordings, got: {error.strerror or error}; "
                    "download it instead"
                ) from error
            self._bytes, self.saved = table, True
        return self.path
