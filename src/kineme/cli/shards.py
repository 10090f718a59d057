"""``kineme features`` and ``kineme serve``: movements of an archive in shards, and the nearest of them over HTTP."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from kineme.cli.options import FOLDER, GroupedCommand, force_option, heading, json_option, library_option, whole
from kineme.cli.output import progress, write
from kineme.cli.pieces import PIECES_OPTIONS, in_pieces, pieces_options
from kineme.cli.reading import layout_options, recordings_argument
from kineme.io.records import needs
from kineme.reporting.text import printable


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
    how = {name: options.pop(name) for name in PIECES_OPTIONS}
    in_pieces("features", recordings, output, how, {"reading": options}, folder, force=force, as_json=as_json)


@click.command(short_help="Nearest among ten million movements, over HTTP.")
@library_option
@click.option("--shards", type=FOLDER, required=True, help="Folder that kineme features has written.")
@click.option("--port", type=click.IntRange(1, 65535), default=8765, show_default=True, help="Port to serve at.")
@click.option("--host", default="127.0.0.1", show_default=True,
              help="Address to listen at. Another one needs a token in KINEME_STUDIO_TOKEN.")  # fmt: skip
@click.option(
    "--processes", type=whole(1, 1000), help="That search, each some of the shards.  [default: one a processor]"
)
def serve(folder: Path, shards: Path, port: int, host: str, processes: int | None) -> None:
    """Answer which movements of an archive are nearest to a movement, exactly, for many clients.

    POST /nearest with {"times": [...], "positions": [[...], ...], "n": 10}, or with several as "movements", and the
    header Authorization: Bearer TOKEN; the token is printed, or taken from KINEME_STUDIO_TOKEN. GET /health says what
    is searched. Only this machine reaches it, unless --host says otherwise; connections are not encrypted. A process
    that dies is started again.

    Example: kineme serve --library actions/ --shards out/
    """
    with needs("fastapi and uvicorn", "serve", "studio"):
        from kineme.studio.server.nearest import SearchOptions, serve_search

    with progress(total=0, desc="indexing", unit=" movements", unit_scale=True) as bar:

        def indexed(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        def ready(address: str, token: str, count: int) -> None:
            bar.close()
            write(
                f"{count:,} movements of {printable(shards)} at {address}nearest\ntoken: {token}\nstop it with Ctrl-C"
            )

        serve_search(SearchOptions(folder, shards, host, port, processes, indexed), ready)
