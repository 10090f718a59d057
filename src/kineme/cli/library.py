"""``kineme library``: show and edit an action library."""

from __future__ import annotations

import json
from collections import Counter
from importlib.resources import files
from pathlib import Path
from typing import Any

import click

from kineme.cli.options import ID, SymbolName, json_option, library_option, whole
from kineme.cli.output import confirm, in_words, say, table, to_json
from kineme.reporting.text import counted, printable


@click.group()
def library() -> None:
    """Show and edit an action library."""


def opened(folder: Path, *, read_only: bool = True) -> Any:
    """Open the library in a folder."""
    from kineme.library.library import ActionLibrary

    return ActionLibrary(folder, read_only=read_only)


@library.command("list")
@library_option
@click.option("--at", "version", type=ID, help="Show this version of the library.")
@json_option
def list_symbols(folder: Path, version: int | None, as_json: bool) -> None:
    """List the symbols of a library."""
    with opened(folder) as actions:
        shown = actions if version is None else actions.at(version)
        symbols, unlabeled = shown.symbols(), len(shown.unlabeled())
        people = Counter(person for person in shown.groups().tolist() if person is not None)
        data = {
            "movements": len(shown),
            "unlabeled": unlabeled,
            "dimensions": shown.n_dims,
            "people": dict(sorted(people.items())),
            "version": shown.version,
            "symbols": [brief(symbol) for symbol in symbols],
        }

    def text() -> str:
        rows = [(printable(s.name), f"{len(s)}", s.id, printable(s.description)) for s in symbols]
        by = f", {sum(people.values()):,} by {counted(len(people), 'person', 'people')}" if people else ""
        title = (
            f"{counted(data['movements'], 'movement')}, {counted(len(symbols), 'symbol')}, "
            f"{unlabeled} without a symbol{by}; version {data['version']}"
        )
        return table(("symbol", "movements", "id", "description"), rows, title) if rows else title

    say(as_json, data, text)


@library.command(short_help="Show one symbol and its movements.")
@click.argument("symbol", type=SymbolName())
@library_option
@json_option
def show(symbol: str, folder: Path, as_json: bool) -> None:
    """Show one symbol: its movements, where they come from, and how they vary."""
    from kineme.library.storage.symbols import symbol_report

    with opened(folder) as actions:
        data = symbol_report(actions.store, symbol)
    say(as_json, data, lambda: _report_text(data))


@library.command()
@click.argument("symbol", type=SymbolName())
@click.argument("name")
@library_option
@json_option
def rename(symbol: str, name: str, folder: Path, as_json: bool) -> None:
    """Give a symbol another NAME; its id stays."""
    from kineme.library.storage import changes

    with opened(folder, read_only=False) as actions:
        key = actions[symbol].id  # a name may be another symbol's when the change is made
        version = changes.rename(actions.store, key, name)
        data = {**brief(actions[key]), "was": symbol, "version": version}
    say(as_json, data, lambda: f"{printable(symbol)} is now {printable(name)} ({data['id']})")


@library.command()
@click.argument("symbol", type=SymbolName())
@click.argument("text")
@library_option
@json_option
def annotate(symbol: str, text: str, folder: Path, as_json: bool) -> None:
    """Set the description of a symbol."""
    from kineme.library.storage import changes

    with opened(folder, read_only=False) as actions:
        key = actions[symbol].id
        version = changes.annotate(actions.store, key, description=text)
        data = {**brief(actions[key]), "version": version}
    say(as_json, data, lambda: f"{printable(data['name'])}: {printable(text)}")


