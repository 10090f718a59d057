"""``kineme annotate``: what happens when in long recordings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import click

from kineme.cli.options import Finite, force_option, json_option, library_option
from kineme.cli.output import check_new, say
from kineme.cli.reading import layout_options
from kineme.cli.several import read_each
from kineme.output.text import counted, printable


class Format(click.ParamType):  # type: ignore[type-arg]
    """A key of `kineme.files.annotations.writers.WRITERS`, which --help does not load."""

    name = "NAME"

    def convert(self, value: Any, param: Any, ctx: Any) -> str:
        """The name, if there is such a format."""
        from kineme.files.annotations.writers import WRITERS

        if value not in WRITERS:
            self.fail(f"expected one of {', '.join(WRITERS)}, got {value!r}", param, ctx)
        return str(value)


@click.command(short_help="Find the symbols of a library in long recordings.")
@click.argument("recordings", nargs=-1, required=True, type=click.Path(allow_dash=True, path_type=Path))
@library_option
@click.option(
    "--output", "-o", type=click.Path(path_type=Path),
    help="What to write: a .csv, .json, .eaf (ELAN) or .txt (Audacity) file, a folder, or a copy of a bag or of a "
    "LeRobot data set.  [default: show a table]",
)  # fmt: skip
@click.option("--format", "form", type=Format(), help="Format, where the ending does not say it: csv, elan, ...")
@click.option(
    "--error-rate", type=Finite(0, 1, min_open=True, max_open=True), default=0.05, show_default=True,
    help="The smaller, the more a movement may differ from those of its symbol.",
)  # fmt: skip
@layout_options
@json_option
@force_option
def annotate(recordings: tuple[Path, ...], folder: Path, output: Path | None, form: str | None, **options: Any) -> None:
    """Annotate RECORDINGS, files or folders, or - for CSV from the standard input: what happens when.

    Every movement is searched for those of the library's symbols, with rests or without between them. Motion that is
    like no symbol is unknown. ELAN and Audacity count seconds from the first sample; tables have the recording's clock.
    The p-value is the share of movements of known symbols that would be as novel or more.

    Example: kineme annotate long.csv --library actions/ -o long-labels.csv
    """
    from kineme.library.library import ActionLibrary
    from kineme.library.recognition.annotate import annotate as find

    as_json, force, error_rate = (options.pop(name) for name in ("as_json", "force", "error_rate"))
    parsed, problems = read_each(recordings, options)
    movements = [(source.path, source.place) for one in parsed for source in one.sources]
    _check_output(output, form, recordings, movements, force)
    annotations, calibrated = [], True
    with ActionLibrary(folder, read_only=True) as library, _progress(parsed) as progress:
        before = 0.0
        for one in parsed:
            found = find(library.store, one, error_rate, partial(progress, before))
            before += float(one.demonstrations.durations.sum())
            annotations += found.annotations
            problems += map(str, found.problems)
            calibrated = calibrated and found.calibrated
    written = _write(output, form, recordings, movements, annotations)
    _say(as_json, annotations, problems, written, calibrated, sum(one.demonstrations.durations.sum() for one in parsed))


def _check_output(
    output: Path | None, form: str | None, recordings: tuple[Path, ...], movements: list[Any], force: bool
) -> None:
    """Refuse what cannot be written, before the work is done."""
    from kineme.files.annotations.writers import targets_of

    if output is None:
        if form is not None:
            raise click.UsageError("expected --output with --format")
        return
    for target in targets_of(output, recordings, movements, form):
        check_new(target, force, *recordings)
        if target.is_dir() and any(target.iterdir()) and not force:
            raise click.UsageError(
                f"expected a new folder to write, {printable(target)} is there; write over it with --force"
            )


def _write(output: Path | None, form: str | None, recordings: Any, movements: Any, annotations: Any) -> list[str]:
    from kineme.files.annotations.writers import write_annotations

    if output is None:
        return []
    return [str(one) for one in write_annotations(output, annotations, recordings, form, movements)]


@contextmanager
def _progress(parsed: list[Any]) -> Iterator[Callable[[float, float], None]]:
    """A progress bar on a terminal, in seconds of recordings, with the time left."""
    from tqdm import tqdm

    total = float(sum(one.demonstrations.durations.sum() for one in parsed))
    form = "{l_bar}{bar}| {n:.0f} of {total:.0f} s [{elapsed}<{remaining}]"
    with tqdm(total=total, desc="annotating", bar_format=form, leave=False, disable=None) as bar:

        def tell(before: float, done: float) -> None:
            bar.update(min(before + done, total) - bar.n)

        yield tell


def _say(as_json: bool, annotations: Any, problems: Any, written: Any, calibrated: bool, seconds: float) -> None:
    from kineme.files.annotations.tables import as_row

    data = {
        "annotations": [as_row(one) for one in annotations],
        "seconds": float(seconds),
        "calibrated": calibrated,
        "written": written,
        "problems": problems,
    }
    say(as_json, data, lambda: _text(data))


def _text(data: dict[str, Any]) -> str:
    from kineme.output.table import to_text

    rows, written = data["annotations"], data["written"]
    known = [one for one in rows if not one["unknown"]]
    said = f"{counted(len(known), 'movement')} of {counted(len({one['symbol'] for one in known}), 'symbol')}"
    lines = [f"{said}, {len(rows) - len(known):,} unknown, in {data['seconds']:,.1f} s"]
    if rows:
        lines.append(to_text(_totals(rows) if written else _each(rows)))
    if not data["calibrated"]:
        lines.append(
            "P-values, and what is unknown, are a guess: too few demonstrations tell how much movements of one symbol "
            "differ; learn more of each"
        )
    lines += [f"not annotated: {printable(problem)}" for problem in data["problems"]]
    return "\n".join([*lines, *(f"written to {printable(one)}" for one in written)])


def _each(rows: list[dict[str, Any]]) -> Any:
    from kineme.output.table import Table

    heads = ("recording", "start [s]", "end [s]", "symbol", "confidence", "p-value")
    return Table(
        "",
        heads,
        [
            (
                printable(f"{one['recording']} {one['place']}".strip()),
                f"{one['start']:.2f}",
                f"{one['end']:.2f}",
                "unknown" if one["unknown"] else printable(one["symbol"]),
                f"{one['confidence']:.2f}",
                f"{one['p_value']:.2g}",
            )
            for one in rows
        ],
    )


def _totals(rows: list[dict[str, Any]]) -> Any:
    from kineme.output.table import Table

    names = ["unknown" if one["unknown"] else printable(one["symbol"]) for one in rows]
    seconds: Counter[str] = Counter()
    for name, one in zip(names, rows, strict=True):
        seconds[name] += one["end"] - one["start"]
    counts = Counter(names).most_common()
    return Table("", ("symbol", "times", "seconds"), [(name, f"{n:,}", f"{seconds[name]:,.1f}") for name, n in counts])
