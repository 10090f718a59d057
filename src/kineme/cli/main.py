"""``kineme``: the group of commands, and their error messages."""

from __future__ import annotations

import io
import logging
import os
import sys
from typing import Any

import click

from kineme.cli.anchor import anchor
from kineme.cli.annotate import annotate
from kineme.cli.audit import audit
from kineme.cli.correct import correct
from kineme.cli.discover import discover
from kineme.cli.evaluate import evaluate, reproduce
from kineme.cli.execute import execute
from kineme.cli.find import find
from kineme.cli.gather import gather
from kineme.cli.generate import export, generate
from kineme.cli.inspect import inspect
from kineme.cli.learn import learn
from kineme.cli.library import library
from kineme.cli.listen import listen, ros
from kineme.cli.move import move
from kineme.cli.operators import operators, plan
from kineme.cli.output import write
from kineme.cli.recognize import recognize, why
from kineme.cli.segment import segment
from kineme.cli.shards import features, serve
from kineme.cli.skills import skills
from kineme.cli.studio import page, studio
from kineme.errors import KinemeError
from kineme.reporting.text import printable, printable_lines
from kineme.runtime.compiled import tell_when_compiling

_BROKEN_PIPE = 128 + 13  # as a shell says it of a tool that the signal ends


class _OneLineErrors(click.Group):
    """Turn errors that users can act on into one line and exit status 1; bugs keep their traceback."""

    def invoke(self, ctx: click.Context) -> Any:
        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(errors="backslashreplace")  # characters that the encoding lacks are escaped
        logging.getLogger("matplotlib").setLevel(
            logging.ERROR
        )  # where it cannot keep its cache is not the user's concern
        if sys.stderr.isatty():
            tell_when_compiling(_say_compiling)
        try:
            return super().invoke(ctx)
        except click.ClickException as error:
            error.message = printable_lines(error.message)  # type: ignore[misc] # click prints it
            raise
        except BrokenPipeError:  # whoever reads the output has read enough, as head: end as other tools do
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            sys.exit(_BROKEN_PIPE)
        except (KinemeError, OSError) as error:
            write(f"kineme: {printable(_in_words(error))}", err=True)
            sys.exit(1)


def _in_words(error: Exception) -> str:
    """The message of an error; of one of the system without its number, and with what to do."""
    if not isinstance(error, OSError) or error.strerror is None:
        return str(error)
    where = "" if error.filename is None else f" {os.fsdecode(error.filename)}"
    if error.strerror.startswith("expected"):
        return f"{error.strerror}:{where}" if where else error.strerror
    return (
        f"expected to read or write{where or ' a file'}, the system refuses: {error.strerror.lower()}; "
        "check its name and who may read and write it"
    )


def _say_compiling() -> None:
    from tqdm import tqdm

    # above a progress bar, if there is one
    tqdm.write("compiling for this machine; later commands find it done", file=sys.stderr)


@click.group(cls=_OneLineErrors, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="kineme")
def main() -> None:
    """Learn movements as Dynamical Movement Primitives, recognize them, move again."""


for command in (
    anchor, annotate, audit, correct, discover, evaluate, execute, export, features, find, gather, generate, move,
    inspect, learn, library, listen, operators, page, plan, recognize, reproduce, ros, segment, serve, skills, studio,
    why,
):  # fmt: skip
    main.add_command(command)
