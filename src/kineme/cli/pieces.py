"""Commands over an archive in pieces: the options that say so, and what the commands share."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click

from kineme.cli.options import Parsed, under, whole
from kineme.cli.output import progress, say, unlisted
from kineme.reporting.text import counted, printable

SHOWN = 20  # problems that are listed
UNFINISHED = 3  # exit status
_MIB = 2**20


#: Task -> what gather does with its parts, where it writes no file of them.
_GATHERED = {"learn": "stores them in the library", "features": "checks them, kineme serve answers by them"}


def _shard(text: str) -> tuple[int, int]:
    """A shard of all, as ``3/64``: the third of 64."""
    match = re.fullmatch(r"(\d+)/(\d+)", text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise ValueError(f"expected a shard as 3/64, from 1/64 to 64/64, got {text!r}")
    return int(match[1]), int(match[2])


#: Add the options that divide an archive into pieces. One of the first three, or an archive elsewhere, asks for it.
pieces_options = under(
    "Large archives",
    click.option("--workers", type=whole(1), help="Processes of this machine; --output is a folder of parts then."),
    click.option("--scheduler", metavar="ADDRESS", help="Scheduler of a cluster of Dask, as tcp://head:8786."),
    click.option(
        "--shard",
        type=Parsed("I/N", _shard),
        help="Every N-th piece alone, for the I-th of N jobs that share a folder.",
    ),
    click.option(
        "--time-limit",
        type=click.FloatRange(0, min_open=True),
        help="Of a piece [min]: one of --workers that takes longer is ended, and its piece fails.  [default: 360]",
    ),
    click.option(
        "--piece-size", type=whole(1, 65536), default=16, show_default=True, help="Size of a piece, about [MiB]."
    ),
)

PIECES_OPTIONS: tuple[str, ...] = ("workers", "scheduler", "shard", "piece_size", "time_limit")


def how_divided(options: dict[str, Any], recordings: Sequence[Any]) -> dict[str, Any] | None:
    """Take the options of pieces out of all, and return them; None where the command is to read everything itself."""
    from kineme.pieces.archive import is_remote

    how = {name: options.pop(name) for name in PIECES_OPTIONS}
    asked = any(how[name] is not None for name in PIECES_OPTIONS[:3]) or any(map(is_remote, map(str, recordings)))
    return how if asked else None


def in_pieces(  # noqa: PLR0913 - what a command knows when it hands its work on
    task: str,
    recordings: Sequence[Any],
    output: Path | None,
    how: Mapping[str, Any],
    options: dict[str, Any],
    library: Any = None,
    *,
    force: bool = False,
    as_json: bool = False,
) -> None:
    """Do a command piece by piece: each part of its answer becomes a file in the folder `output`."""
    from kineme.io.records import needs
    from kineme.pieces.archive import check_apart, is_remote, path_at
    from kineme.pieces.executors import TIME_LIMIT, cluster_client
    from kineme.pieces.gather import Asked, write_run
    from kineme.pieces.mapping import run
    from kineme.pieces.planning import plan
    from kineme.pieces.run import FAILED, summary_of
    from kineme.pieces.tasks import job_of, plain

    with needs("pyarrow", "write parts in Parquet", "parquet"):
        import pyarrow  # noqa: F401 - before anything is read
    if output is None or output.is_file() or (output.suffix[1:].isalpha() and not output.is_dir()):
        raise click.UsageError(
            "expected --output FOLDER, the folder of the parts, with --workers, --scheduler, --shard or an archive in "
            f"a store, got {'none' if output is None else printable(output)}; kineme gather reads all of them"
        )
    if how["workers"] is not None and how["scheduler"] is not None:
        raise click.UsageError("expected --workers or --scheduler, not both")
    if how["time_limit"] is not None and how["workers"] is None:
        raise click.UsageError("expected --workers with --time-limit, this process cannot end itself; say --workers 1")
    reading = plain(options.pop("reading"))
    if reading.get("join_files"):
        raise click.UsageError("expected recordings that are read one by one, got --join-files; join them first")
    archives = tuple(map(str, recordings))
    if "-" in archives:
        raise click.UsageError("expected files or folders to divide into pieces, got the standard input")
    check_apart(output, archives)
    if len(archives) == 1 and not is_remote(archives[0]):  # kineme gather finds it from everywhere
        archives = (str(path_at(archives[0]).absolute()),)
    options = {**options, "reading": reading}
    asked = Asked(task, archives, options, how["piece_size"] * _MIB)
    planned = plan(archives, asked.size, **reading)
    if library is not None:  # it is created for an archive that is there
        options = options | _of_library(library, task, output, force)
        asked = Asked(**(vars(asked) | {"options": options}))
    write_run(output, asked, replace=force)
    part = planned if how["shard"] is None else planned.shard(*how["shard"])
    job = job_of(task, str(output), options)
    connected = nullcontext(None) if how["scheduler"] is None else cluster_client(how["scheduler"])
    with connected as client, progress(total=len(part.pieces), desc=task, unit="piece") as bar:
        limit = TIME_LIMIT if how["time_limit"] is None else 60 * how["time_limit"]
        outcomes = run(job, part.pieces, how["workers"], client, limit, lambda outcome: bar.update())
    failures = [(outcome.piece, outcome.reason) for outcome in outcomes if outcome.state == FAILED]
    problems = [*map(str, part.problems), *(problem for outcome in outcomes for problem in outcome.problems)]
    data = {
        "task": task,
        "pieces": dict(sorted(Counter(outcome.state for outcome in outcomes).items())),
        "recordings": sum(outcome.recordings for outcome in outcomes),
        "seconds": sum(outcome.seconds for outcome in outcomes),
        "failed": [{"piece": str(piece), "reason": reason} for piece, reason in failures],
        "problems": problems,
        "output": str(output),
    }
    say(as_json, data, lambda: _text(data, summary_of(outcomes)))
    if failures:
        click.get_current_context().exit(UNFINISHED)


def _of_library(folder: Any, task: str, output: Path, force: bool) -> dict[str, Any]:
    """The options that say which library parts depend on; to learn, it is created if it does not exist."""
    from kineme.library.library import ActionLibrary, is_library
    from kineme.library.storage.address import Address, as_location
    from kineme.pieces.shards import shared_reduction

    location = as_location(folder)
    if isinstance(location, Address):
        if location.without_secrets(location.uri) != location.uri:  # it would be written beside the parts
            raise click.UsageError(f"expected an address without a password, got {location}; say it in PGPASSWORD")
        said: dict[str, Any] = {"library": str(folder)}
    else:
        said = {"library": str(location.absolute())}
    is_new = task == "learn" and not is_library(folder)
    with ActionLibrary(folder, create=is_new, read_only=not is_new) as library:
        if task == "learn":  # what it holds makes no difference to how movements are described
            return said | {"specification": library.specification.to_json()}
        if task == "features":
            bases = shared_reduction(output, library.store, renew=force).digest
            return said | {"library_id": library.store.id, "bases": bases, "shards": str(output.absolute())}
        # The time, too: where a backup is put back, another version gets the same number.
        version = max(([version.id, version.at] for version in library.history()), default=[0, ""])
        return said | {"library_id": library.store.id, "library_version": version}


def _text(data: dict[str, Any], summary: str) -> str:
    n = data["recordings"]
    read = f", {counted(n, 'recording')} of {data['seconds']:,.1f} s" if n else ""
    lines = [f"{summary}{read}"]
    lines += [f"failed: {printable(row['piece'])}: {printable(row['reason'])}" for row in data["failed"][:SHOWN]]
    lines += [f"not read: {printable(problem)}" for problem in data["problems"][:SHOWN]]
    lines += unlisted({"failed": data["failed"], "problems": data["problems"]}, SHOWN)
    again = "; run it again to do what failed" if data["failed"] else ""
    gathered = _GATHERED.get(data["task"], "makes one file of them")
    return "\n".join([*lines, f"parts in {printable(data['output'])}: kineme gather {gathered}{again}"])
