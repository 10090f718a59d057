"""``kineme segment``: cut recordings into movements, a file for each."""

from __future__ import annotations

from itertools import count
from pathlib import Path
from typing import Any

import click

from kineme.cli import options as opts
from kineme.cli.output import check_new, say, table
from kineme.cli.reading import layout_options, read, recordings_argument
from kineme.reporting.text import counted, printable

#: Parameters of the methods: type, help.
_PARAMETERS: dict[str, tuple[Any, str]] = {
    "min_rest": (opts.Finite(0), "rest: a shorter one is a pause within a movement, in seconds."),
    "min_movement": (opts.Finite(0), "rest, speed: a shorter one is a twitch, in seconds."),
    "speed": (opts.Finite(0), "rest: share of the peak speed below which the recording rests."),
    "depth": (opts.Finite(0), "speed: a minimum counts below this share of the peaks beside it."),
    "turn": (opts.Finite(0), "speed: also cut at turns sharper than this angle, in radians."),
    "penalty": (opts.Finite(0), "change-points: cost of one more piece."),
    "n_pieces": (opts.whole(1), "change-points: number of pieces."),
}


_parameters = opts.under(
    "Options",
    *(
        click.option(opts.flag_of(name), type=kind, help=f"Of --by {words}")
        for name, (kind, words) in _PARAMETERS.items()
    ),
)


@click.command(cls=opts.GroupedCommand, short_help="Cut long recordings into movements.")
@recordings_argument
@click.option("--by", type=click.Choice(["rest", "speed", "change-points"]), default="rest", show_default=True,
              help="Cut at rests, at minima of speed, or at change points of the velocity.")  # fmt: skip
@_parameters
@opts.heading("Output")
@click.option(
    "--output", "-o", type=click.Path(file_okay=False, path_type=Path),
    help="Folder for the pieces, a file for each; it is created.  [default: show the table alone]",
)  # fmt: skip
@click.option("--format", "form", type=click.Choice(["csv", "npz", "json"]), default="csv", show_default=True,
              help="Format of the pieces.")  # fmt: skip
@opts.plot_option
@layout_options
@opts.json_option
@opts.force_option
def segment(
    recordings: tuple[Path, ...], output: Path | None, by: str, form: str, plot: Path | None, **options: Any
) -> None:
    """Cut RECORDINGS, files, folders or patterns of them, or - for CSV from the standard input, into movements.

    Each piece becomes a file with the columns and the time stamps of its recording, named like long-003.csv. Rests
    belong to none. Without --output the pieces are only listed. With --force, pieces of an earlier cut with higher
    numbers are removed.

    Example: kineme segment long.csv -o pieces/ --plot pieces.png
    """
    from kineme.errors import DataError
    from kineme.io.reading.recordings import paths_of
    from kineme.io.writing.write_movement import write_movement

    as_json, force = options.pop("as_json"), options.pop("force")
    chosen = {name: value for name in _PARAMETERS if (value := options.pop(name)) is not None}
    _check_parameters(by, chosen)
    parsed = read(recordings, options)
    problems = list(map(str, parsed.problems))
    cut, movements = _cut(parsed, by, chosen, problems)
    files = _files(cut, movements, output, form)
    inputs = paths_of(recordings, parsed)
    for path in (plot, *files):
        check_new(path, force, *inputs)
    if output is not None:
        output.mkdir(parents=True, exist_ok=True)
        for path, piece in zip(files, (piece for segmentation in cut for piece in segmentation), strict=True):
            write_movement(path, piece)
        for path in _stale(files, inputs) if force else ():
            path.unlink()
    if plot is not None:
        if not cut:
            raise DataError("expected recordings that can be cut, to draw them, got none")
        from kineme.movements.segmentation.figure import draw_segmentations
        from kineme.reporting.figures import save_figure

        save_figure(draw_segmentations(cut), plot)
    pieces = _as_data(cut, movements, files)
    say(as_json, {"pieces": pieces, "problems": problems}, lambda: _text(pieces, problems, output))


def _check_parameters(by: str, chosen: dict[str, Any]) -> None:
    from dataclasses import fields

    from kineme.movements.segmentation.table import SEGMENTERS

    parameters = [field.name for field in fields(SEGMENTERS[by])]
    for name in chosen:
        if name not in parameters:
            flags = ", ".join(map(opts.flag_of, filter(_PARAMETERS.get, parameters)))
            raise click.UsageError(f"expected parameters of --by {by}: {flags}; got {opts.flag_of(name)}")


def _cut(parsed: Any, by: str, chosen: dict[str, Any], problems: list[str]) -> tuple[list[Any], list[Any]]:
    """The recordings that could be cut, and which they are; the others become problems."""
    from kineme.errors import TrajectoryError
    from kineme.movements.segmentation.segment import segment as cut_one

    cut, movements = [], []
    for demonstration, source in zip(parsed.demonstrations, parsed.sources, strict=True):
        try:
            cut.append(cut_one(demonstration, by, **chosen))
        except TrajectoryError as error:
            problems.append(f"{source.path} {source.place}".strip() + f": {error}")
        else:
            movements.append((source.path, source.place))
    return cut, movements


def _files(cut: list[Any], movements: list[Any], output: Path | None, form: str) -> list[Path]:
    """A file for each piece; none without a folder for them."""
    from kineme.io.writing.write_movement import distinct_stems

    if output is None:
        return []
    stems = distinct_stems(movements)
    return [
        output / f"{stem}-{k:03d}.{form}"
        for stem, segmentation in zip(stems, cut, strict=True)
        for k in range(1, len(segmentation) + 1)
    ]


def _stale(files: list[Path], inputs: list[Path]) -> list[Path]:
    """List what an earlier cut of the same recordings left: pieces that are numbered on behind these."""
    stale: list[Path] = []
    written = {*files}
    for path in files:
        stem, _, number = path.stem.rpartition("-")
        for k in count(int(number) + 1):
            later = path.with_name(f"{stem}-{k:03d}{path.suffix}")
            if later in written or not later.is_file() or any(later.samefile(each) for each in inputs if each.exists()):
                break
            stale.append(later)
    return stale


def _as_data(cut: list[Any], movements: list[Any], files: list[Path]) -> list[dict[str, Any]]:
    rows = [
        {"recording": path, "place": place, "piece": k, "start": start, "end": end, "duration": end - start}
        for segmentation, (path, place) in zip(cut, movements, strict=True)
        for k, (start, end) in enumerate(segmentation.cuts.tolist(), 1)
    ]
    return [row | {"file": str(file)} for row, file in zip(rows, files, strict=True)] if files else rows


def _text(pieces: list[dict[str, Any]], problems: list[str], output: Path | None) -> str:
    heads = ("recording", "piece", "start [s]", "end [s]", "duration [s]")
    rows = [
        (
            printable(f"{piece['recording']} {piece['place']}".strip()),
            str(piece["piece"]),
            *(f"{piece[name]:.3f}" for name in ("start", "end", "duration")),
        )
        for piece in pieces
    ]
    lines = [table(heads, rows)] if rows else []
    lines += [f"not cut: {printable(problem)}" for problem in problems]
    where = "" if output is None else f", written to {printable(output)}"
    return "\n".join([*lines, f"{counted(len(pieces), 'movement')}{where}"])
