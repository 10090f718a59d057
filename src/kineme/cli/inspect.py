"""``kineme inspect``: summarize a set of recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from kineme.cli.options import FOLDER, GroupedCommand, error_rate_option, force_option, json_option, plot_option
from kineme.cli.output import progress, say
from kineme.cli.pieces import how_divided, in_pieces, pieces_options
from kineme.cli.reading import layout_options, read, recordings_argument
from kineme.errors import DataError, KinemeError


@click.command(cls=GroupedCommand, explains_reading=True, short_help="Summarize a set of recordings.")
@recordings_argument
@layout_options
@click.option(
    "--outliers/--no-outliers", default=True, show_default=True, help="Look for movements unlike others of their label."
)
@error_rate_option("Share of false alarms among the outliers.")
@plot_option
@json_option
@click.option("--output", "-o", type=FOLDER, help="Of a large archive, the folder of the parts.")
@force_option
@pieces_options
def inspect(
    recordings: tuple[Path, ...], plot: Path | None, outliers: bool, error_rate: float, as_json: bool, **options: Any
) -> None:
    """Inspect RECORDINGS: files, folders, patterns of them, or - for CSV from the standard input.

    Shows, per label: how many movements, how long, sampled how fast and how evenly, with which gaps. Below: how the
    files were understood, movements that occur twice, and what could not be read and why. In a folder, the name of
    the innermost folder is the label. Topics and frames of ROS bags are listed first. Outliers, movements unlike the
    others of their label, are listed last, if there are at least 20 movements, 5 of a label.

    The exit status is 0 if movements were read, whatever else was not, 1 if none were, and 2 for options that are none.

    Example: kineme inspect recordings/ --plot recordings.png
    """
    from kineme.io.inspection import inspect as summaries
    from kineme.io.reading.formats import in_words

    how, output, force = how_divided(options, recordings), options.pop("output"), options.pop("force")
    if how is not None:
        in_pieces("inspect", recordings, output, how, {"reading": options}, force=force, as_json=as_json)
        return
    if output is not None:
        raise click.UsageError("expected --output with --workers, --scheduler or --shard; for a picture say --plot")
    files = [recording for recording in recordings if str(recording) != "-"]
    contents = summaries.contents_of_all(files, options["follow_links"])
    unlike: tuple[int, ...] = ()
    recorded: Any = None
    inspections: dict[str, Any] = {}
    try:
        recorded = read(recordings, options)
    except DataError as error:
        if not contents or plot is not None:
            raise
        summary = summaries.nothing_read(in_words(recordings), str(error))
        texts = [f"not read: {error}"]
    else:
        summary = summaries.inspect(recorded)
        texts = [summaries.as_words(summary)]
        if outliers:
            unlike, inspections, words = _outliers(recorded, error_rate)
            texts += [words] if words else []
        if plot is not None:
            from kineme.io.inspection.figure import draw_recordings
            from kineme.reporting.figures import save_figure

            save_figure(draw_recordings(recorded, unlike), plot)
    data = summaries.as_data(summary) | inspections
    data |= {"contents": summaries.contents_as_data(contents)} if contents else {}
    say(as_json, data, lambda: "\n\n".join([*summaries.contents_as_words(contents), *texts]))
    if recorded is None:
        click.get_current_context().exit(1)


def _outliers(recorded: Any, error_rate: float) -> tuple[tuple[int, ...], dict[str, Any], str]:
    """Indices of the outliers; what is said of them as data, and in words."""
    from kineme.recognition.outliers import find_outliers, outliers_as_data, outliers_as_words

    names = recorded.short_names
    try:
        with progress(total=len(names), desc="comparing", unit="movement") as bar:
            outliers = find_outliers(recorded, recorded.labels, error_rate, lambda done: bar.update(done - bar.n))
    except KinemeError as error:
        return (), {}, f"outliers were not looked for: {error}"
    return (
        tuple(outlier.index for outlier in outliers.outliers),
        {"outliers": outliers_as_data(outliers, names)},
        outliers_as_words(outliers, names),
    )
