"""``kineme annotate``: what happens when in long recordings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import click

from kineme.cli import options as opts
from kineme.cli.output import check_new, progress, say, stretch_cells, table, write
from kineme.cli.pieces import how_divided, in_pieces, pieces_options
from kineme.cli.reading import layout_options, notes_beside, pieces, problem_lines, recordings_argument, seconds_of
from kineme.reporting.text import counted, printable


def _format(text: str) -> str:
    """A key of `kineme.io.writing.annotations.WRITERS`, which --help does not load."""
    from kineme.io.writing.annotations import WRITERS

    if text not in WRITERS:
        raise ValueError(f"expected one of {', '.join(WRITERS)}, got {text!r}")
    return text


@click.command(cls=opts.GroupedCommand, short_help="Find the symbols of a library in long recordings.")
@recordings_argument
@opts.library_option
@opts.error_rate_option("The smaller, the more a movement may differ from those of its symbol.")
@layout_options
@opts.heading("Output")
@click.option(
    "--output", "-o", type=click.Path(path_type=Path),
    help="What to write: a .csv, .json, .eaf (ELAN) or .txt (Audacity) file, a folder, or a copy of a bag or of a "
    "LeRobot data set.  [default: show a table]",
)  # fmt: skip
@click.option(
    "--format",
    "form",
    type=opts.Parsed("NAME", _format),
    help="Format, where the ending does not say it: csv, elan, ...",
)
@opts.json_option
@click.option("--csv", "as_csv", is_flag=True, help="Answer in CSV.")
@opts.rerun_option
@opts.force_option
@pieces_options
def annotate(recordings: tuple[Path, ...], folder: Any, output: Path | None, form: str | None, **options: Any) -> None:
    """Annotate RECORDINGS, files, folders or patterns of them, or - for CSV from the standard input: what happens when.

    Every movement is searched for those of the library's symbols, with rests or without between them. Motion that is
    like no symbol is unknown. ELAN and Audacity count seconds from the first sample; tables have the recording's clock.
    How sure each is, is said as in kineme recognize; files and --json have the numbers. The p-value is the share of
    movements of known symbols that would be as novel or more.

    Example: kineme annotate long.csv --library actions/ -o long-labels.csv
    """
    from kineme.io.reading.formats import expanded
    from kineme.io.writing.annotations import copied_as_read, is_in_place, targets_of, to_csv, write_annotations
    from kineme.io.writing.rerun import recording_scenes, write_rerun

    as_json, as_csv, force, rerun, error_rate = (
        options.pop(name) for name in ("as_json", "as_csv", "force", "rerun", "error_rate")
    )
    how = how_divided(options, recordings)
    if how is not None:
        if as_csv or form is not None or rerun is not None:
            raise click.UsageError("expected --csv, --format and --rerun with kineme gather, or without pieces")
        asked = {"reading": options, "error_rate": error_rate}
        in_pieces("annotate", recordings, output, how, asked, folder, force=force, as_json=as_json)
        return
    if as_csv and (as_json or output is not None):
        raise click.UsageError("expected --csv alone, or --json, or --output")
    if output is None and form is not None:
        raise click.UsageError("expected --output with --format")
    sources = [source for path in recordings for source in expanded(path)]

    def check(movements: list[tuple[str, str]], *read: Path) -> None:
        check_new(rerun, force, *sources, *read)
        for target in targets_of(output, sources, movements, form) if output is not None else ():
            if not is_in_place(target, sources):
                check_new(target, force, *sources, *read)
            if target.is_dir() and any(target.iterdir()) and not force:
                raise click.UsageError(
                    f"expected a new folder to write, {printable(target)} is there; write over it with --force"
                )

    check_copied = copied_as_read(output, sources, form)
    with opts.opened(folder) as library:
        held: list[Any] | None = None if rerun is None else []
        answer = _annotated(library, recordings, options, error_rate, check, held)
    if output is not None and answer.streamed:
        check(answer.movements)
    check_copied()
    written = [] if output is None else write_annotations(output, answer.annotations, sources, form, answer.movements)
    if rerun is not None:
        scenes = (scene for piece, notes in held or () for scene in recording_scenes(piece, notes))
        written.append(write_rerun(rerun, scenes, replace=force))
    rows = [] if written and not as_json else _rows(answer)  # a large set would fill the memory once more
    data = {
        "annotations": rows,
        "seconds": answer.seconds,
        "calibrated": answer.calibrated,
        "written": list(map(str, written)),
        "notes": answer.notes,
        "problems": [str(problem) for problem in answer.problems],
    }
    problems = problem_lines(answer.problems, "not annotated: ")
    if as_csv:
        write(to_csv(answer.annotations).decode().removesuffix("\n"))
        for line in _remarks(data, problems):
            write(line, err=True)
    else:
        say(as_json, data, lambda: _text(data, answer.annotations, problems))


class _Answer(NamedTuple):
    """Annotations of all recordings, and what to say of them."""

    annotations: list[Any]
    movements: list[tuple[str, str]]  # path and place of each recording, those without annotations too
    seconds: float
    calibrated: bool
    notes: list[str]
    problems: list[Any]
    streamed: bool  # whether recordings were read in several pieces


def _annotated(
    library: Any,
    recordings: tuple[Path, ...],
    options: dict[str, Any],
    error_rate: float,
    check: Callable[..., None],
    held: list[Any] | None,
) -> _Answer:
    """Annotate recordings piece by piece, once `check` has seen what is known of the first; all are added to `held`."""
    from kineme.io.reading.recordings import paths_of
    from kineme.io.records import Problem
    from kineme.library.annotate import annotate_by
    from kineme.library.recognize import some_of_each_symbol

    classes = some_of_each_symbol(library.store)
    total = seconds_of(recordings)
    calibrated = bool(classes.calibration.calibrated(error_rate).all())
    answer = _Answer([], [], 0.0, calibrated, [], [], streamed=total is not None)
    bar_format = "{l_bar}{bar}| {n:.0f} of {total:.0f} s [{elapsed}<{remaining}]"
    with progress(total=total, desc="annotating", bar_format=bar_format) as bar:
        for piece in pieces(recordings, options, library):
            if isinstance(piece, Problem):
                answer.problems.append(piece)
                continue
            if not answer.movements:
                at_once = [] if answer.streamed else [(source.path, source.place) for source in piece.sources]
                check(at_once, *paths_of(recordings, piece))
                answer.notes.extend(notes_beside(piece, options, library.channels))
            seconds = float(piece.demonstrations.durations.sum())
            bar.total = bar.total or seconds
            done = partial(_advance, bar, answer.seconds)
            report = annotate_by(classes, piece, error_rate, done)
            answer.annotations.extend(report.annotations)
            if held is not None:
                held.append((piece, report.annotations))
            answer.movements.extend((source.path, source.place) for source in piece.sources)
            answer.problems.extend((*piece.problems, *report.problems))
            answer = answer._replace(seconds=answer.seconds + seconds)
    if not answer.movements:
        first = f"; the first: {answer.problems[0]}" if answer.problems else ""
        raise FileNotFoundError(f"expected recordings to annotate, found none that can be read{first}")
    return answer


def _advance(bar: Any, before: float, done: float) -> None:
    bar.update(min(before + done, bar.total) - bar.n)


def _rows(answer: _Answer) -> list[dict[str, Any]]:
    from kineme.io.writing.annotations import as_row
    from kineme.recognition.answer import certainty

    return [
        as_row(each) | {"certainty": certainty(each.confidence, is_new=each.unknown, is_guess=not answer.calibrated)}
        for each in answer.annotations
    ]


def _text(data: dict[str, Any], annotations: list[Any], problems: list[str]) -> str:
    rows, written = data["annotations"], data["written"]
    counts_of = Counter("unknown" if each.unknown else printable(each.symbol) for each in annotations)
    symbols = [each.symbol for each in annotations if not each.unknown]
    counts = f"{counted(len(symbols), 'movement')} of {counted(len(set(symbols)), 'symbol')}"
    lines = [f"{counts}, {len(annotations) - len(symbols):,} unknown, in {data['seconds']:,.1f} s"]
    if annotations and written:
        seconds: Counter[str] = Counter()
        for each in annotations:
            seconds["unknown" if each.unknown else printable(each.symbol)] += each.end - each.start
        totals = [(name, f"{n:,}", f"{seconds[name]:,.1f}") for name, n in counts_of.most_common()]
        lines.append(table(("symbol", "times", "seconds"), totals))
    elif rows:
        heads = ("recording", "start [s]", "end [s]", "symbol", "how sure")
        names = ["unknown" if row["unknown"] else printable(row["symbol"]) for row in rows]
        cells = [(*stretch_cells(row), name, row["certainty"]) for row, name in zip(rows, names, strict=True)]
        lines.append(table(heads, cells))
    return "\n".join([*lines, *_remarks(data, problems), *(f"written to {printable(path)}" for path in written)])


def _remarks(data: dict[str, Any], problems: list[str]) -> list[str]:
    """List what to know of the annotations, and what has none."""
    guess = (
        "What is unknown is a guess: too few demonstrations tell how much movements of one symbol differ, so that "
        "nothing more than looks like a symbol; learn more of each"
    )
    return [*([] if data["calibrated"] else [guess]), *map(printable, data["notes"]), *problems]
