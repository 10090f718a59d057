"""The command line as a user meets it."""

import subprocess
import sys

import kineme


def run(*arguments):
    return subprocess.run([sys.executable, "-m", "kineme", *arguments], capture_output=True, text=True, check=False)


def test_help_lists_the_commands():
    done = run("--help")
    assert done.returncode == 0
    assert "reproduce" in done.stdout


def test_version():
    assert kineme.__version__ in run("--version").stdout


def test_an_unknown_command_is_refused():
    done = run("dance")
    assert done.returncode == 2
    assert "dance" in done.stderr


def test_help_loads_nothing_heavy():
    code = (
        "import sys, click.testing, kineme.cli as cli; click.testing.CliRunner().invoke(cli.main, ['--help']);"
        "print([name for name in ('numpy', 'scipy', 'sklearn', 'numba', 'matplotlib') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
