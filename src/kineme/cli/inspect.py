"""``kineme inspect``: summarize a set of recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from kineme.cli.options import json_option
from kineme.cli.output import say
from kineme.cli.reading import layout_options, read, recordings_argument


@click.command(short_help="Summarize a set of recordings.")
@recordings_argument
@layout_options
@click.option("--plot", type=click.Path(dir_okay=False, path_type=Path), help="Draw them: a .png, .svg or .pdf file.")
@json_option
def inspect(recordings: tuple[Path, ...], plot: Path | None, as_json: bool, **options: Any) -> None:
    """Inspect RECORDINGS: files, folders, patterns of them, or - for CSV from the standard input.

    Shows, per label: how many movements, how long, sampled how fast and how evenly, with which gaps. Below: how the
    files were understood, movements that occur twice, and what could not be read and why. In a folder, the name of
    the innermost folder is the label. Topics and frames of ROS bags are listed first.

    Example: kineme inspect recordings/ --plot recordings.png
    """
    from kineme.errors import DataError
    from kineme.files.entries import in_words
    from kineme.files.inspection.contents import contents_as_data, contents_as_words, contents_of_all
    from kineme.files.inspection.inspect import inspect as summarize
    from kineme.files.inspection.inspect import nothing_read
    from kineme.files.inspection.report import as_data, as_words

    files = [one for one in recordings if str(one) != "-"]
    contents = contents_of_all(files, options["follow_links"])
    try:
        recorded = read(recordings, options)
    except DataError as error:
        if not contents or plot is not None:
            raise
        summary = nothing_read(in_words(recordings), str(error))
        text = f"not read: {error}"
    else:
        if plot is not None:
            _draw(recorded, plot)
        summary = summarize(recorded)
        text = as_words(summary)
    data = as_data(summary) | ({"contents": contents_as_data(contents)} if contents else {})
    say(as_json, data, lambda: "\n\n".join([*contents_as_words(contents), text]))


def _draw(recorded: Any, path: Path) -> None:
    from kineme.files.inspection.figure import draw_recordings
    from kineme.output.figures import save_figure

    save_figure(draw_recordings(recorded), path)
