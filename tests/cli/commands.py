"""The command line, called in this process or as one of its own.

Starting Python and importing what a command needs takes seconds. What a command answers is the same in this process;
that it starts, ends, reads pipes and writes to a terminal is tested with true processes, at least one a command.
"""

from __future__ import annotations

import contextlib
import inspect
import json
import subprocess
import sys
from typing import NamedTuple

from click.testing import CliRunner

from kineme.cli import main

# Before 8.2, Click pours errors and output into one unless told not to.
_APART = {"mix_stderr": False} if "mix_stderr" in inspect.signature(CliRunner).parameters else {}


class Done(NamedTuple):
    """How a command ended: as `subprocess.CompletedProcess`."""

    returncode: int
    stdout: str
    stderr: str


def run(*arguments, input=None, cwd="."):  # noqa: A002 - named as in subprocess
    """Call ``kineme`` here; what is not an error for users is raised."""
    with contextlib.chdir(cwd):
        runner = CliRunner(**_APART)
        done = runner.invoke(main, [*map(str, arguments)], input, prog_name="kineme", catch_exceptions=False)
    return Done(done.exit_code, done.stdout, done.stderr)


def start(*arguments, **options):
    """Run ``python -m kineme`` to its end; warnings are errors there too."""
    command = [sys.executable, "-W", "error", "-m", "kineme", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    return Done(done.returncode, done.stdout, done.stderr)


def answer(*arguments, by=run, **options):
    """What a command that succeeds says with ``--json``."""
    done = by(*arguments, "--json", **options)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return json.loads(done.stdout)
