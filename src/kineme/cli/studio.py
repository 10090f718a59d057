"""``kineme studio``: an action library in the browser."""

from __future__ import annotations

import os
import sys
import webbrowser
from pathlib import Path
from typing import Any

import click

from kineme.cli.options import FILE, force_option, json_option, library_option, library_option_of, opened, whole
from kineme.cli.output import check_new, say, write
from kineme.reporting.text import printable

_PORTS = click.IntRange(1, 65535)


@click.command(short_help="Show, name and move it in the browser.")
@library_option_of(required=False, words="Folder of the action library; made if there is none.  [default: actions]")
@click.option("--recordings", type=click.Path(path_type=Path),
              help="Data set of LeRobot, folder or file whose episodes are shown, named and corrected.")  # fmt: skip
@click.option("--port", type=_PORTS, help="Port to serve at.  [default: 8420, or any that is free]")
@click.option("--no-open", is_flag=True, help="Print the address, and open no browser.")
@click.option("--read-only", is_flag=True, help="Show the library, and refuse every change.")
@click.option("--host", default="127.0.0.1", show_default=True,
              help="Address to listen at. Another one lets others on the network in who know the token.")  # fmt: skip
def studio(folder: Any, recordings: Path | None, port: int | None, no_open: bool, read_only: bool, host: str) -> None:
    """Draw movements and be told what they are, name them, move them, in the browser.

    Only this machine reaches the studio, and only who knows the token in the address, which is new each time (or taken
    from KINEME_STUDIO_TOKEN). Connections are not encrypted: use --host in networks that you trust alone. Any number of
    browsers and commands may work on one library at once. Stopped at any time, it loses nothing.

    As in:

    \b
    kineme studio
    kineme studio --library actions/ --recordings lerobot_dataset/
    """  # noqa: D301 - a backspace tells click to keep the lines
    from kineme.studio.server.serve import Options, is_loopback, serve

    folder = folder or Path("actions")

    def ready(address: str, once: str) -> None:
        only = ", for reading only" if read_only else ""
        # Both lines are written as one: it may be stopped at once.
        write(f"{printable(folder)} is open{only} at {address}\nstop it with Ctrl-C")
        sys.stdout.flush()
        if not is_loopback(host):
            write("others on the network reach it with this address, unencrypted: give it to those you trust", err=True)
        # Only a browser with windows is opened: one of the terminal would take the terminal.
        if not no_open and (
            sys.platform in {"darwin", "win32"}
            or any(os.environ.get(variable) for variable in ("DISPLAY", "WAYLAND_DISPLAY"))
        ):
            webbrowser.open(once)  # without the token, which others on this machine would see

    serve(Options(folder, host, port, read_only, recordings), ready)


@click.command(short_help="A library as one HTML page: draw, recognize, drag.")
@library_option
@click.option("--output", "-o", type=FILE, required=True, help="An .html file.")
@click.option("--title", help="Of the page.  [default: the name of the library's folder]")
@click.option("--most", type=whole(1), help="Movements in the page.  [default: as many as fit into 2 MB]")
@json_option
@force_option
def page(folder: Any, output: Path, title: str | None, most: int | None, as_json: bool, force: bool) -> None:
    """Write one HTML file in which a library recognizes drawings and moves again, without server and network.

    The file holds the movements of the library: whoever has it can read them. Of large libraries some movements of each
    symbol are taken, evenly spaced, and the page answers as a library of these does.
    """
    from kineme.studio.page.write_page import summary_of, write_page

    check_new(output, force)
    with opened(folder) as library:
        result = write_page(output, library, title, most, replace=force)
    header, size = result.header, output.stat().st_size
    counts = {"symbols": len(header["classes"]), "movements": header["n_movements"], "of": header["n_all"]}
    text = (
        f"{printable(output)}: {summary_of(result)}, {size / 1e6:.2f} MB; "
        "open it in a browser, it needs no server and no network"
    )
    say(as_json, {"file": str(output), "bytes": size, **counts}, lambda: text)
