"""What commands print: text for people, JSON for programs."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from typing import Any

import click

from kineme.output.text import printable_lines

_LISTED = 12  # items of a list, written out


def say(as_json: bool, data: Any, text: Callable[[], str]) -> None:
    """Print `data` as one JSON document, or the text."""
    write(to_json(data, sys.stdout.encoding or "utf-8") if as_json else text())


def write(text: Any = "", *, err: bool = False) -> None:
    """Print lines, without anything that a terminal would obey; what comes from a file may hold that."""
    click.echo(printable_lines(text), err=err)


def write_bytes(data: bytes) -> None:
    """Print a file as it is, for the program that reads it."""
    click.echo(data, nl=False)


def ask(question: str) -> str:
    """A line from the person at the terminal; empty for none."""
    return str(click.prompt(printable_lines(question), default="", show_default=False))


def confirm(question: str, **options: Any) -> bool:
    """Yes or no from the person at the terminal."""
    return click.confirm(printable_lines(question), **options)


def to_json(data: Any, encoding: str = "utf-8") -> str:
    """One JSON document; where a terminal would obey a character, or the encoding lacks one, all in ASCII."""
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, indent=1)
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        shown = False
    else:
        shown = printable_lines(text) == text
    return text if shown else json.dumps(data, allow_nan=False, indent=1)


def in_words(detail: Mapping[str, Any]) -> str:
    """Keys with their values, ``added 30; symbols nod, wave``: nothing of what is empty, the number of a long list."""
    parts = []
    for key, value in detail.items():
        items = value if isinstance(value, list) else [value]
        if len(items) > _LISTED:
            parts.append(f"{len(items)} {key}")
        elif items and value not in ("", None):
            parts.append(f"{key} {', '.join(map(str, items))}")
    return "; ".join(parts)
