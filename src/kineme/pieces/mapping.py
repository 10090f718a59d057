"""A function of the user over the recordings of an archive, piece by piece, on any executor."""

from __future__ import annotations

import hashlib
import pickle
import secrets
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from types import CodeType
from typing import Any

from kineme.errors import DataError
from kineme.io.reading.merge_files import Recordings
from kineme.io.records import needs
from kineme.pieces.archive import check_apart
from kineme.pieces.executors import TIME_LIMIT, execute
from kineme.pieces.planning import PIECE_BYTES, plan
from kineme.pieces.run import Job, Outcome, Source, recordings_of
from kineme.reporting.atomic import remove_leftovers

Rows = Mapping[str, Sequence[Any]]


def map(  # noqa: A001, PLR0913 - as in the standard library, over movements
    function: Callable[[Recordings], Rows | None],
    archive: str | Path | Sequence[str | Path],
    client: Any = None,
    *,
    output: str | Path,
    workers: int | None = None,
    size: int = PIECE_BYTES,
    time_limit: float = TIME_LIMIT,
    progress: Callable[[Outcome], object] | None = None,
    **reading: Any,
) -> list[Outcome]:
    """Call ``function(recordings)`` for all recordings of an archive, and write the rows that it returns.

    Each piece of `plan` becomes a file ``part-*.parquet`` in the folder `output`, whole or not at all. Called again,
    pieces whose part is there and fits are skipped: nothing else remembers what is done. An exception fails its piece
    and no other. The outcomes are returned in the order of the plan, one of each piece.

    Parameters
    ----------
    function : callable
        Takes `Recordings`, a file or some episodes at a time; returns name of a column -> values, all equally many, or
        None for no rows. For processes and clusters it must be a function of a module, found by its name.
    archive : str, Path, or sequence of them
        As for `plan`.
    client : distributed.Client, optional
        The user's own client of Dask; its workers read the archive and write to `output` themselves.
    output : str or Path
        A folder, created if it is not there, that all workers see.
    workers : int, optional
        So many processes of this machine; by default the work is done in this process.
    size : int
        Of a piece [bytes], see `plan`.
    time_limit : float
        Of a piece [s], six hours by default: a process of `workers` that takes longer is ended, and its piece fails.
        Work in this process cannot be ended.
    progress : callable, optional
        Called with the outcome of each piece.
    **reading
        Options of `kineme.read_recordings`: ``columns``, ``label_by``, ...

    Raises
    ------
    DataError
        Nothing there; workers with other versions; pyarrow is missing.
    """
    with needs("pyarrow", "write Parquet", "parquet"):
        import pyarrow  # noqa: F401 - before any piece is read
    archives = [str(each) for each in ([archive] if isinstance(archive, (str, Path)) else archive)]
    check_apart(output, archives)
    planned = plan(archives, size, **reading)
    return run(job_of_function(function, output, reading), planned.pieces, workers, client, time_limit, progress)


def job_of_function(function: Callable[[Recordings], Rows | None], output: Any, reading: Mapping[str, Any]) -> Job:
    """Return the job of a function; with other code it is another job."""
    name = f"{getattr(function, '__module__', '')}.{getattr(function, '__qualname__', type(function).__qualname__)}"
    specification = {"function": name, "code": _checksum(function), "reading": dict(sorted(reading.items()))}
    return Job("map", partial(_rows, function, reading), str(output), specification)


def _checksum(function: Any) -> str:
    """Return a checksum of the code of a function and of the values that it carries, not of what it calls.

    Where these cannot be written down, it is another one each time.
    """
    values: list[Any] = []
    while isinstance(function, partial):
        values += [function.args, sorted(function.keywords.items())]
        function = function.func
    values.append(getattr(function, "__self__", None))  # of a method, or of what is built in, its module
    if not hasattr(function, "__code__"):
        values.append(function)
        function = type(function).__call__
    try:
        values += [getattr(function, name, None) for name in ("__defaults__", "__kwdefaults__")]
        values += [cell.cell_contents for cell in getattr(function, "__closure__", None) or ()]
        data = pickle.dumps([_lines(getattr(function, "__code__", None)), values])
    except Exception:  # whatever pickle raises
        data = secrets.token_bytes()
    return hashlib.blake2b(data, digest_size=16).hexdigest()


def _lines(code: Any) -> Any:
    """Return what code does, without where it stands."""
    if isinstance(code, CodeType):
        return [code.co_code, code.co_names, [_lines(each) for each in code.co_consts]]
    return sorted(repr(each) for each in code) if isinstance(code, frozenset) else repr(code)


def run(
    job: Job,
    pieces: Sequence[Any],
    workers: int | None = None,
    client: Any = None,
    time_limit: float = TIME_LIMIT,
    progress: Callable[[Outcome], object] | None = None,
) -> list[Outcome]:
    """Do a job on pieces, and return their outcomes in the order of the pieces."""
    Path(job.output).mkdir(parents=True, exist_ok=True)
    remove_leftovers(Path(job.output), r"(?:part|failed)-[0-9a-f]{16}\.\w+")
    outcomes = {}
    # What is under way ends with an error here, too.
    with closing(execute(job, pieces, workers, client, time_limit)) as done:
        for outcome in done:
            outcomes[outcome.piece.key] = outcome
            if progress is not None:
                progress(outcome)
    return [outcomes[piece.key] for piece in pieces]


def _rows(function: Callable[[Recordings], Rows | None], reading: Mapping[str, Any], source: Source) -> Iterable[Any]:
    import pyarrow as pa

    for recordings in recordings_of(source, reading):
        rows = function(recordings)
        if isinstance(rows, Mapping):
            try:
                yield pa.table(dict(rows))
            except (pa.ArrowException, TypeError) as error:
                raise DataError(f"expected columns of equally many values of one kind each, got {error}") from error
        elif isinstance(rows, pa.Table):
            yield rows
        elif rows is not None:
            raise DataError(
                f"expected a dictionary of columns, or None for no rows, from the function, got {type(rows).__name__}"
            )
