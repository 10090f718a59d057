"""``kineme library`` merge, split, review, ground, schema, nearest, between and map."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path
from typing import Any

import click

from kineme.cli.library import brief, opened
from kineme.cli.options import ID, SymbolName, json_option, library_option, whole
from kineme.cli.output import say, to_json
from kineme.reporting.text import counted, printable


@click.command(short_help="Write a symbol for a planner, as JSON.")
@click.argument("symbol", type=SymbolName())
@library_option
@click.option("--by", type=click.Choice(["medoid", "mean"]), default="medoid", show_default=True,
              help="Prototype: the most typical movement, or the mean.")  # fmt: skip
@click.option("--units", help="Units of the positions, as mm; one, or one per dimension separated by commas.")
@click.option("--output", "-o", type=click.Path(dir_okay=False, allow_dash=True, path_type=Path), default="-",
              show_default=True, help="A .json file; - for the screen.")  # fmt: skip
def ground(symbol: str, folder: Path, by: str, units: str | None, output: Path) -> None:
    """Write a symbol for a planner: primitive, parameters and their demonstrated ranges, as JSON.

    kineme library schema prints the JSON Schema of this output.
    """
    with opened(folder) as actions:
        grounding = actions.ground(symbol, by, units.split(",") if units and "," in units else units)
    _write(grounding, output)


@click.command()
def schema() -> None:
    """Print the JSON Schema of the output of ground."""
    text = files("kineme").joinpath("anchoring/grounding.schema.json").read_text(encoding="utf-8")
    say(True, json.loads(text), str)  # kineme.anchoring.grounding_schema() would load all of anchoring


@click.command()
@click.argument("symbol", type=SymbolName())
@click.option("-k", type=whole(1), default=3, show_default=True, help="Number of symbols to list.")
@library_option
@json_option
def nearest(symbol: str, k: int, folder: Path, as_json: bool) -> None:
    """List the symbols most similar to one."""
    with opened(folder) as actions:
        data = [neighbor._asdict() for neighbor in actions.nearest(symbol, k)]
    say(
        as_json,
        data,
        lambda: "\n".join(f"{neighbor['distance']:.3f}  {printable(neighbor['symbol'])}" for neighbor in data),
    )


@click.command(short_help="List the symbols that lie between two.")
@click.argument("first", type=SymbolName())
@click.argument("second", type=SymbolName())
@library_option
@json_option
def between(first: str, second: str, folder: Path, as_json: bool) -> None:
    """List the symbols that lie between two, the smallest detour first."""
    with opened(folder) as actions:
        data = [middle._asdict() for middle in actions.between(first, second)]
    say(
        as_json,
        data,
        lambda: "\n".join(map(_lies, data)) or f"no symbol lies between {printable(first)} and {printable(second)}",
    )


@click.command("map", short_help="Draw a map of the symbols, similar ones near each other.")
@click.argument("path", type=click.Path(dir_okay=False, path_type=Path))
@library_option
@json_option
def draw(path: Path, folder: Path, as_json: bool) -> None:
    """Draw a map of the symbols, similar ones near each other: a .png, .svg or .pdf file."""
    from kineme.anchoring.figures import draw_map
    from kineme.library.grounding import prototype_of, space_of
    from kineme.reporting.figures import save_figure

    with opened(folder) as actions:
        space = space_of(actions.store)
        typical = [prototype_of(actions.store, actions[name]) for name in space.symbols]
        save_figure(draw_map(space, actions.movements(ids=typical)), path)
        data = {"path": str(path), "symbols": list(space.symbols), "distances": space.distances.tolist()}
    say(as_json, data, lambda: f"wrote {printable(path)}: {counted(len(data['symbols']), 'symbol')}")


def _lies(row: dict[str, Any]) -> str:
    return f"{row['share']:.0%} of the way, detour {row['excess']:.0%}  {printable(row['symbol'])}"


def _write(data: dict[str, Any], output: Path) -> None:
    from kineme.reporting.atomic import write_atomically

    if str(output) == "-":
        say(True, data, str)
    else:
        write_atomically(output, (to_json(data) + "\n").encode())


@click.command()
@click.argument("symbols", type=SymbolName(), nargs=-1, required=True)
@click.option("--into", required=True, help="Name of the merged symbol.")
@library_option
@json_option
def merge(symbols: tuple[str, ...], into: str, folder: Path, as_json: bool) -> None:
    """Merge several symbols into one."""
    from kineme.library.storage import changes

    with opened(folder, read_only=False) as actions:
        version = changes.merge(actions.store, symbols, into)
        data = {**brief(actions[into]), "version": version}
    say(as_json, data, lambda: _text(data))


@click.command()
@click.argument("symbol", type=SymbolName())
@click.option(
    "--movement", "movements", type=ID, multiple=True, required=True, help="Movement to take over; may be repeated."
)
@click.option("--into", required=True, help="Name of the new symbol.")
@library_option
@json_option
def split(symbol: str, movements: tuple[int, ...], into: str, folder: Path, as_json: bool) -> None:
    """Split a symbol: some of its movements become a new symbol."""
    from kineme.library.storage import changes

    with opened(folder, read_only=False) as actions:
        version = changes.split(actions.store, symbol, list(movements), into)
        data = {**brief(actions[into]), "version": version}
    say(as_json, data, lambda: _text(data))


def _text(data: dict[str, Any]) -> str:
    holds = f"{printable(data['name'])} ({data['id']}): {counted(data['movements'], 'movement')}"
    return f"{holds}; version {data['version']}"


@click.command()
@library_option
@json_option
def review(folder: Path, as_json: bool) -> None:
    """Find symbols that could be merged, and symbols that could be split."""
    with opened(folder) as actions:
        suggested = actions.review()
    data = {
        "merges": [suggestion._asdict() for suggestion in suggested.merges],
        "splits": [
            {**suggestion._asdict(), "parts": [part.tolist() for part in suggestion.parts]}
            for suggestion in suggested.splits
        ],
    }

    def text() -> str:
        lines = [
            f"{printable(merge.first)} and {printable(merge.second)} could be one: they overlap by {merge.overlap:.2f}"
            for merge in suggested.merges
        ]
        lines += [
            f"{printable(suggestion.symbol)} could be two: {len(suggestion.parts[0])} movements, and "
            + ", ".join(map(str, suggestion.parts[1].tolist()))
            for suggestion in suggested.splits
        ]
        return "\n".join(lines) or "the symbols are well apart, and none falls into two clusters"

    say(as_json, data, text)


#: For the group ``kineme library``.
COMMANDS = (merge, split, review, ground, schema, nearest, between, draw)
