"""Walk through a page: run its Python blocks and its commands in order, in one folder, and keep what they answer.

A block marked python is executed; all of a page share their names. In a block marked console, a line that begins with
``$ `` is a command of kineme, and the lines below it are what it answers. It is called in this process, which saves
seconds a command; no shell takes part. A Python block that begins with the import of a package in `OPTIONAL`, and a
command with one of its words, is left out where that is not installed.
"""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import warnings
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from click.testing import CliRunner

from kineme.cli import main

DOCS = Path(__file__).parent
GENERATED = ("gallery", "reference/generated")  #: folders that the build of the site writes; git ignores them
#: Package -> words of the commands that need it.
OPTIONAL = {"jax": (), "mujoco": ("--simulate",), "torch": (), "unified_planning": ("plan", "execute"), "anywidget": ()}
#: Package -> how blocks of Python begin that need it, where that is not its import.
_BEGUN = {"anywidget": "from kineme.notebook import"}
_BLOCK = re.compile(r"^```(python|console)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_AFTER = re.compile(r"^<!-- after: (.+\.md) -->$", re.MULTILINE)
_PRINTED = re.compile(r"^ *print\(.*?\)(?:  # (.+))?((?:\n *# .+)*)$", re.MULTILINE)


class Step(NamedTuple):
    """A command or a Python block of a page: what it is, what the page shows of its answer, and the real answer."""

    source: str
    shown: list[str]
    answer: list[str]
    status: int


def pages() -> list[Path]:
    """The README and every page of docs/ that is written by hand or kept in git, by their paths."""
    written = [page for page in DOCS.rglob("*.md") if not page.relative_to(DOCS).as_posix().startswith(GENERATED)]
    return [DOCS.parent / "README.md", *sorted(written)]


def page_name(page: Path) -> str:
    """A page as its path from the root of the project, which tests are named after."""
    return page.relative_to(DOCS.parent).as_posix()


def pages_before(page: Path) -> list[Path]:
    """Return the page that another one goes on from, in a list; an empty one for a page that begins by itself."""
    return [page.parent / name for name in _AFTER.findall(page.read_text(encoding="utf-8"))]


def text_from_the_beginning(page: Path) -> str:
    """Return the text of a page, behind that of the pages which it goes on from."""
    earlier = [text_from_the_beginning(before) for before in pages_before(page)]
    return "\n".join([*earlier, _AFTER.sub("", page.read_text(encoding="utf-8"))])


def walk(page: Path, folder: Path, names: dict[str, Any] | None = None) -> Iterator[Step]:
    """Run a page in an empty folder, step by step; `names` are what its Python defines.

    A page that says ``<!-- after: another.md -->`` is run after that one.
    """
    names = {} if names is None else names
    for earlier in pages_before(page):
        for _ in walk(earlier, folder, names):
            pass
    for kind, text in _BLOCK.findall(page.read_text(encoding="utf-8")):
        if kind == "python" and text.startswith(
            tuple(_BEGUN.get(package, f"import {package}\n") for package in _missing())
        ):
            continue
        yield from [_run_python(text, page.name, folder, names)] if kind == "python" else _run_console(text, folder)


def _missing() -> list[str]:
    return [package for package in OPTIONAL if not find_spec(package)]


def otherwise(step: Step) -> str | None:
    """What a command or block really answers, where that is not what the page shows; None where it is.

    In what a page shows, ``...`` alone on a line is any lines, and within a line any text.
    """
    answer = "".join(f"{_normal(line)}\n" for line in step.answer)
    lines = [
        r"(?:.*\n)*?" if line.strip() == "..." else re.escape(_normal(line)).replace(r"\.\.\.", ".*?") + "\n"
        for line in step.shown
    ]
    return None if re.fullmatch("".join(lines), answer) else answer


def _normal(line: str) -> str:
    """A line without what differs from run to run: ids of symbols, times of day, and the width of rules."""
    line = re.sub(r"sym-[0-9a-f]{12}", "sym-ID", line.rstrip())
    line = re.sub(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d", "TIME", line)
    return re.sub(r"^-{5,}$", "-----", line)


def _run_python(text: str, name: str, folder: Path, names: dict[str, Any]) -> Step:
    printed = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(printed):
        exec(compile(text, name, "exec", dont_inherit=True), names)
    return Step(text, shown_by(text), printed.getvalue().splitlines(), 0)


def shown_by(text: str) -> list[str]:
    """What a Python block shows of its output: the comment behind a ``print``, or below it; ``...`` where none is."""
    shown: list[str] = []
    for behind, below in _PRINTED.findall(text):
        lines = [line.strip().removeprefix("# ") for line in below.split("\n") if line]
        shown += [behind] if behind else lines or ["..."]
    return shown


def _run_console(text: str, folder: Path) -> Iterator[Step]:
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, *shown = part.rstrip("\n").split("\n")
        program, *arguments = shlex.split(command, comments=True)
        if program != "kineme":
            raise ValueError(f"expected a command of kineme, got {command!r}")
        if any({*OPTIONAL[package]} & {*arguments} for package in _missing()):
            continue
        with contextlib.chdir(folder), warnings.catch_warnings():
            done = CliRunner().invoke(main, arguments, prog_name="kineme", catch_exceptions=False)
        yield Step(command, shown, done.output.splitlines(), done.exit_code)
