"""The command line as a user meets it."""

import io
import json
import os
import re
import subprocess
import sys

import click
import pytest
from click.testing import CliRunner

import kineme
from kineme.cli.main import main
from kineme.cli.options import GroupedCommand, heading, headings, under
from kineme.cli.reading import LAYOUT_OPTIONS
from kineme.runtime import compiled
from soaking import slow


def run(*arguments):
    return subprocess.run([sys.executable, "-m", "kineme", *arguments], capture_output=True, text=True, check=False)


def test_help_lists_the_commands():
    done = run("--help")
    assert done.returncode == 0
    assert "reproduce" in done.stdout


def test_version():
    assert kineme.__version__ in run("--version").stdout


def test_a_reader_that_has_gone_ends_the_command_without_a_word():
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(
        [sys.executable, "-m", "kineme", "inspect", "--help"], stdout=write, stderr=subprocess.PIPE, check=False
    )
    os.close(write)
    assert (done.returncode, done.stderr) == (141, b"")


def test_an_unknown_command_is_refused():
    done = run("dance")
    assert done.returncode == 2
    assert "dance" in done.stderr


@pytest.mark.parametrize("terminal", [True, False])
def test_a_terminal_is_told_that_functions_are_compiled(monkeypatch, terminal):
    class Stream(io.StringIO):
        def isatty(self):
            return terminal

    told = Stream()
    monkeypatch.setattr(sys, "stderr", told)
    monkeypatch.setattr(compiled, "_tell", [])
    with pytest.raises(SystemExit):
        main(["inspect", "--help"])
    compiled._compiling()
    compiled._compiling()
    assert told.getvalue() == ("compiling for this machine; later commands find it done\n" if terminal else "")


def test_an_error_is_one_line_and_says_nothing_to_the_terminal(tmp_path):
    (tmp_path / "\x1b[31m\x1b]0;x\x07\nred.csv").write_text("no numbers\n")
    done = run("inspect", str(tmp_path))
    assert done.returncode == 1
    assert done.stderr.startswith("kineme: expected recordings in")
    assert done.stderr.count("\n") == 1
    assert "\x1b" not in done.stderr
    assert r"\x1b[31m" in done.stderr


@pytest.mark.parametrize("encoding", ["latin-1", slow("utf-8")])
def test_the_output_may_be_in_any_encoding(tmp_path, encoding):
    name = "→ é \U0001f44b \x9b31m"
    with kineme.ActionLibrary(tmp_path, create=True) as library:
        library.learn(kineme.load_lasa(["CShape"])[:2], labels=[name] * 2)
    environment = {**os.environ, "PYTHONIOENCODING": encoding, "KINEME_LIBRARY": str(tmp_path)}
    command = [sys.executable, "-m", "kineme", "library", "list"]
    text = subprocess.run(command, capture_output=True, check=True, env=environment).stdout.decode(encoding)
    assert "2 movements, 1 symbol" in text
    assert r" é " in text
    assert "\x9b" not in text
    data = subprocess.run([*command, "--json"], capture_output=True, check=True, env=environment).stdout.decode(
        encoding
    )
    assert json.loads(data)["symbols"][0]["name"] == name
    assert "\x9b" not in data


@pytest.mark.parametrize("arguments", [["--help"], ["library", "--help"], ["library", "schema"]])
def test_what_only_prints_loads_nothing_heavy(arguments):
    code = (
        "import sys, click.testing, kineme.cli as cli;"
        f"assert click.testing.CliRunner().invoke(cli.main, {arguments}).exit_code == 0;"
        "print([name for name in ('numpy', 'scipy', 'sklearn', 'numba', 'matplotlib') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def options_by_heading(arguments):
    """Heading -> the flags that the help lists below it, each as often as it stands there."""
    text = CliRunner().invoke(main, [*arguments, "--help"]).output
    flags, words = {}, None
    for line in text.splitlines():
        if line.endswith(":") and not line.startswith(" "):
            flags[words := line[:-1]] = []
        elif words and line.startswith("  -"):
            flags[words] += re.findall(r"--[a-z0-9-]+", line if words == "Reading" else line.partition("   ")[0])
    return flags


READERS = [name for name, command in main.commands.items() if {one.name for one in command.params} >= {*LAYOUT_OPTIONS}]


@pytest.mark.parametrize("name", READERS)
def test_every_option_stands_under_one_heading_and_those_for_reading_last(name):
    headed = options_by_heading([name])
    shown = [flag for flags in headed.values() for flag in flags if flag not in ("--help", "--no-outliers")]
    options = [one for one in main.commands[name].params if isinstance(one, click.Option)]
    inside = {one.opts[0] for one in options if one.name in LAYOUT_OPTIONS}
    assert list(headed)[-1] == "Reading"
    assert {*headed["Reading"]} - {"--help"} == inside
    assert sorted(shown) == sorted(next(flag for flag in one.opts if flag.startswith("--")) for one in options)


def test_options_for_reading_are_explained_once():
    explained = [name for name in READERS if "Pose of one frame" in CliRunner().invoke(main, [name, "--help"]).output]
    assert explained == ["inspect"]


def test_arm_movement_and_output_are_apart():
    headed = options_by_heading(["move"])
    assert list(headed) == ["Options", "Arm", "Movement", "Output", "Reading"]
    for words, flag in (("Arm", "--tip"), ("Movement", "--n-basis"), ("Output", "--view"), ("Output", "--json")):
        assert flag in headed[words]


def test_an_option_lands_where_it_is_written():
    """Below the next heading above it; one that is added with its own heading keeps that."""

    @click.command(cls=GroupedCommand)
    @click.option("--first")
    @heading("Arm")
    @click.option("--new")
    @under("Output", click.option("--sent"))
    @click.option("--newer")
    @heading("Movement")
    @click.option("--newest")
    def command(**options):
        pass

    groups = {
        words: [one.name for one in options if "--help" not in one.opts]
        for words, options in headings(command, click.Context(command)).items()
    }
    assert groups == {
        "Options": ["first"], "Arm": ["new", "newer"], "Output": ["sent"], "Movement": ["newest"],
    }  # fmt: skip
