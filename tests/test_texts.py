"""What comes from files is shown, and never obeyed: on terminals, in drawings, in HTML."""

from __future__ import annotations

import ast
import os
import pty
import subprocess
import sys
import unicodedata
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

import kineme
from kineme.anchoring.figures import draw_map
from kineme.anchoring.space import ConceptualSpace
from kineme.cli.main import main
from kineme.cli.output import say, write
from kineme.reporting.figures import FORMATS, encode_figure, new_figure
from kineme.reporting.page import page
from kineme.reporting.table import Table, to_html, to_text
from kineme.reporting.text import drawable, in_markup, printable, printable_lines

PACKAGE = Path(__file__).parents[1] / "src" / "kineme"

#: Names that a terminal would obey, that mislead the reader, or that drawings and pages take for something else.
HOSTILE = (
    "\x1b[2J\x1b[31mred", "\x1b]0;title\x07", "\x9b31m", "\x85next", "two\nlines", "back\rwards", "bell\a", "del\x7f",
    "\u202ecod.exe", "\u2066left\u2069", "zero\u200bwidth", "soft\xadhyphen", "no\xa0break", "\ufeffmark", "\u2028line",
    "\ufffe", "\U000e0041tag", "unseen\u3164", "\ud800", "$x$", "$\\frac{$", "$$", "a\\$b$", "<b>&\"'</b>",
    "--><script>", "]]>", "%s{0}", "名前", "👋🏽", "é", "naïve 'wave'; --",
)  # fmt: skip
#: As a library can hold them.
NAMES = tuple(name for name in HOSTILE if name != "\ud800")


def _obeyed(text):
    """Characters that no terminal should get beside the ends of lines."""
    return {mark for mark in text if unicodedata.category(mark) in {"Cc", "Cf", "Zl", "Zp", "Cs"}} - {"\n"}


@given(text=st.text())
def test_what_is_printable_is_on_one_line_says_all_and_stays_as_it_is(text):
    shown = printable(text)
    assert shown.isprintable()
    assert printable(shown) == shown
    assert "".join(printable(mark) for mark in text) == shown
    assert printable_lines(text).split("\n") == [printable(line) for line in text.split("\n")]
    ElementTree.fromstring(f"<p a='{in_markup(text)}'>{in_markup(text)}</p>")


@pytest.mark.parametrize(
    "name", ["wave", "naïve 'wave'; --", "名前", "нет", "עברית", "👋🏽", "a b", "$x$", "é", "\\x1b"]
)
def test_names_in_any_language_are_left_alone(name):
    assert printable(name) == name


@pytest.mark.parametrize("mark", ["\u034f", "\u115f", "\u1160", "\u17b4", "\u17b5", "\u2800", "\u3164", "\uffa0"])
def test_marks_without_ink_are_written_out(mark):
    """Unicode counts them as printable; two names that differ in them alone would look the same."""
    assert mark.isprintable()
    assert printable(f"wave{mark}1") == f"wave\\u{ord(mark):04x}1"


@pytest.mark.parametrize("name", HOSTILE)
def test_every_way_of_showing_a_name_is_harmless(name):
    table = Table(name, (name, "n"), [(name, "1"), ("x", name)], name)
    assert not _obeyed(to_text(table))
    for markup in (
        to_html(table),
        page(name, name, [name], to_html(table), {name: name}).removeprefix("<!doctype html>\n"),
    ):
        ElementTree.fromstring(
            markup.replace('<meta charset="utf-8">', "").replace('initial-scale=1">', 'initial-scale=1"/>')
        )


@pytest.mark.parametrize("kind", FORMATS)
def test_hostile_names_are_drawn_without_warnings_errors_or_formulas(kind):
    """Also where a drawing forgot `drawable`: the one place that makes a file of it writes them out."""
    n = len(NAMES)
    rng = np.random.default_rng(0)
    space = ConceptualSpace(NAMES, np.abs(np.subtract.outer(np.arange(n), np.arange(n))).astype(float))
    figure = draw_map(space, rng.normal(size=(n, 10, 2)).cumsum(axis=1))
    figure.axes[0].set_xlabel("".join(name for name in NAMES if "$" not in name))
    data = encode_figure(figure, kind)
    if kind == "svg":
        text = data.decode()
        ElementTree.fromstring(text)
        assert not _obeyed(text)


def test_a_formula_is_drawn_as_it_is_written():
    figure = new_figure(2, 2)
    text = figure.text(0, 0, drawable("a$x^2$"))
    encode_figure(figure, "png")
    assert text._preprocess_math(text.get_text()) == ("a$x^2$", False)


