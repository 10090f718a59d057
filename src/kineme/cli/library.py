"""``kineme library``: show and edit an action library."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from functools import wraps
from importlib.resources import files
from pathlib import Path
from typing import Any

import click

from kineme.cli.options import FILE, ID, SymbolName, json_option, library_option, opened, whole
from kineme.cli.output import confirm, in_words, say, table, to_json
from kineme.reporting.text import counted, printable


@click.group()
def library() -> None:
    """Show and edit an action library."""


_Answer = tuple[Any, Callable[[], str]]


def _command(*names: str, read_only: bool = True, **options: Any) -> Callable[[Callable[..., _Answer]], click.Command]:
    """Add a command: a function of the open library that returns what is printed, as data and as text."""

    def add(answer: Callable[..., _Answer]) -> click.Command:
        @wraps(answer)
        def run(folder: Any, as_json: bool, **arguments: Any) -> None:
            with opened(folder, read_only=read_only) as actions:
                data, text = answer(actions, **arguments)
            say(as_json, data, text)

        own = getattr(answer, "__click_params__", [])
        run.__dict__["__click_params__"] = []
        library_option(json_option(run))  # below the options of its own
        run.__dict__["__click_params__"] += own
        return library.command(*names, **options)(run)

    return add


@_command("list")
@click.option("--at", "version", type=ID, help="Show this version of the library.")
def list_symbols(actions: Any, version: int | None) -> _Answer:
    """List the symbols of a library."""
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

    return data, text


@_command(short_help="Show one symbol and its movements.")
@click.argument("symbol", type=SymbolName())
def show(actions: Any, symbol: str) -> _Answer:
    """Show one symbol: its movements, where they come from, and how they vary."""
    from kineme.library.storage.symbols import symbol_report

    data = symbol_report(actions.store, symbol)
    return data, lambda: _report_text(data)


@_command(read_only=False)
@click.argument("symbol", type=SymbolName())
@click.argument("name")
def rename(actions: Any, symbol: str, name: str) -> _Answer:
    """Give a symbol another NAME; its id stays."""
    from kineme.library.storage import changes

    key = actions[symbol].id  # a name may be another symbol's when the change is made
    version = changes.rename(actions.store, key, name)
    data = {**brief(actions[key]), "was": symbol, "version": version}
    return data, lambda: f"{printable(symbol)} is now {printable(data['name'])} ({data['id']})"


@_command(read_only=False)
@click.argument("symbol", type=SymbolName())
@click.argument("text")
def annotate(actions: Any, symbol: str, text: str) -> _Answer:
    """Set the description of a symbol."""
    from kineme.library.storage import changes

    key = actions[symbol].id
    version = changes.annotate(actions.store, key, description=text)
    data = {**brief(actions[key]), "version": version}
    return data, lambda: f"{printable(data['name'])}: {printable(text)}"


@library.command(short_help="Delete a symbol or movements; earlier versions keep them.")
@click.argument("symbol", type=SymbolName(), required=False)
@click.option("--movement", "movements", type=ID, multiple=True, help="Delete this movement; may be repeated.")
@click.option("--yes", "-y", is_flag=True, help="Do not ask.")
@library_option
@json_option
def delete(symbol: str | None, movements: tuple[int, ...], yes: bool, folder: Any, as_json: bool) -> None:
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


@_command()
@click.option(
    "--limit", "-n", type=whole(1), default=20, show_default=True, help="Number of versions to list, the latest ones."
)
def history(actions: Any, limit: int) -> _Answer:
    """List the versions: what changed, and when."""
    versions = actions.history()
    last = versions[-limit:]
    data = [{"version": version.id, "at": version.at, "action": version.action, **version.detail} for version in last]

    def text() -> str:
        rows = [
            (str(version.id), version.at[:19].replace("T", " "), version.action, printable(in_words(version.detail)))
            for version in last
        ]
        return table(("version", "at (UTC)", "action", "what"), rows, counted(len(versions), "version"))

    return data, text


@_command(read_only=False, short_help="Take back the last change, or restore a version.")
@click.option("--at", "expected", type=ID, help="Only if this is still the last version, as history lists it.")
@click.option("--to", type=ID, help="Restore this earlier version, as history lists it; 0 is the empty library.")
def undo(actions: Any, expected: int | None, to: int | None) -> _Answer:
    """Take back the last change, whoever made it, as a new version; again, the one before.

    All that one call of kineme learn stored is one change. kineme library history lists the changes. With --to, the
    library is as it was at that version: versions between stay in the history, and undo takes the restoring back. What
    was undone is done again by restoring the version that was taken back.
    """
    undone = actions.undo(expected, to)
    done = f"took back {undone.action}; as at" if to is None else "restored"
    text = f"{done} version {undone.to}; version {undone.version}"
    return {"undone": undone.action, "to": undone.to, "version": undone.version}, lambda: text


@library.command(short_help="Check every byte of a library.")
@library_option
@json_option
@click.pass_context
def verify(ctx: click.Context, folder: Any, as_json: bool) -> None:
    """Check every byte of a library; the exit status is 1 if something is wrong."""
    with opened(folder) as actions:
        problems = [str(problem) for problem in actions.verify()]
        n = len(actions)
    text = "\n".join(map(printable, problems)) or f"{counted(n, 'movement')}, nothing wrong"
    say(as_json, {"ok": not problems, "movements": n, "problems": problems}, lambda: text)
    ctx.exit(1 if problems else 0)


@_command()
@click.argument("path", type=FILE)
def export(actions: Any, path: Path) -> _Answer:
    """Write a whole library to one file, as a backup or for others."""
    actions.export(path)
    data: dict[str, Any] = {"path": str(path), "movements": len(actions), "bytes": path.stat().st_size}
    return data, lambda: f"wrote {printable(path)}: {counted(data['movements'], 'movement')}"


@library.command("import")
@click.argument("path", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@library_option
@json_option
def import_(path: Path, folder: Any, as_json: bool) -> None:
    """Create a library from an exported file."""
    from kineme.library.library import ActionLibrary

    with ActionLibrary.import_(path, folder) as actions:
        data: dict[str, Any] = {"library": str(folder), "movements": len(actions), "symbols": len(actions.symbols())}
    say(as_json, data, lambda: f"{printable(folder)}: {counted(data['movements'], 'movement')}")


def brief(symbol: Any) -> dict[str, Any]:
    """A symbol as plain data."""
    data = {name: getattr(symbol, name) for name in ("name", "id", "description", "prototype")}
    return data | {"movements": len(symbol), "parents": list(symbol.parents)}


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
@click.option("--units", help="Units of the positions, as mm; one, or one per dimension separated by commas.  "
              "[default: those of the recordings]")  # fmt: skip
@click.option("--output", "-o", type=click.Path(dir_okay=False, allow_dash=True, path_type=Path), default="-",
              show_default=True, help="A .json file; - for the screen.")  # fmt: skip
def ground(symbol: str, folder: Any, by: str, units: str | None, output: Path) -> None:
    """Write a symbol for a planner: primitive, parameters and their demonstrated ranges, as JSON.

    kineme library schema prints the JSON Schema of this output.
    """
    from kineme.reporting.atomic import write_atomically

    with opened(folder) as actions:
        grounding = actions.ground(symbol, by, units.split(",") if units and "," in units else units)
    if str(output) == "-":
        say(True, grounding, str)
    else:
        write_atomically(output, (to_json(grounding) + "\n").encode())


@library.command()
def schema() -> None:
    """Print the JSON Schema of the output of ground."""
    text = files("kineme").joinpath("anchoring/grounding.schema.json").read_text(encoding="utf-8")
    say(True, json.loads(text), str)  # kineme.anchoring.grounding_schema() would load all of anchoring


@_command()
@click.argument("symbol", type=SymbolName())
@click.option("-k", type=whole(1), default=3, show_default=True, help="Number of symbols to list.")
def nearest(actions: Any, symbol: str, k: int) -> _Answer:
    """List the symbols most similar to one."""
    data = [neighbor._asdict() for neighbor in actions.nearest(symbol, k)]
    lines = [f"{neighbor['distance']:.3f}  {printable(neighbor['symbol'])}" for neighbor in data]
    return data, lambda: "\n".join(lines)


@_command(short_help="List the symbols that lie between two.")
@click.argument("first", type=SymbolName())
@click.argument("second", type=SymbolName())
def between(actions: Any, first: str, second: str) -> _Answer:
    """List the symbols that lie between two, the smallest detour first."""
    data = [middle._asdict() for middle in actions.between(first, second)]
    lines = [f"{row['share']:.0%} of the way, detour {row['excess']:.0%}  {printable(row['symbol'])}" for row in data]
    return data, lambda: "\n".join(lines) or f"no symbol lies between {printable(first)} and {printable(second)}"


@_command("map", short_help="Draw a map of the symbols, similar ones near each other.")
@click.argument("path", type=FILE)
def draw(actions: Any, path: Path) -> _Answer:
    """Draw a map of the symbols, similar ones near each other: a .png, .svg or .pdf file."""
    from kineme.anchoring.figures import draw_map
    from kineme.library.grounding import prototype_of, space_of
    from kineme.reporting.figures import save_figure

    space = space_of(actions.store)
    typical = [prototype_of(actions.store, actions[name]) for name in space.symbols]
    save_figure(draw_map(space, actions.movements(ids=typical)), path)
    data = {"path": str(path), "symbols": list(space.symbols), "distances": space.distances.tolist()}
    return data, lambda: f"wrote {printable(path)}: {counted(len(space.symbols), 'symbol')}"


@_command(read_only=False)
@click.argument("symbols", type=SymbolName(), nargs=-1, required=True)
@click.option("--into", required=True, help="Name of the merged symbol.")
def merge(actions: Any, symbols: tuple[str, ...], into: str) -> _Answer:
    """Merge several symbols into one."""
    from kineme.library.storage import changes

    return _changed(actions, into, changes.merge(actions.store, symbols, into))


@_command(read_only=False)
@click.argument("symbol", type=SymbolName())
@click.option(
    "--movement", "movements", type=ID, multiple=True, required=True, help="Movement to take over; may be repeated."
)
@click.option("--into", required=True, help="Name of the new symbol.")
def split(actions: Any, symbol: str, movements: tuple[int, ...], into: str) -> _Answer:
    """Split a symbol: some of its movements become a new symbol."""
    from kineme.library.storage import changes

    return _changed(actions, into, changes.split(actions.store, symbol, list(movements), into))


def _changed(actions: Any, into: str, version: int) -> _Answer:
    data = {**brief(actions[into]), "version": version}
    holds = f"{printable(data['name'])} ({data['id']}): {counted(data['movements'], 'movement')}"
    return data, lambda: f"{holds}; version {version}"


@_command()
def review(actions: Any) -> _Answer:
    """Find symbols that could be merged, and symbols that could be split."""
    suggested = actions.review()
    splits = [{**each._asdict(), "parts": [part.tolist() for part in each.parts]} for each in suggested.splits]
    lines = [
        f"{printable(merge.first)} and {printable(merge.second)} could be one: they overlap by {merge.overlap:.2f}"
        for merge in suggested.merges
    ]
    for each in splits:
        first, second = each["parts"]
        lines.append(
            f"{printable(each['symbol'])} could be two: {len(first)} movements, and {', '.join(map(str, second))}"
        )
    none = "the symbols are well apart, and none falls into two clusters"
    data = {"merges": [suggestion._asdict() for suggestion in suggested.merges], "splits": splits}
    return data, lambda: "\n".join(lines) or none
