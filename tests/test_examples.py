"""Everything shown is executed, and what it prints is compared: pages, and the examples in docstrings."""

import ast
import doctest
import importlib
import pkgutil
import re
import shlex
import sys
from importlib.util import find_spec
from pathlib import Path

import click
import pytest
from walk_through import DOCS, otherwise, page_name, pages, shown_by, walk

import kineme
from kineme.cli import main

TUTORIAL = sorted((DOCS / "tutorials").glob("action-library*.md"))  # test_tutorial.py runs it, and looks at more
PAGES = [page for page in pages() if page not in TUTORIAL]
MODULES = [
    module.name for module in pkgutil.walk_packages(kineme.__path__, "kineme.")
    if not module.name.endswith("__main__") and (find_spec("torch") or not module.name.startswith("kineme.torch."))
]  # fmt: skip


@pytest.fixture
def no_figures():
    """Pages show figures of pyplot, if others have loaded it, and it warns of the twenty-first that is open."""
    if pyplot := sys.modules.get("matplotlib.pyplot"):
        pyplot.close("all")


@pytest.mark.usefixtures("no_figures")
@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_pages_run_and_print_what_they_show(page, tmp_path):
    steps = list(walk(page, tmp_path))
    others = {step.source: answer for step in steps if (answer := otherwise(step)) is not None}
    assert not others


@pytest.mark.parametrize("page", [*PAGES, *TUTORIAL], ids=page_name)
def test_pages_show_what_every_print_prints(page):
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    for block in blocks:
        prints = [node for node in ast.walk(ast.parse(block)) if isinstance(node, ast.Call) and _name(node) == "print"]
        shown = shown_by(block)
        assert len(shown) >= len(prints)
        assert "..." not in shown, block


def _name(call):
    return getattr(call.func, "id", None)


def test_a_page_that_shows_another_result_is_found_out(tmp_path):
    page = tmp_path / "page.md"
    for shown, right in (("2", True), ("3", False), ("", True)):
        page.write_text(f"```python\nprint(1 + 1){f'  # {shown}' if shown else ''}\nprint('a\\nb')\n# a\n# b\n```\n")
        (step,) = walk(page, tmp_path)
        assert (otherwise(step) is None) is right
    page.write_text("```python\nprint(1)  # 1\nprint(2)\n# 2\n```\n")
    assert next(walk(page, tmp_path)).shown == ["1", "2"]


def test_what_needs_a_package_that_is_missing_is_left_out(tmp_path, monkeypatch):
    page = tmp_path / "page.md"
    page.write_text(
        "```python\nimport mujoco\nprint(1)\n```\n```console\n$ kineme execute no.json --simulate\n"
        "$ kineme plan no.pddl\n$ kineme --version\n```\n"
    )
    monkeypatch.setattr("walk_through.find_spec", lambda package: None)
    assert [step.source for step in walk(page, tmp_path)] == ["kineme --version"]


def test_python_of_a_page_means_what_it_means_to_a_reader(tmp_path):
    """Annotations are evaluated, as where the block is copied into a file."""
    page = tmp_path / "page.md"
    page.write_text("```python\ndef f(x: Missing) -> None: ...\n```\n")
    with pytest.raises(NameError):
        list(walk(page, tmp_path))


_COMMAND = re.compile(r"^    (?:.*\| )?kineme (.+?)(?:  +#.*| > .*)?$", re.MULTILINE)


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_commands_and_options_of_pages_exist(page):
    """Commands that a page shows without their answer: they are parsed, not run."""
    for line in _COMMAND.findall(page.read_text(encoding="utf-8")):
        command, context, rest = main, click.Context(main), shlex.split(line)
        while isinstance(command, click.Group):
            name, command, rest = command.resolve_command(context, rest)
            context = click.Context(command, parent=context, info_name=name)
        command.parse_args(context, rest)


_FENCED = re.compile(r"^(`{3,})([^`\n]*)\n.*?^\1$", re.MULTILINE | re.DOTALL)
_INLINE = re.compile(r"`kineme ([^`]+)`")


@pytest.mark.parametrize("page", [*PAGES, *TUTORIAL], ids=page_name)
def test_commands_and_options_in_sentences_exist(page):
    """Between backticks, where arguments may be missing; and no block of bash holds one, which nobody would try."""
    text = page.read_text(encoding="utf-8")
    assert not [block[0] for block in _FENCED.finditer(text) if block[2] == "bash" and "\nkineme " in block[0]]
    for line in _INLINE.findall(_FENCED.sub("", text)):
        command, words = main, shlex.split(line.partition(" | ")[0])
        while isinstance(command, click.Group) and words and not words[0].startswith("-"):
            command, words = command.commands[words[0]], words[1:]
        known = {name for one in command.params for name in one.opts + one.secondary_opts} | {"--help", "--version"}
        assert {word for word in words if word.startswith("--")} <= known, line


def test_examples_in_docstrings():
    """Of all modules, each of which can be imported; those without an example are not searched for any."""
    modules = [importlib.import_module(name) for name in MODULES]
    shown = [module for module in modules if ">>> " in Path(module.__file__).read_text(encoding="utf-8")]
    assert len(shown) >= 10
    assert [module.__name__ for module in shown if doctest.testmod(module).failed] == []