@library.command(short_help="Delete a symbol or movements; earlier versions keep them.")
@click.argument("symbol", type=SymbolName(), required=False)
@click.option("--movement", "movements", type=ID, multiple=True, help="Delete this movement; may be repeated.")
@click.option("--yes", "-y", is_flag=True, help="Do not ask.")
@library_option
@json_option
def delete(symbol: str | None, movements: tuple[int, ...], yes: bool, folder: Path, as_json: bool) -> None:
    """Delete a symbol, whose movements stay as unlabeled ones, or single movements.

    Earlier versions still contain them, see kineme library history.
    """
    from kineme.library.storage import changes

    if (symbol is None) == (not movements):
        raise click.UsageError("expected a SYMBOL, or --movement ID, and not both")
    what = printable(symbol) if symbol is not None else counted(len(movements), "movement")
    if not yes:
        confirm(f"Delete {what} from {printable(folder)}?", abort=True, err=True)
    with opened(folder, read_only=False) as actions:
        store = actions.store
        version = (
            changes.delete_movements(store, list(movements)) if symbol is None else changes.delete_symbol(store, symbol)
        )
        data = {"deleted": symbol if symbol is not None else list(movements), "version": version}
    say(as_json, data, lambda: f"deleted {what}; version {data['version']}")


@library.command()
@library_option
@click.option(
    "--limit", "-n", type=whole(1), default=20, show_default=True, help="Number of versions to list, the latest ones."
)
@json_option
def history(folder: Path, limit: int, as_json: bool) -> None:
    """List the versions: what changed, and when."""
    with opened(folder) as actions:
        versions = actions.history()
    data = [
        {"version": version.id, "at": version.at, "action": version.action, **version.detail}
        for version in versions[-limit:]
    ]

    def text() -> str:
        rows = [
            (str(version.id), version.at[:19].replace("T", " "), version.action, printable(in_words(version.detail)))
            for version in versions[-limit:]
        ]
        return table(("version", "at (UTC)", "action", "what"), rows, counted(len(versions), "version"))

    say(as_json, data, text)


@library.command(short_help="Take back the last change, or restore a version.")
@library_option
@click.option("--at", "expected", type=ID, help="Only if this is still the last version, as history lists it.")
@click.option("--to", type=ID, help="Restore this earlier version, as history lists it; 0 is the empty library.")
@json_option
def undo(folder: Path, expected: int | None, to: int | None, as_json: bool) -> None:
    """Take back the last change, whoever made it, as a new version; again, the one before.

    All that one call of kineme learn stored is one change. kineme library history lists the changes. With --to, the
    library is as it was at that version: versions between stay in the history, and undo takes the restoring back. What
    was undone is done again by restoring the version that was taken back.
    """
    with opened(folder, read_only=False) as actions:
        undone = actions.undo(expected, to)
        data = {"undone": undone.action, "to": undone.to, "version": undone.version}
    done = f"took back {data['undone']}; as at" if to is None else "restored"
    say(as_json, data, lambda: f"{done} version {data['to']}; version {data['version']}")


@library.command(short_help="Check every byte of a library.")
@library_option
@json_option
@click.pass_context
def verify(ctx: click.Context, folder: Path, as_json: bool) -> None:
    """Check every byte of a library; the exit status is 1 if something is wrong."""
    with opened(folder) as actions:
        problems = [str(problem) for problem in actions.verify()]
        n = len(actions)
    data = {"ok": not problems, "movements": n, "problems": problems}
    say(
        as_json,
        data,
        lambda: "\n".join(map(printable, problems)) if problems else f"{counted(n, 'movement')}, nothing wrong",
    )
    ctx.exit(1 if problems else 0)


@library.command()
@click.argument("path", type=click.Path(dir_okay=False, path_type=Path))
@library_option
@json_option
def export(path: Path, folder: Path, as_json: bool) -> None:
    """Write a whole library to one file, as a backup or for others."""
    with opened(folder) as actions:
        actions.export(path)
        data: dict[str, Any] = {"path": str(path), "movements": len(actions), "bytes": path.stat().st_size}
    say(as_json, data, lambda: f"wrote {printable(path)}: {counted(data['movements'], 'movement')}")


