"""``kineme gather``: one answer of the parts of a large archive."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import click

from kineme.cli.audit import AuditFiles, audit_text
from kineme.cli.learn import joined_since, learned_text, named_of
from kineme.cli.options import FILE, FOLDER, GroupedCommand, force_option, heading, json_option, opened
from kineme.cli.output import check_new, progress, say, table, unlisted
from kineme.cli.pieces import SHOWN, UNFINISHED
from kineme.reporting.text import counted, printable

_NOT_DONE = ("missing", "stale", "failed", "strange")  # what may be wrong with a piece


@click.command(cls=GroupedCommand, short_help="Check the parts of a large archive, and make one answer of them.")
@click.argument("parts", type=FOLDER)
@click.option("--partial", is_flag=True, help="Make an answer of the parts that are there, though others are not.")
@heading("Output")
@click.option(
    "--output", "-o", type=click.Path(path_type=Path),
    help="What to write, as the command itself does: a table of annotate or find, a copy of a data set of annotate, a "
    "page of audit.  [default: show a summary]",
)  # fmt: skip
@click.option("--train-mask", "mask", type=FILE, help="Of an audit: which episodes to train on, .csv or .json.")
@json_option
@force_option
def gather(parts: Path, partial: bool, output: Path | None, mask: Path | None, as_json: bool, force: bool) -> None:
    """Gather PARTS, the folder of a command with --workers, --scheduler or --shard: check that every piece is there.

    Pieces are compared with the archive as it is now: one whose files have changed since is stale, and its command,
    called again, does it anew. This is the only step that reads all parts.

    Parts of kineme learn are stored in the library, as one process would have learned them: one change, which one undo
    takes back. Movements that are stored already are not stored again.

    The exit status is 0 if all pieces are there, and 3 if some are missing, stale or failed; then nothing is written
    without --partial.

    Example: kineme gather out/ -o labels.csv
    """
    from kineme.pieces.gather import checked, plan_of, read_run, tables_of
    from kineme.pieces.tasks import job_of

    asked = read_run(parts)
    if mask is not None and asked.task != "audit":
        raise click.UsageError(f"expected --train-mask with the parts of kineme audit, got those of {asked.task}")
    if output is not None:
        check_new(output, force, *(path for path in asked.archives if Path(path).exists()))
    job, plan = job_of(asked.task, str(parts), asked.options), plan_of(asked)
    found = checked(job, plan.pieces)
    data: dict[str, Any] = {
        "task": asked.task,
        "pieces": {"done": len(found.parts)} | {name: len(getattr(found, name)) for name in _NOT_DONE},
        "recordings": sum(part.recordings for _, part in found.parts),
        "seconds": sum(part.seconds for _, part in found.parts),
        "problems": [*map(str, plan.problems), *found.problems],
    }
    words = [found.in_words()]
    if found.parts and (found.is_complete or partial):
        words.append(
            _ANSWERS[asked.task](
                asked, lambda columns=None: tables_of(job, found, columns), Files(output, mask, force), data
            )
        )
    words += [f"not read: {printable(problem)}" for problem in data["problems"][:SHOWN]]
    words += unlisted({"problems": data["problems"]}, SHOWN)
    say(as_json, data, lambda: "\n".join(words))
    if not found.is_complete:
        click.get_current_context().exit(UNFINISHED)


class Files(NamedTuple):
    """What to write of all parts."""

    output: Path | None
    mask: Path | None  # of an audit: the episodes that are kept
    force: bool


def _annotated(asked: Any, tables: Callable[..., Iterable[Any]], files: Files, data: dict[str, Any]) -> str:
    """Write the annotations of all parts; those of kineme find the surest first."""
    from kineme.io.writing.annotations import Annotation, write_annotations, writer_of

    output, sources = files.output, [Path(path) for path in asked.archives]
    counts: Counter[str] = Counter()
    seconds: dict[str, float] = defaultdict(float)

    def several() -> Iterable[list[Any]]:
        for rows in tables():
            notes = [Annotation(**row) for row in rows.to_pylist()]
            for note in notes:
                name = "unknown" if note.unknown else printable(str(note.symbol))
                counts[name] += 1
                seconds[name] += note.end - note.start
            yield notes

    written: list[Path] = []
    if asked.task == "find":
        notes = sorted((note for rows in several() for note in rows), key=lambda hit: (-hit.confidence, -hit.p_value))
        if output is not None:  # in this order, not by recordings
            written = [writer_of(output, None, []).write(output, notes, None)]
    elif output is not None and (stream := writer_of(output, None, sources).stream) is not None:
        written = [stream(output, several())]
    else:
        notes = [note for rows in several() for note in rows if output is not None]
        if output is not None:
            written = write_annotations(output, notes, sources)
    data["symbols"] = {name: {"times": n, "seconds": seconds[name]} for name, n in counts.most_common()}
    data["written"] = list(map(str, written))
    rows = [(name, f"{n:,}", f"{seconds[name]:,.1f}") for name, n in counts.most_common()]
    lines = [table(("symbol", "times", "seconds"), rows)] if rows else []
    return "\n".join([*lines, *(f"written to {printable(path)}" for path in written)])


def _audited(asked: Any, tables: Callable[..., Iterable[Any]], files: Files, data: dict[str, Any]) -> str:
    """Compare the episodes of all parts; those that are drawn are read again."""
    from kineme.audit.run import audit_measured
    from kineme.io.reading.episodes import read_episodes
    from kineme.pieces.tasks import measured, numbered

    rows = (row for part in tables() for row in measured(part))
    result = audit_measured(numbered(rows), asked.options["error_rate"])
    dataset = Path(asked.archives[0])
    reports = AuditFiles(files.output, files.mask)
    reports.check(files.force, dataset)
    said = reports.write(result, dataset, lambda: read_episodes(dataset, rate=asked.options["rate"]), files.force)
    data |= said
    return audit_text(result, said)


def _inspected(asked: Any, tables: Callable[..., Iterable[Any]], files: Files, data: dict[str, Any]) -> str:
    """Summarize movements by label."""
    if files.output is not None:
        raise click.UsageError("expected no --output, inspect shows a table; say --json for numbers")

    from kineme.io.inspection.inspect import labels_as_words, summaries, summary_as_data
    from kineme.pieces.learned import inspected_alike
    from kineme.pieces.tasks import inspected

    rows, columns = inspected_alike(tables, asked, data["problems"])
    if rows is None:
        return "no movements"
    labels = summaries(inspected(rows))
    data["labels"] = [summary_as_data(summary) for summary in labels]
    data["columns"] = {columns: rows.num_rows}
    return labels_as_words(labels, f"{counted(rows.num_rows, 'movement')}")


def _learned(asked: Any, tables: Callable[..., Iterable[Any]], files: Files, data: dict[str, Any]) -> str:
    """Store all movements in the library, in the order of the archive."""
    from kineme.pieces.learned import learned, survey

    if files.output is not None or files.mask is not None:
        raise click.UsageError("expected no --output and no --train-mask, learn stores movements in its library")
    of = survey(tables, asked, data["problems"])
    data["notes"] = list(of.notes)
    with opened(asked.options["library"], read_only=False) as library, progress(total=of.rows, desc="learning") as bar:
        before, n = library.version, 0
        totals: Counter[str] = Counter()
        symbols: dict[str, None] = {}
        kept: Counter[tuple[str, str]] = Counter()
        for labels, report in learned(library.store, tables, asked, of, data["problems"]):
            n = len(report.ids)
            named = named_of(library, report.ids, labels)
            totals.update(added=report.added, duplicates=n - report.added, without_symbol=named["without_symbol"])
            kept.update({(row["symbol"], row["label"]): row["movements"] for row in named["kept"]})
            symbols |= dict.fromkeys(report.symbols)
            bar.update(n)
        data |= {
            "library": asked.options["library"],
            **{name: totals[name] for name in ("added", "duplicates", "without_symbol")},
            "joined": joined_since(library, before) if totals["duplicates"] else 0,
            "kept": [{"symbol": symbol, "label": label, "movements": k} for (symbol, label), k in kept.items()],
            "symbols": list(symbols),
            "movements": len(library),
            "people": of.people,
            "version": library.version,
        }
    return learned_text(data, [])


def _featured(asked: Any, tables: Callable[..., Iterable[Any]], files: Files, data: dict[str, Any]) -> str:
    """Say how to search the shards, which are read where they lie."""
    if files.output is not None:
        raise click.UsageError("expected no --output, shards are searched where they lie: kineme serve")
    shards = printable(str(asked.options["shards"]))
    return f"search among them: kineme serve --library {printable(str(asked.options['library']))} --shards {shards}"


#: Task -> what makes one answer of the rows of all parts; it adds to the data of the answer, and returns its words.
_ANSWERS: dict[str, Callable[[Any, Callable[..., Iterable[Any]], Files, dict[str, Any]], str]] = {
    "annotate": _annotated,
    "find": _annotated,
    "audit": _audited,
    "inspect": _inspected,
    "features": _featured,
    "learn": _learned,
}
