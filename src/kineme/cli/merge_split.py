"""``kineme library`` merge, split and review."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from kineme.cli.library import brief, opened
from kineme.cli.options import ID, SymbolName, json_option, library_option
from kineme.cli.output import say
from kineme.reporting.text import counted, printable


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
        "merges": [one._asdict() for one in suggested.merges],
        "splits": [{**one._asdict(), "parts": [part.tolist() for part in one.parts]} for one in suggested.splits],
    }

    def text() -> str:
        lines = [
            f"{printable(one.first)} and {printable(one.second)} could be one: they overlap by {one.overlap:.2f}"
            for one in suggested.merges
        ]
        lines += [
            f"{printable(one.symbol)} could be two: {len(one.parts[0])} movements, and "
            + ", ".join(map(str, one.parts[1].tolist()))
            for one in suggested.splits
        ]
        return "\n".join(lines) or "the symbols are well apart, and none falls into two clusters"

    say(as_json, data, text)


#: For the group ``kineme library``.
COMMANDS = (merge, split, review)