@library.command("import")
@click.argument("path", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@library_option
@json_option
def import_(path: Path, folder: Path, as_json: bool) -> None:
    """Create a library from an exported file."""
    from kineme.library.library import ActionLibrary

    with ActionLibrary.import_(path, folder) as actions:
        data: dict[str, Any] = {"library": str(folder), "movements": len(actions), "symbols": len(actions.symbols())}
    say(as_json, data, lambda: f"{printable(folder)}: {counted(data['movements'], 'movement')}")


def brief(symbol: Any) -> dict[str, Any]:
    """A symbol as plain data."""
    return {
        "name": symbol.name,
        "id": symbol.id,
        "description": symbol.description,
        "movements": len(symbol),
        "prototype": symbol.prototype,
        "parents": list(symbol.parents),
    }


def _report_text(data: dict[str, Any]) -> str:
    with_people = any(member["person"] for member in data["members"])
    rows = [
        (str(member["id"]), printable(member["name"] or ""), printable(member["source"] or ""),
         *((printable(member["person"] or ""),) if with_people else ()), f"{member['duration']:.3g}",
         _point(member["start"], member), _point(member["goal"], member))
        for member in data["members"]
    ]  # fmt: skip
    head = f"{printable(data['name'])}  {data['id']}"
    if data["description"]:
        head += f"\n{printable(data['description'])}"
    person = ("person",) if with_people else ()
    return table(("movement", "name", "file", *person, "duration [s]", "start", "goal"), rows, head)


def _point(point: list[float], member: dict[str, Any]) -> str:
    """A point as text; values within single precision of zero are zero."""
    least = 1e-6 * max(map(abs, [*member["start"], *member["goal"]]))
    return ", ".join(f"{x if abs(x) > least else 0:.4g}" for x in point)


@library.command(short_help="Write a symbol for a planner, as JSON.")
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


@library.command()
def schema() -> None:
    """Print the JSON Schema of the output of ground."""
    text = files("kineme").joinpath("anchoring/grounding.schema.json").read_text(encoding="utf-8")
    say(True, json.loads(text), str)  # kineme.anchoring.grounding_schema() would load all of anchoring


@library.command()
@click.argument("symbol", type=SymbolName())
@click.option("-k", type=whole(1), default=3, show_default=True, help="Number of symbols to list.")
@library_option
@json_option
def nearest(symbol: str, k: int, folder: Path, as_json: bool) -> None:
    """List the symbols most similar to one."""
    with opened(folder) as actions:
        data = [neighbor._asdict() for neighbor in actions.nearest(symbol, k)]
    lines = [f"{neighbor['distance']:.3f}  {printable(neighbor['symbol'])}" for neighbor in data]
    say(as_json, data, lambda: "\n".join(lines))


@library.command(short_help="List the symbols that lie between two.")
@click.argument("first", type=SymbolName())
@click.argument("second", type=SymbolName())
@library_option
@json_option
def between(first: str, second: str, folder: Path, as_json: bool) -> None:
    """List the symbols that lie between two, the smallest detour first."""
    with opened(folder) as actions:
        data = [middle._asdict() for middle in actions.between(first, second)]
    lines = [f"{row['share']:.0%} of the way, detour {row['excess']:.0%}  {printable(row['symbol'])}" for row in data]
    none = f"no symbol lies between {printable(first)} and {printable(second)}"
    say(as_json, data, lambda: "\n".join(lines) or none)


@library.command("map", short_help="Draw a map of the symbols, similar ones near each other.")
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


def _write(data: dict[str, Any], output: Path) -> None:
    from kineme.reporting.atomic import write_atomically

    if str(output) == "-":
        say(True, data, str)
    else:
        write_atomically(output, (to_json(data) + "\n").encode())


@library.command()
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
    say(as_json, data, lambda: _changed_text(data))


@library.command()
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
    say(as_json, data, lambda: _changed_text(data))


def _changed_text(data: dict[str, Any]) -> str:
    holds = f"{printable(data['name'])} ({data['id']}): {counted(data['movements'], 'movement')}"
    return f"{holds}; version {data['version']}"


@library.command()
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
