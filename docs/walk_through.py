"""Walk through a page: run its Python blocks and its commands in order, in one folder, and keep what they answer.

A block marked python is executed; all of a page share their names. In a block marked console, a line that begins with
``$ `` is a command of kineme, and the lines below it are what it answers. No shell takes part.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

_BLOCK = re.compile(r"^```(python|console)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_PRINTED = re.compile(r"^ *print\(.*\)  # (.+)$", re.MULTILINE)


class Step(NamedTuple):
    """A command or a Python block of a page: what it is, what the page shows of its answer, and the real answer."""

    source: str
    shown: list[str]
    answer: list[str]
    status: int


def walk(page: Path, folder: Path) -> Iterator[Step]:
    """Run a page in an empty folder, step by step."""
    names: dict[str, Any] = {}
    for kind, text in _BLOCK.findall(page.read_text(encoding="utf-8")):
        yield from [_run_python(text, page.name, folder, names)] if kind == "python" else _run_console(text, folder)


def _run_python(text: str, name: str, folder: Path, names: dict[str, Any]) -> Step:
    """What a page shows of a block is the comment behind each ``print`` that has one."""
    printed = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(printed):
        exec(compile(text, name, "exec"), names)
    shown = [line for comment in _PRINTED.findall(text) for line in ("...", comment)]
    return Step(text, [*shown, "..."] if shown else [], printed.getvalue().splitlines(), 0)


def _run_console(text: str, folder: Path) -> Iterator[Step]:
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, *shown = part.rstrip("\n").split("\n")
        program, *arguments = shlex.split(command, comments=True)
        if program != "kineme":
            raise ValueError(f"expected a command of kineme, got {command!r}")
        done = subprocess.run(
            [Path(sys.executable).parent / "kineme", *arguments],
            cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            encoding="utf-8", check=False, env={**os.environ, "PYTHONIOENCODING": "utf-8"},
        )  # fmt: skip
        yield Step(command, shown, done.stdout.splitlines(), done.returncode)
