"""One piece: read, worked on, and written to one file, which says what it was made of."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import kineme
from kineme.errors import DataError, KinemeError
from kineme.io.reading.formats import Entry
from kineme.io.reading.merge_files import Recordings
from kineme.io.reading.pieces import read_entry
from kineme.io.reading.recordings import how_to_read
from kineme.io.records import Problem
from kineme.movements.tables.layout import Known
from kineme.pieces.archive import is_remote, local_copy
from kineme.pieces.planning import Piece
from kineme.reporting.atomic import FULL, whole_file, write_atomically
from kineme.reporting.text import counted, shortened
from kineme.runtime.compiled import compiled_always

DONE, SKIPPED, FAILED = "done", "skipped", "failed"

_ABOUT, _REPORT = b"kineme", b"kineme.report"  # keys of the metadata of a part
_LONGEST = 500  # letters of a reason that are kept


class Source(NamedTuple):
    """A piece that is being read."""

    piece: Piece
    problems: list[Problem]  # what cannot be read in it; whoever reads adds to them
    counts: dict[str, float]  # recordings and their seconds


@dataclass(frozen=True)
class Job:
    """Work to do on every piece; `specification` is all that the rows depend on besides it, as plain data."""

    task: str
    work: Callable[[Source], Iterable[Any]]  # source -> tables of Arrow, its part; pickle finds it by its name
    output: str  # folder of the parts
    specification: Mapping[str, Any] = field(default_factory=dict)  # another one makes parts stale
    ending: str = ".parquet"  # or ".arrow", for parts that are mapped into memory

    def path(self, piece: Piece) -> Path:
        """Return the part of a piece."""
        return Path(self.output) / f"part-{piece.key}{self.ending}"

    def failure(self, piece: Piece) -> Path:
        """Return the file that says why there is no part."""
        return Path(self.output) / f"failed-{piece.key}.json"

    def about(self, piece: Piece) -> dict[str, Any]:
        """Return what a part of a piece says of itself: a part that says otherwise is stale."""
        said = {
            "task": self.task,
            "specification": dict(self.specification),
            "version": kineme.__version__,
            "piece": [piece.units[0].shown, piece.first, piece.last],
            "sources": piece.sources,
        }
        about: dict[str, Any] = json.loads(json.dumps(said, default=repr))  # as it is read: of tuples, lists
        return about


@dataclass(frozen=True)
class Outcome:
    """What became of a piece.

    - `state`: "done"; "skipped", as its part was there and fits; "failed", and `reason` says why.
    - `rows`: of its part; `problems`: what could not be read in it, each a sentence.
    - `recordings`, `seconds`: that were read, 0 of a piece that was skipped.
    - `processor`: seconds of a processor.
    """

    piece: Piece
    state: str
    reason: str = ""
    rows: int = 0
    problems: tuple[str, ...] = ()
    recordings: int = 0
    seconds: float = 0.0
    processor: float = 0.0


class Part(NamedTuple):
    """What the metadata of a part says."""

    about: dict[str, Any]
    problems: tuple[str, ...]
    recordings: int
    seconds: float
    rows: int


def run_piece(job: Job, piece: Piece) -> Outcome:
    """Do a piece, unless its part is there and fits; whatever goes wrong but a full disk is a failed outcome."""
    before = time.process_time()
    path = job.path(piece)
    about = job.about(piece)
    part = read_part(path)
    if part is not None and part.about == about:
        return Outcome(piece, SKIPPED, "", part.rows, part.problems)
    source = Source(piece, [], {"recordings": 0, "seconds": 0.0})
    try:
        with compiled_always():
            tables = list(job.work(source))
        _check_unchanged(piece)
        problems = tuple(str(problem) for problem in source.problems)
        rows = _write(path, tables, {_ABOUT: about, _REPORT: {"problems": problems, **source.counts}})
    except Exception as error:  # one poisoned piece must not stop the others, whatever is wrong with it
        if isinstance(error, OSError) and error.errno in FULL:  # all others would fail, after as much work
            raise
        return failed(job, piece, _in_words(error), time.process_time() - before)
    with suppress(OSError):
        job.failure(piece).unlink(missing_ok=True)
    done = time.process_time() - before
    counts = int(source.counts["recordings"]), float(source.counts["seconds"])
    return Outcome(piece, DONE, "", rows, problems, *counts, done)


def failed(job: Job, piece: Piece, reason: str, processor: float = 0.0) -> Outcome:
    """Write down why a piece has no part, and remove one that is stale."""
    text = json.dumps({**job.about(piece), "reason": reason}, ensure_ascii=False, indent=1)
    with suppress(OSError):  # a full disk: the outcome says the reason all the same
        job.path(piece).unlink(missing_ok=True)
        write_atomically(job.failure(piece), text.encode("utf-8", "backslashreplace"))
    return Outcome(piece, FAILED, reason, processor=processor)


def _in_words(error: BaseException) -> str:
    text = " ".join(str(error).split())
    if isinstance(error, KinemeError) or (isinstance(error, OSError) and text.startswith("expected")):
        return shortened(text, _LONGEST)
    return shortened(f"{type(error).__name__}: {text}" if text else type(error).__name__, _LONGEST)


def _check_unchanged(piece: Piece) -> None:
    """Refuse a piece whose files are others than when it was planned; of a store, sizes were checked when copying."""
    if is_remote(piece.uri):
        return
    for unit in piece.units:
        with local_copy(unit) as folder:
            base = folder / unit.name if unit.is_archive else folder
            for file in unit.files:
                there = None
                with suppress(OSError):
                    status = (base / file.name).stat()
                    there = (status.st_size, str(status.st_mtime_ns))
                if there != (file.size, file.stamp):
                    raise DataError(
                        f"expected {file.name} as it was listed, it has changed or vanished while it was read; run it "
                        "again"
                    )


def read_part(path: Path) -> Part | None:
    """Return what a part says of itself; None if there is none that can be read."""
    import pyarrow as pa
    from pyarrow import ipc, parquet

    try:
        if path.suffix == ".arrow":
            with pa.memory_map(str(path)) as mapped, ipc.open_file(mapped) as file:
                metadata = file.schema.metadata
        else:
            with parquet.ParquetFile(path) as file:
                metadata = file.metadata.metadata
        about, report = (json.loads((metadata or {})[key]) for key in (_ABOUT, _REPORT))
        problems, rows = tuple(map(str, report["problems"])), int(report["rows"])
        return Part(about, problems, int(report["recordings"]), float(report["seconds"]), rows)
    except (OSError, ValueError, LookupError, TypeError, ArithmeticError, RecursionError, pa.ArrowException):
        return None


def _write(path: Path, tables: Sequence[Any], metadata: Mapping[bytes, Mapping[str, Any]]) -> int:
    """Write tables as one file, atomically; of none, one without columns. Returns the number of rows."""
    import pyarrow as pa
    from pyarrow import parquet

    table = pa.concat_tables(tables, promote_options="permissive") if tables else pa.table({})
    said = {key: dict(value) for key, value in metadata.items()}
    said[_REPORT]["rows"] = table.num_rows
    own = {key: json.dumps(value, ensure_ascii=False, sort_keys=True).encode() for key, value in said.items()}
    table = table.replace_schema_metadata({**(table.schema.metadata or {}), **own})
    with whole_file(path, sweep=False) as beside:
        if path.suffix == ".arrow":
            from kineme.pieces.shards import write_arrow  # of features alone; it loads what compares movements

            write_arrow(beside, table)
        else:
            parquet.write_table(table, beside)
    return int(table.num_rows)


def recordings_of(source: Source, options: Mapping[str, Any], reference: Known | None = None) -> Iterator[Recordings]:
    """Yield the recordings of a piece as `read_recordings` reads them, file by file, or some episodes at a time."""
    how = how_to_read(options, reference)
    if how.join:
        raise DataError("expected recordings that are read one by one, got --join-files; join them first")
    for unit in source.piece.units:
        with local_copy(unit) as folder:
            entry = Entry(folder / unit.name, Path(unit.name), unit.shown)
            yield from noted(source, read_entry(entry, how, source.piece.numbers))


def noted(source: Source, read: Iterable[Recordings | Problem]) -> Iterator[Recordings]:
    """Yield what is read of a piece; its problems, and how much there is of it, are added to those of the source."""
    for recordings in read:
        if isinstance(recordings, Problem):
            source.problems.append(recordings)
            continue
        source.problems.extend(recordings.problems)
        source.counts["recordings"] += len(recordings)
        source.counts["seconds"] += float(recordings.demonstrations.durations.sum())
        yield recordings


def summary_of(outcomes: Sequence[Outcome]) -> str:
    """Return in words how many pieces were done, were there already, and failed."""
    states = [outcome.state for outcome in outcomes]
    parts = [f"{counted(states.count(DONE), 'piece')} done"]
    if n := states.count(SKIPPED):
        parts.append(f"{n:,} there already")
    if n := states.count(FAILED):
        parts.append(f"{n:,} failed")
    return ", ".join(parts)
