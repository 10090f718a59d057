"""What pieces left in a folder: checked against the archive, and read one after the other."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kineme.errors import DataError
from kineme.io.reading.recordings import how_to_read
from kineme.pieces.archive import is_remote, path_at
from kineme.pieces.planning import PIECE_BYTES, Piece, Plan, plan
from kineme.pieces.run import Job, Part, read_part
from kineme.pieces.tasks import TASKS, job_of
from kineme.reporting.atomic import whole_file
from kineme.reporting.text import counted, first_names

RUN = "run.json"  # in the folder of the parts: what was asked for

_NAMED = 3  # pieces that a message names


@dataclass(frozen=True)
class Asked:
    """A command over the pieces of archives, as its folder keeps it; `plan` takes archives, size, and how to read."""

    task: str  # a key of `TASKS`
    archives: tuple[str, ...]
    options: Mapping[str, Any]  # of its job
    size: int = PIECE_BYTES


@dataclass(frozen=True)
class Checked:
    """Pieces of an archive, by what there is of them in a folder; each in the order of the plan.

    - `parts`: pieces that are done, with what their parts say.
    - `missing`: there is no part; `stale`: it is of other bytes, options, library or version; `failed`: with reasons.
    - `strange`: names of parts that are of no piece of the archive as it is now.
    """

    parts: tuple[tuple[Piece, Part], ...]
    missing: tuple[Piece, ...]
    stale: tuple[Piece, ...]
    failed: tuple[tuple[Piece, str], ...]
    strange: tuple[str, ...]

    @property
    def is_complete(self) -> bool:
        """Tell if every piece has a part that fits."""
        return not (self.missing or self.stale or self.failed)

    @property
    def problems(self) -> list[str]:
        """What could not be read in the pieces that are done."""
        return [problem for _, part in self.parts for problem in part.problems]

    def in_words(self) -> str:
        """Say how many pieces are done, and of the others which."""
        n = len(self.parts) + len(self.missing) + len(self.stale) + len(self.failed)
        lines = [f"{len(self.parts):,} of {counted(n, 'piece')} done"]
        for what, pieces in (("missing", self.missing), ("stale", self.stale)):
            if pieces:
                lines.append(f"{len(pieces):,} {what}: {first_names(list(map(str, pieces)), _NAMED)}")
        lines += [f"failed: {piece}: {reason}" for piece, reason in self.failed]
        if self.strange:
            lines.append(f"{counted(len(self.strange), 'part')} of no piece: {first_names(self.strange, _NAMED)}")
        return "\n".join(lines)


def write_run(output: Path, asked: Asked, *, replace: bool = False) -> None:
    """Write what is asked for into the folder of the parts, or check that it is what the folder has parts of."""
    output.mkdir(parents=True, exist_ok=True)
    text = json.dumps(vars(asked), ensure_ascii=False, sort_keys=True, indent=1)
    with suppress(FileExistsError), whole_file(output / RUN, replace=replace) as beside:
        beside.write_text(text, encoding="utf-8")
        return
    before = read_run(output)
    if (before.task, _without_version(before.options)) != (asked.task, _without_version(asked.options)):
        names = sorted({*before.options, *asked.options})
        differ = [name for name in names if before.options.get(name) != asked.options.get(name)]
        what = f"kineme {before.task}" if before.task != asked.task else f"other options ({', '.join(differ)})"
        raise DataError(
            f"expected a folder for the parts of this command, {output} has those of {what}; name another, or say "
            "--force to do all of them again"
        )
    if before != asked:
        with whole_file(output / RUN) as beside:
            beside.write_text(text, encoding="utf-8")


def _without_version(options: Mapping[str, Any]) -> dict[str, Any]:
    """Leave out what may change between two calls of one command: the library has learned, or has moved."""
    return {name: value for name, value in options.items() if name not in ("library", "library_version", "shards")}


def read_run(output: Path) -> Asked:
    """Return what was asked for. Raises `DataError`: there is nothing that pieces left."""
    try:
        asked = json.loads((output / RUN).read_text(encoding="utf-8"))
        if not isinstance(asked["archives"], list):
            raise TypeError("no list")
        archives, options = tuple(map(str, asked["archives"])), dict(asked["options"])
        how_to_read(options["reading"])
        return Asked(str(asked["task"]), archives, options, int(asked["size"]))
    except (OSError, ValueError, LookupError, TypeError, ArithmeticError, RecursionError, AttributeError) as error:
        raise DataError(
            f"expected a folder that kineme has written with --workers, --scheduler or --shard, got {output}, without "
            f"a {RUN} that can be read; its command, called again with --force, writes one"
        ) from error


def check(output: str | Path) -> Checked:
    """Compare the parts in a folder with the archive as it is now.

    Only the listing of the archive and the metadata of parts are read. Raises `DataError`: no such folder, or no
    archive.
    """
    output = Path(output)
    asked = read_run(output)
    return checked(job_of(asked.task, str(output), asked.options), plan_of(asked).pieces)


def plan_of(asked: Asked) -> Plan:
    """Return the plan of its archives. Raises `DataError`: one is not there."""
    for archive in asked.archives:
        if not is_remote(archive) and not path_at(archive).exists():
            raise DataError(
                f"expected the archive {archive}, found nothing there; where it has moved, call its command again with "
                "the place where it is now"
            )
    return plan(asked.archives, asked.size, **asked.options["reading"])


def checked(job: Job, pieces: tuple[Piece, ...]) -> Checked:
    """Compare parts with pieces."""
    parts: list[tuple[Piece, Part]] = []
    missing: list[Piece] = []
    stale: list[Piece] = []
    failed: list[tuple[Piece, str]] = []
    names = set()
    for piece in pieces:
        path = job.path(piece)
        names.add(path.name)
        part = read_part(path)
        if part is not None and part.about == job.about(piece):
            parts.append((piece, part))
        elif job.failure(piece).exists():
            failed.append((piece, _reason(job.failure(piece))))
        else:
            (missing if part is None else stale).append(piece)
    strange = sorted(path.name for path in Path(job.output).glob("part-*") if path.name not in names)
    return Checked(tuple(parts), tuple(missing), tuple(stale), tuple(failed), tuple(strange))


def _reason(path: Path) -> str:
    try:
        return str(json.loads(path.read_text(encoding="utf-8"))["reason"])
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return "its reason cannot be read"


def tables_of(job: Job, of: Checked, columns: Sequence[str] | None = None) -> Iterator[Any]:
    """Yield the rows of all parts, or some columns of them, one part in memory at a time, in the order of the plan."""
    import pyarrow as pa
    from pyarrow import parquet

    for piece, part in of.parts:
        if part.rows:
            path = job.path(piece)
            try:
                with parquet.ParquetFile(path) as file:  # no columns of the names of folders, as a=1/
                    table = file.read(columns)
            except (OSError, pa.ArrowException) as error:
                raise DataError(
                    f"expected the rows of a piece in {path}, got a damaged file; remove it and call its command again"
                ) from error
            schema = TASKS[job.task].schema
            if schema is not None and not table.schema.equals(schema()):
                raise DataError(f"expected the rows of kineme {job.task} in {path}, got others; remove it")
            yield table