@pytest.mark.parametrize("name", NAMES)
def test_whatever_a_command_prints_goes_through_a_filter(capsys, name):
    write(name)
    say(True, {name: name}, str)
    assert not _obeyed(capsys.readouterr().out)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A library whose every text is hostile."""
    folder = tmp_path_factory.mktemp("hostile") / "actions"
    rng = np.random.default_rng(0)
    paths = rng.normal(size=(2 * len(NAMES), 20, 2)).cumsum(axis=1)
    demos = kineme.Demonstrations.from_arrays(paths, list(NAMES) * 2, names=list(NAMES) * 2)
    with kineme.ActionLibrary(folder, create=True) as library:
        library.learn(demos)
        for name in NAMES:
            library.annotate(name, name)
    return folder


COMMANDS = {
    "list": ("library", "list"),
    "show": ("library", "show", NAMES[0]),
    "history": ("library", "history", "-n", "100"),
    "verify": ("library", "verify"),
    "nearest": ("library", "nearest", NAMES[1], "-k", "20"),
    "between": ("library", "between", NAMES[0], NAMES[4]),
    "review": ("library", "review"),
    "no such symbol": ("library", "show", "\x1b[31mnone"),
    "a wrong option": ("library", "delete", NAMES[0], "--movement", "\x1b[31m1"),
    "a wrong command": ("library", "\x1b[31m"),
}


def test_a_name_of_a_million_characters_does_not_bury_what_stands_beside_it(tmp_path):
    """A label column of a file, or a library from elsewhere, may hold anything."""
    name = "begin" + "a" * 2**20 + "end"
    assert len(printable(name)) == 4000
    assert printable(name).startswith("begina")
    assert printable(name).endswith("aend")
    assert printable("b" * 4000) == "b" * 4000
    table = to_text(Table(name, ("label", "movements", name), [(name, "1", name), ("wave", "2", "")])).splitlines()
    assert max(map(len, table[1:])) < 400
    assert [line for line in table if line.startswith("wave ") and line.endswith("  2")]
    rows = [f"0,{name},{k},{k % 3},{k}" for k in range(9)]
    (tmp_path / "a.csv").write_text("\n".join(["demo,label,t,x,y", *rows]))
    found = CliRunner().invoke(main, ["inspect", str(tmp_path / "a.csv")])
    assert found.exit_code == 0
    assert len(found.output) < 10_000


@pytest.mark.parametrize("more", [(), ("--json",)])
@pytest.mark.parametrize("name", COMMANDS)
def test_no_command_prints_what_a_terminal_would_obey(folder, name, more):
    if more and name == "a wrong command":
        return
    runner = CliRunner()
    found = runner.invoke(main, [*COMMANDS[name], *more, "-l", str(folder)], color=True)
    assert not _obeyed(found.output), found.output
    assert found.output


def test_a_terminal_gets_no_control_characters(folder):
    """A true pseudo-terminal: where the output is none, click itself takes out colors."""
    here, there = pty.openpty()
    command = [sys.executable, "-m", "kineme", "library", "list", "-l", str(folder)]
    environment = os.environ | {"PYTHONIOENCODING": "utf-8", "TERM": "xterm"}
    process = subprocess.Popen(command, stdout=there, stderr=there, stdin=there, env=environment)
    os.close(there)
    data = b""
    try:
        while part := os.read(here, 65536):
            data += part
    except OSError:  # the other end is closed
        pass
    assert process.wait() == 0
    os.close(here)
    assert not _obeyed(data.decode().replace("\r\n", "\n"))
    assert "\\x1b[2J\\x1b[31mred" in data.decode()


@cache
def _calls():
    """What each file calls, as ``click.echo``, ``print``, ``savefig``."""
    return [
        (path.relative_to(PACKAGE).as_posix(), ast.unparse(node.func))
        for path in PACKAGE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Call)
    ]


PRINTING = {"print", "click.echo", "click.secho", "click.style", "click.prompt", "click.confirm", "click.pause"}


@pytest.mark.parametrize(
    ("door", "is_passage"),
    [
        ("cli/output.py", lambda call: call in PRINTING or call.startswith(("sys.stdout.write", "sys.stderr.write"))),
        (
            "reporting/figures.py",
            lambda call: call.endswith((".savefig", ".print_figure", ".print_svg", "tight_layout")),
        ),
        ("reporting/text.py", lambda call: call.split(".")[-1] == "escape" and not call.startswith("re.")),
    ],
)
def test_there_is_one_door_through_which_texts_leave(door, is_passage):
    assert {path for path, call in _calls() if is_passage(call)} == {door}
