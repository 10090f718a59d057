"""``kineme why``: a movement over its nearest example, where they differ, and the runner-up."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from kineme.cli.options import FILE, GroupedCommand, error_rate_option, force_option, json_option, library_option, whole
from kineme.cli.output import check_new, say
from kineme.cli.reading import layout_options, notes_beside, problem_lines, read, recordings_argument
from kineme.reporting.text import printable


@click.command(cls=GroupedCommand, short_help="Explain what a movement is recognized as.")
@recordings_argument
@library_option
@click.option("--index", type=whole(0), default=0, help="Number of the movement in a file with several, from 0.")
@error_rate_option("Share of true movements that may be called unknown.")
@layout_options
@click.option("--output", "-o", type=FILE, help="The picture: a .png, .svg or .pdf file.")
@json_option
@force_option
def why(
    recordings: tuple[Path, ...], folder: Path, index: int, error_rate: float, as_json: bool, **options: Any
) -> None:
    """Explain what a movement in RECORDINGS is recognized as.

    The picture shows the movement over the most similar example of the library, and over that of the runner-up: moved,
    turned and sized as the library allows, and colored by how far the movement is from them.

    Example: kineme why new.csv --library actions/ -o why.png
    """
    from kineme.library.library import ActionLibrary
    from kineme.reporting.figures import save_figure

    check_new(options["output"], options.pop("force"))
    output = options.pop("output")
    with ActionLibrary(folder, read_only=True) as library:
        parsed = read(recordings, options, library)
        movements = parsed.demonstrations
        if index >= len(movements):
            raise click.BadParameter(
                f"expected less than {len(movements)} movements, got {index}", param_hint="--index"
            )
        answer = library.recognize(movements[index : index + 1], error_rate)[0]
        explained = answer.explain()
        notes = notes_beside(parsed, options, library.channels)
    if output is not None:
        save_figure(explained.plot(), output)
    name = parsed.sources[index].name
    data = {"recording": name, "explanation": explained.to_dict(), "notes": notes}
    lines = [f"{name}: {explained.in_words}", *notes]
    say(as_json, data, lambda: "\n".join([*map(printable, lines), *problem_lines(parsed.problems)]))
