"""``kineme correct``: what a person corrected of annotations becomes examples of the library."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import click

from kineme.cli.options import FILE, GroupedCommand, error_rate_option, json_option, library_option, opened
from kineme.cli.output import progress, say, stretch_cells, table, unlisted
from kineme.cli.reading import layout_options, pieces, problem_lines, recordings_argument
from kineme.reporting.text import counted, printable

_SHOWN = 20  # changes and problems that are listed; --json has all


@click.command(cls=GroupedCommand, short_help="Learn what a person corrected of annotations.")
@recordings_argument
@library_option
@click.option(
    "--labels", "corrected", type=FILE,
    help="What the person left: a table, or of ELAN or Audacity.  [default: RECORDINGS-corrections.csv of the studio]",
)  # fmt: skip
@click.option(
    "--before", "annotated", type=FILE,
    help="What kineme annotate wrote.  [default: what it wrote into the data set, else the recordings annotated again]",
)  # fmt: skip
@click.option("--dry-run", is_flag=True, help="Say what would be learned, and learn nothing.")
@error_rate_option("That with which they were annotated.")
@layout_options
@json_option
def correct(recordings: tuple[Path, ...], folder: Any, **options: Any) -> None:
    """Learn what a person corrected in annotated RECORDINGS, files, folders or data sets, as examples of symbols.

    Stretches with another symbol or other boundaries than annotated, those that were unknown and have a name, and those
    that were added, are examples of their symbols, which are made where they are new. What is as kineme annotate left
    it is not learned. kineme library undo takes back what was learned.

    Example: kineme correct named/ --library actions/
    """
    from kineme.io.reading.formats import root_of
    from kineme.io.reading.read_labels import read_labels
    from kineme.library.correct import contradicted, corrections_of, learn_corrections

    as_json, dry_run, error_rate = (options.pop(name) for name in ("as_json", "dry_run", "error_rate"))
    corrected, annotated = options.pop("corrected"), options.pop("annotated")
    table_of = read_labels(corrected or _beside(recordings))
    with opened(folder, read_only=dry_run) as library:
        parsed = _recordings(recordings, options, library, [row.place for row in table_of.rows])
        before = (
            read_labels(annotated) if annotated is not None else _annotated(recordings, parsed, library, error_rate)
        )
        root = root_of(*recordings)
        corrections = corrections_of(parsed, table_of, before, root)
        symbols, version = {symbol.name for symbol in library.symbols()}, library.version
        report = learn_corrections(library.store, parsed, corrections, options, root, dry_run)
        learned = [change for change in corrections.changes if change.learned]
        data = {
            "changes": [
                {
                    "kind": change.kind, "recording": parsed.sources[change.stretch.recording].path,
                    "place": parsed.sources[change.stretch.recording].place, "start": change.stretch.row.start,
                    "end": change.stretch.row.end, "symbol": change.stretch.row.label, "was": change.was,
                    "learned": change.learned,
                }
                for change in corrections.changes
            ],
            "unchanged": corrections.unchanged,
            "learned": report.added,
            "moved": report.moved,
            "duplicates": report.duplicates,
            "symbols": sorted({str(change.stretch.row.label) for change in learned} - symbols),
            "contradicted": [
                {
                    "movement": example.movement, "recording": parsed.sources[example.stretch.recording].path,
                    "place": parsed.sources[example.stretch.recording].place, "start": example.start,
                    "end": example.end, "symbol": example.symbol, "now": example.stretch.row.label,
                }
                for example in contradicted(library.store, parsed, corrections)
            ],
            "version": library.version,
            "dry_run": dry_run,
            "problems": [str(problem) for problem in (*parsed.problems, *corrections.problems)],
        }  # fmt: skip
    problems = problem_lines((*parsed.problems, *corrections.problems), "not read: ")
    undo = "" if data["version"] == version else f"take it back: kineme library undo --library {printable(folder)}"
    say(as_json, data, lambda: _text(data, undo, problems))


def _beside(recordings: tuple[Path, ...]) -> Path:
    """The table of corrections that the studio writes beside what it opened."""
    from kineme.library.correct import corrections_beside

    path = corrections_beside(recordings[0])
    if len(recordings) > 1 or not path.is_file():
        raise click.UsageError(f"expected --labels, or the corrections of the studio in {printable(path)}, got neither")
    return path


def _recordings(paths: tuple[Path, ...], options: dict[str, Any], library: Any, places: list[str]) -> Any:
    """Read the recordings; of data sets the episodes that have corrections alone."""
    from kineme.errors import DataError
    from kineme.io.records import Problem

    several = list(pieces(paths, options, library, places))
    read = [piece for piece in several if not isinstance(piece, Problem)]
    if len(read) != 1:
        raise DataError(
            f"expected one data set, or files, to correct, got {len(read)} data sets that can be read"
            + "".join(f"; {piece}" for piece in several if isinstance(piece, Problem))
        )
    return read[0]


def _annotated(paths: tuple[Path, ...], parsed: Any, library: Any, error_rate: float) -> Any:
    """Return what was annotated: as it stands in the data set, else found again."""
    from kineme.library.annotate import annotate_by
    from kineme.library.correct import as_labels, motions_in
    from kineme.library.recognize import some_of_each_symbol

    motions = motions_in(paths[0]) if len(paths) == 1 else []
    if motions:
        return as_labels(motions)
    total = float(parsed.demonstrations.durations.sum())
    with progress(total=total, desc="annotating as before", unit="s") as bar:
        classes = some_of_each_symbol(library.store)
        report = annotate_by(classes, parsed, error_rate, lambda done: bar.update(min(done, total) - bar.n))
    return as_labels(report.annotations)


def _text(data: dict[str, Any], undo: str, problems: list[str]) -> str:
    from kineme.library.correct import CHANGES

    changes = data["changes"]
    counts = Counter(change["kind"] for change in changes)
    new = f", {counted(len(data['symbols']), 'new symbol')}" if data["symbols"] else ""
    moved = f", {data['moved']:,} moved to another symbol" if data["moved"] else ""
    stored = f", {n:,} stored already" if (n := data["duplicates"] - data["moved"]) else ""
    learned = f"{'would learn' if data['dry_run'] else 'learned'} {counted(data['learned'], 'movement')}"
    lines = [f"{learned}{moved}{stored}{new}; {data['unchanged']:,} as annotated, not learned"]
    lines += [f"{n:,} {kind}: {CHANGES[kind]}" for kind, n in counts.items()]
    if changes:
        cells = [
            (
                *stretch_cells(change), printable(change["symbol"] or "unknown"), printable(change["was"] or "-"),
                change["kind"],
            )
            for change in changes[:_SHOWN]
        ]  # fmt: skip
        lines.append(table(("recording", "start [s]", "end [s]", "symbol", "was", "change"), cells))
    others = [
        (str(row["movement"]), *stretch_cells(row), printable(row["symbol"]), printable(row["now"] or "unknown"))
        for row in data["contradicted"]
    ]
    if others:
        title = "learned before, and not as it is now; remove what is wrong: kineme library delete --movement ID"
        lines.append(table(("ID", "recording", "start [s]", "end [s]", "symbol", "now"), others[:_SHOWN], title))
    lines += problems[:_SHOWN]
    lines += unlisted({"changes": changes, "examples": others, "problems": problems}, _SHOWN)
    return "\n".join([*lines, undo] if undo else lines)
