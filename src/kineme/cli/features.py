"""``kineme features``: the movements of an archive as a library compares them, in shards that are searched."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from kineme.cli.options import FOLDER, GroupedCommand, force_option, heading, json_option, library_option
from kineme.cli.pieces import how_divided, in_pieces, pieces_options
from kineme.cli.reading import layout_options, recordings_argument


@click.command(cls=GroupedCommand, short_help="Describe the movements of an archive, for kineme serve.")
@recordings_argument
@library_option
@layout_options
@heading("Output")
@click.option("--output", "-o", type=FOLDER, required=True, help="Folder of the shards.")
@json_option
@force_option
@pieces_options
def features(recordings: tuple[Any, ...], folder: Any, output: Path, **options: Any) -> None:
    """Describe the movements of RECORDINGS, an archive, as the library compares them, in shards.

    Shards are files that kineme serve, and kineme.pieces.open_shards in Python, map into memory: they answer which
    movements of the archive are nearest to a new one. What is common to all shards is fitted to the library once, and
    lies in bases.npz beside them. Called again, what is done is not done again.

    Example: kineme features archive/ --library actions/ -o shards/ --workers 8
    """
    as_json, force = options.pop("as_json"), options.pop("force")
    how = how_divided(options, recordings, always=True)
    assert how is not None  # always
    in_pieces("features", recordings, output, how, {"reading": options}, folder, force=force, as_json=as_json)
