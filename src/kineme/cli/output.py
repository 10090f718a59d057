"""What commands print: text for people, JSON for programs."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import click


def say(as_json: bool, data: Any, text: Callable[[], str]) -> None:
    """Print `data` as one JSON document, or the text."""
    click.echo(json.dumps(data, ensure_ascii=False, allow_nan=False, indent=1) if as_json else text())


def printable(name: Any) -> str:
    """A name as a terminal may show it: control characters, which a terminal would obey, are written out."""
    return "".join(mark if mark.isprintable() else mark.encode("unicode_escape").decode() for mark in str(name))


def count(number: int, what: str) -> str:
    """A number and its noun: ``1 movement``, ``2 movements``."""
    return f"{number:,} {what}{'' if number == 1 else 's'}"
