"""``kineme annotate``: what happens when in long recordings."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import click

from kineme.cli.options import (
    GroupedCommand,
    Parsed,
    error_rate_option,
    force_option,
    heading,
    json_option,
    library_option,
    rerun_option,
)
from kineme.cli.output import check_new, progress, say, table, write
from kineme.cli.reading import layout_options, notes_beside, problem_lines, read, recordings_argument
from kineme.reporting.text import counted, printable


def _format(text: str) -> str:
    """A key of `kineme.io.writing.annotations.WRITERS`, which --help does not load."""
    from kineme.io.writing.annotations import WRITERS

    if text not in WRITERS:
        raise ValueError(f"expected one of {', '.join(WRITERS)}, got {text!r}")
    return text


@click.command(cls=GroupedCommand, short_help="Find the symbols of a library in long recordings.")
@recordings_argument
@library_option
@error_rate_option("The smaller, the more a movement may differ from those of its symbol.")
@layout_options
@heading("Output")
@click.option(
    "--output", "-o", type=click.Path(path_type=Path),
    help="What to write: a .csv, .json, .eaf (ELAN) or .txt (Audacity) file, a folder, or a copy of a bag or of a "
    "LeRobot data set.  [default: show a table]",
)  # fmt: skip
@click.option(
    "--format", "form", type=Parsed("NAME", _format), help="Format, where the ending does not say it: csv, elan, ..."
)
@json_option
@click.option("--csv", "as_csv", is_flag=True, help="Answer in CSV.")
@rerun_option
@force_option
def annotate(recordings: tuple[Path, ...], folder: Path, output: Path | None, form: str | None, **options: Any) -> None:
    """Annotate RECORDINGS, files, folders or patterns of them, or - for CSV from the standard input: what happens when.

    Every movement is searched for those of the library's symbols, with rests or without between them. Motion that is
    like no symbol is unknown. ELAN and Audacity count seconds from the first sample; tables have the recording's clock.
    How sure each is, is said as in kineme recognize; files and --json have the numbers. The p-value is the share of
    movements of known symbols that would be as novel or more.

    Example: kineme annotate long.csv --library actions/ -o long-labels.csv
    """
    from kineme.io.reading.formats import expanded
    from kineme.io.reading.recordings import paths_of
    from kineme.io.writing.annotations import as_row, is_in_place, targets_of, to_csv, write_annotations
    from kineme.io.writing.rerun import recording_scenes, write_rerun
    from kineme.library.annotate import annotate as find
    from kineme.library.library import ActionLibrary
    from kineme.recognition.answer import certainty

    as_json, as_csv, force, rerun, error_rate = (
        options.pop(name) for name in ("as_json", "as_csv", "force", "rerun", "error_rate")
    )
    if as_csv and (as_json or output is not None):
        raise click.UsageError("expected --csv alone, or --json, or --output")
    if output is None and form is not None:
        raise click.UsageError("expected --output with --format")
    sources = [source for path in recordings for source in expanded(path)]
    with ActionLibrary(folder, read_only=True) as library:
        parsed = read(recordings, options, library)
        movements = [(source.path, source.place) for source in parsed.sources]
        check_new(rerun, force, *sources, *paths_of(recordings, parsed))
        if output is not None:
            for target in targets_of(output, sources, movements, form):
                if not is_in_place(target, sources):
                    check_new(target, force, *sources, *paths_of(recordings, parsed))
                if target.is_dir() and any(target.iterdir()) and not force:
                    raise click.UsageError(
                        f"expected a new folder to write, {printable(target)} is there; write over it with --force"
                    )
        total = float(parsed.demonstrations.durations.sum())
        bar_format = "{l_bar}{bar}| {n:.0f} of {total:.0f} s [{elapsed}<{remaining}]"
        with progress(total=total, desc="annotating", bar_format=bar_format) as bar:
            report = find(library.store, parsed, error_rate, lambda done: bar.update(min(done, total) - bar.n))
        notes = notes_beside(parsed, options, library.channels)
    written = [] if output is None else write_annotations(output, report.annotations, sources, form, movements)
    if rerun is not None:
        written.append(write_rerun(rerun, recording_scenes(parsed, report.annotations), replace=force))
    is_guess = not report.calibrated
    data = {
        "annotations": [
            as_row(each) | {"certainty": certainty(each.confidence, is_new=each.unknown, is_guess=is_guess)}
            for each in report.annotations
        ],
        "seconds": total,
        "calibrated": report.calibrated,
        "written": list(map(str, written)),
        "notes": notes,
        "problems": [str(problem) for problem in (*parsed.problems, *report.problems)],
    }
    problems = problem_lines((*parsed.problems, *report.problems), "not annotated: ")
    if as_csv:
        write(to_csv(report.annotations).decode().removesuffix("\n"))
        for line in _remarks(data, problems):
            write(line, err=True)
    else:
        say(as_json, data, lambda: _text(data, problems))


def _text(data: dict[str, Any], problems: list[str]) -> str:
    rows, written = data["annotations"], data["written"]
    symbols = [row["symbol"] for row in rows if not row["unknown"]]
    counts = f"{counted(len(symbols), 'movement')} of {counted(len(set(symbols)), 'symbol')}"
    lines = [f"{counts}, {len(rows) - len(symbols):,} unknown, in {data['seconds']:,.1f} s"]
    names = ["unknown" if row["unknown"] else printable(row["symbol"]) for row in rows]
    if rows and written:
        seconds: Counter[str] = Counter()
        for name, row in zip(names, rows, strict=True):
            seconds[name] += row["end"] - row["start"]
        totals = [(name, f"{n:,}", f"{seconds[name]:,.1f}") for name, n in Counter(names).most_common()]
        lines.append(table(("symbol", "times", "seconds"), totals))
    elif rows:
        heads = ("recording", "start [s]", "end [s]", "symbol", "how sure")
        where = [printable(f"{row['recording']} {row['place']}".strip()) for row in rows]
        spans = [(f"{row['start']:.2f}", f"{row['end']:.2f}") for row in rows]
        cells = zip(where, spans, names, rows, strict=True)
        lines.append(table(heads, [(of, *span, name, row["certainty"]) for of, span, name, row in cells]))
    return "\n".join([*lines, *_remarks(data, problems), *(f"written to {printable(path)}" for path in written)])


def _remarks(data: dict[str, Any], problems: list[str]) -> list[str]:
    """List what to know of the annotations, and what has none."""
    guess = (
        "What is unknown is a guess: too few demonstrations tell how much movements of one symbol differ, so that "
        "nothing more than looks like a symbol; learn more of each"
    )
    return [*([] if data["calibrated"] else [guess]), *map(printable, data["notes"]), *problems]
