"""``kineme find``: where recordings show a symbol."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from kineme.cli import options as opts
from kineme.cli.output import check_new, progress, say, stretch_cells, table, unlisted
from kineme.cli.pieces import how_divided, in_pieces, pieces_options
from kineme.cli.reading import files_of, layout_options, problem_lines, recordings_argument
from kineme.reporting.text import counted, printable

_SHOWN = 20  # hits, and problems, that are listed; --output and --json have all


@click.command(cls=opts.GroupedCommand, short_help="Find where recordings show a symbol, the surest first.")
@click.argument("symbol")
@recordings_argument
@opts.library_option
@click.option("--also", multiple=True, metavar="SYMBOL", help="Another symbol to find; may be repeated.")
@opts.error_rate_option("The smaller, the more a movement may differ from those of its symbol.")
@layout_options
@opts.heading("Output")
@click.option(
    "--output", "-o", type=click.Path(path_type=Path),
    help="A table of all hits to write, .csv or .json; of a large archive, the folder of the parts.",
)  # fmt: skip
@opts.json_option
@opts.force_option
@pieces_options
def find(symbol: str, recordings: tuple[Path, ...], folder: Any, also: tuple[str, ...], **options: Any) -> None:
    """Find where RECORDINGS, files, folders, data sets or patterns of them, show SYMBOL, the surest hits first.

    Each recording is searched for all symbols of the library, as by kineme annotate: a stretch that is more like
    another one is no hit. Files are read one after the other, and data sets some episodes at a time; what cannot be
    read, or has other columns than the library, is listed and stops nothing. If nothing could be searched, the exit
    status is 1.

    Example: kineme find reach archive/ --library actions/ -o hits.csv
    """
    from kineme.io.writing.annotations import as_row, writer_of
    from kineme.library import annotate as search
    from kineme.recognition.answer import certainty

    as_json, force, error_rate, output = (options.pop(name) for name in ("as_json", "force", "error_rate", "output"))
    how = how_divided(options, recordings)
    if how is not None:
        with opts.opened(folder) as library:
            symbols = search.check_symbols(library.store, (symbol, *also))
        asked = {"reading": options, "error_rate": error_rate, "symbols": symbols}
        in_pieces("find", recordings, output, how, asked, folder, force=force, as_json=as_json)
        return
    check_new(output, force, *recordings)
    writer = None if output is None else writer_of(output, None, [])
    if writer is not None and not writer.several:
        raise click.UsageError(f"expected a table to write, .csv or .json, got {printable(output)}")
    with opts.opened(folder) as library:
        symbols = search.check_symbols(library.store, (symbol, *also))
        with progress(desc="searching", unit=" s of recordings", bar_format="{l_bar}{n:.0f}{unit} [{elapsed}]") as bar:
            occurrences = search.find(
                library.store,
                files_of(recordings, options, library),
                symbols,
                error_rate,
                lambda seconds: bar.update(seconds - bar.n),
            )
    sure = [certainty(hit.confidence, is_new=False, is_guess=not occurrences.calibrated) for hit in occurrences.hits]
    if writer is not None and output is not None:
        writer.write(output, occurrences.hits, None)
    data = {
        "hits": [as_row(hit) | {"certainty": words} for hit, words in zip(occurrences.hits, sure, strict=True)],
        "recordings": occurrences.recordings,
        "seconds": occurrences.seconds,
        "calibrated": occurrences.calibrated,
        "written": [] if output is None else [str(output)],
        "problems": [str(problem) for problem in occurrences.problems],
    }
    say(as_json, data, lambda: _text(data, problem_lines(occurrences.problems, "not searched: ")))
    if not occurrences.recordings:
        click.get_current_context().exit(1)


def _text(data: dict[str, Any], problems: list[str]) -> str:
    hits = data["hits"]
    lines = [f"{counted(len(hits), 'hit')} in {counted(data['recordings'], 'recording')} of {data['seconds']:,.1f} s"]
    if hits:
        cells = [(*stretch_cells(hit), printable(hit["symbol"]), hit["certainty"]) for hit in hits[:_SHOWN]]
        lines.append(table(("recording", "start [s]", "end [s]", "symbol", "how sure"), cells))
    lines += [*unlisted({"hits": hits}, _SHOWN), *problems[:_SHOWN], *unlisted({"problems": problems}, _SHOWN)]
    return "\n".join([*lines, *(f"written to {printable(path)}" for path in data["written"])])
