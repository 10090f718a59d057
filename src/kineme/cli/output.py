"""Output of the commands: text for people, JSON for programs."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import click

from kineme.reporting.text import printable, printable_lines

_LISTED = 12  # items of a list that are printed; more are counted
_NUMBERS = re.compile(r"\[\n[^\[\]{}\"]*\]")  # an indented array in JSON; no text has a line break there


def say(as_json: bool, data: Any, text: Callable[[], str]) -> None:
    """Print `data` as one JSON document, or the text."""
    write(to_json(data, sys.stdout.encoding or "utf-8") if as_json else text())


def write(text: Any = "", *, err: bool = False) -> None:
    """Print lines with control characters escaped: texts from files may contain them."""
    click.echo(printable_lines(text), err=err)


def check_new(
    path: Path | None, force: bool, *inputs: str | Path, remedy: str = "--force", endings: Sequence[str] = (),
    flag: str | None = None,
) -> None:  # fmt: skip
    """Refuse to write over an input, or a file in one, and without --force, or what `remedy` names, over any file.

    With `endings`, "" of a folder, the path of an option `flag` has one of them, and its folder is there.
    """
    if path is None or str(path) == "-":
        return
    if path.exists() and any(Path(source).exists() and path.samefile(source) for source in inputs):
        raise click.UsageError(f"expected another file to write than the input {printable(path)}")
    around = [source for source in inputs if Path(source).is_dir() and Path(source).resolve() in path.resolve().parents]
    if path.is_file() and around:
        raise click.UsageError(
            f"expected another file to write than {printable(path)}, one of the input {printable(around[0])}"
        )
    if endings:
        if path.suffix.lower() not in endings:
            expected = ", ".join(ending or "a folder" for ending in endings)
            raise click.BadParameter(f"expected {expected}, got {path.suffix or 'no ending'}", param_hint=flag)
        if path.is_dir():
            raise click.UsageError(
                f"expected a new file or folder to write, the folder {printable(path)} is there, and no option writes "
                "over folders; choose another name, or remove it"
            )
        if not path.absolute().parent.is_dir():
            raise click.UsageError(f"expected a folder to write {printable(path)} into, there is none; create it")
    if not path.exists():
        parent = next(folder for folder in path.absolute().parents if folder.exists())
        if not os.access(parent, os.W_OK):
            raise click.UsageError(
                f"expected a folder that can be written, {printable(parent)} is read-only; allow writing there, or "
                "choose another folder"
            )
    if not force and path.is_file():
        raise click.UsageError(f"expected a new file to write, {printable(path)} is there; write over it with {remedy}")


def write_bytes(data: bytes) -> None:
    """Print bytes unchanged, for other programs."""
    click.echo(data, nl=False)


def progress(items: Any = None, **options: Any) -> Any:
    """Show a bar of progress on a terminal; see `tqdm.tqdm`."""
    from tqdm import tqdm

    return tqdm(items, leave=False, disable=None, **options)  # None: on a terminal only


def table(heads: tuple[str, ...], rows: Any, title: str = "") -> str:
    """Lay out rows below their heads; loads only where there is a table."""
    from kineme.reporting.table import Table, to_text

    return to_text(Table(title, heads, rows))


def stretch_cells(row: Mapping[str, Any]) -> tuple[str, str, str]:
    """Return where a stretch is, its start and its end [s] as cells of a table."""
    where = printable(f"{row['recording']} {row['place']}".strip())
    return where, f"{row['start']:.2f}", f"{row['end']:.2f}"


def unlisted(lists: Mapping[str, Sequence[Any]], most: int) -> list[str]:
    """Say of lists by their names how many items are beyond the first ones that are shown."""
    return [f"and {len(items) - most:,} more {name}; --json has all" for name, items in lists.items()
            if len(items) > most]  # fmt: skip


def ask(question: str) -> str:
    """Ask the user for a line; empty if none is entered."""
    return str(click.prompt(printable_lines(question), default="", show_default=False))


def confirm(question: str, **options: Any) -> bool:
    """Ask the user for yes or no."""
    return click.confirm(printable_lines(question), **options)


def to_json(data: Any, encoding: str = "utf-8") -> str:
    """One JSON document; in ASCII if it has control characters, or characters that the encoding lacks.

    Arrays of numbers stand on one line.
    """
    text = _NUMBERS.sub(_on_one_line, json.dumps(data, ensure_ascii=False, allow_nan=False, indent=1))
    with suppress(UnicodeEncodeError):
        text.encode(encoding)
        if printable_lines(text) == text:
            return text
    return _NUMBERS.sub(_on_one_line, json.dumps(data, allow_nan=False, indent=1))


def _on_one_line(array: re.Match[str]) -> str:
    return f"[{' '.join(array[0][1:-1].split())}]"


def in_words(detail: Mapping[str, Any]) -> str:
    """Keys with their values, as ``added 30; symbols nod, wave``, without empty ones; of a long list, its length."""
    parts = []
    for key, value in detail.items():
        items = value if isinstance(value, list) else [value]
        if len(items) > _LISTED:
            parts.append(f"{len(items)} {key}")
        elif items and value not in ("", None):
            parts.append(f"{key} {', '.join(map(str, items))}")
    return "; ".join(parts)
