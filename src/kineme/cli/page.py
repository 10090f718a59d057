"""``kineme page``: a library as one HTML file."""

from __future__ import annotations

from pathlib import Path

import click

from kineme.cli.library import opened
from kineme.cli.options import force_option, json_option, library_option, whole
from kineme.cli.output import check_new, say
from kineme.reporting.text import printable


@click.command(short_help="A library as one HTML page: draw, recognize, drag.")
@library_option
@click.option("--output", "-o", type=click.Path(path_type=Path, dir_okay=False), required=True, help="An .html file.")
@click.option("--title", help="Of the page.  [default: the name of the library's folder]")
@click.option("--most", type=whole(1), help="Movements in the page.  [default: as many as fit into 2 MB]")
@json_option
@force_option
def page(folder: Path, output: Path, title: str | None, most: int | None, as_json: bool, force: bool) -> None:
    """Write one HTML file in which a library recognizes drawings and moves again, without server and network.

    The file holds the movements of the library: whoever has it can read them. Of large libraries some movements of each
    symbol are taken, evenly spaced, and the page answers as a library of these does.
    """
    from kineme.studio.page.write_page import summary_of, write_page

    check_new(output, force)
    with opened(folder) as library:
        made = write_page(output, library, title, most, replace=force)
    header, size = made.header, output.stat().st_size
    counts = {"symbols": len(header["classes"]), "movements": header["n_movements"], "of": header["n_all"]}
    text = (
        f"{printable(output)}: {summary_of(made)}, {size / 1e6:.2f} MB; "
        "open it in a browser, it needs no server and no network"
    )
    say(as_json, {"file": str(output), "bytes": size, **counts}, lambda: text)
