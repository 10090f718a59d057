"""Options and parameter types that several commands share."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Container
from contextlib import suppress
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

_PLAIN = re.compile(r"\w[\w@%+:./-]*")  # names that every shell reads as one word, and that are not options

_MOST = 1_000_000  # largest count; more is a typing error
_LARGEST_ID = 2**62 - 2  # of versions and movements, as in `library.storage.schema`, which --help should not load


def whole(least: int, most: int = _MOST) -> click.IntRange:
    """A whole number from `least` to `most`."""
    return click.IntRange(least, most)


def flag_of(name: str) -> str:
    """A parameter as it is written in the shell."""
    return f"--{name.replace('_', '-')}"


def given_options(names: Container[str | None]) -> list[str]:
    """List those of some parameters that the command line gives, as they are written there."""
    context = click.get_current_context()
    return [
        option.opts[0]
        for option in context.command.params
        if option.name in names
        and context.get_parameter_source(option.name or "") == click.core.ParameterSource.COMMANDLINE
    ]


#: Id of a movement, or number of a version.
ID = whole(0, _LARGEST_ID)

#: Heading of the options that say how recordings are read, the same in every command.
READING = "Reading"
_HEADINGS: dict[click.Parameter, str] = {}  # of options; those without stand below the first


def heading(words: str) -> Callable[[Any], Any]:
    """Put the options below it that have no heading yet under one in the help of a `GroupedCommand`."""

    def name(command: Any) -> Any:
        for option in getattr(command, "__click_params__", ()):
            _HEADINGS.setdefault(option, words)
        return command

    return name


def under(words: str, *options: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Add options that stand under a heading, wherever they are added."""

    def add(command: Any) -> Any:
        for option in reversed(options):
            command = option(command)
            _HEADINGS[command.__click_params__[-1]] = words
        return command

    return add


def headings(command: click.Command, ctx: click.Context) -> dict[str, list[click.Parameter]]:
    """List the options of a command under their headings, in its order, those for reading last."""
    groups: dict[str, list[click.Parameter]] = {"Options": []}
    for option in command.get_params(ctx):
        if isinstance(option, click.Option) and not option.hidden:
            groups.setdefault(_HEADINGS.get(option, "Options"), []).append(option)
    reading = groups.pop(READING, [])
    return {words: options for words, options in {**groups, READING: reading}.items() if options}


class GroupedCommand(click.Command):
    """A command whose help has headings. Options for reading are named; `explains_reading` says what they do."""

    def __init__(self, *arguments: Any, explains_reading: bool = False, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.explains_reading = explains_reading

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, heading by heading."""
        for words, options in headings(self, ctx).items():
            with formatter.section(words):
                if words == READING and not self.explains_reading:
                    names = ", ".join(option.opts[0] for option in options)
                    formatter.write_text(f"{names}: kineme inspect --help says what they do.")
                else:
                    formatter.write_dl([record for option in options if (record := option.get_help_record(ctx))])


class Finite(click.FloatRange):
    """A number in a range, neither NaN nor infinite."""

    def _describe_range(self) -> str:
        return "" if self.min is None and self.max is None else super()._describe_range()

    def convert(self, value: Any, param: Any, ctx: Any) -> float:
        """Text as a number."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"expected a number, got {value!r}", param, ctx)
        return number


class Parsed(click.ParamType):  # type: ignore[type-arg]
    """A text that a function reads; its ValueError says what it expected."""

    def __init__(self, name: str, parse: Callable[[str], Any]) -> None:
        self.name, self.parse = name, parse

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """The text as the function reads it; anything else as it is."""
        try:
            return self.parse(value) if isinstance(value, str) else value
        except ValueError as error:
            self.fail(str(error), param, ctx)


def _numbers(text: str) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        raise ValueError(f"expected numbers separated by commas, as 0.4,0.2, got {text!r}") from None
    if not all(map(math.isfinite, numbers)):
        raise ValueError(f"expected finite numbers, got {text!r}")
    return numbers


#: Numbers separated by commas: one per dimension.
NUMBERS = Parsed("x,y,...", _numbers)


class SymbolName(click.ParamType):  # type: ignore[type-arg]
    """Name or id of a symbol; the shell completes it from the library named on the same line.

    Bash inserts completions without quoting: for a name that would need quotes, the id is offered.
    """

    name = "symbol"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Names and ids that begin with the typed text; none without a library, and never an error."""
        from kineme.errors import KinemeError

        if folder := ctx.params.get("folder") or ctx.lookup_default("folder"):
            with suppress(KinemeError, OSError), opened(folder) as library:
                names = (symbol.name if _PLAIN.fullmatch(symbol.name) else symbol.id for symbol in library.symbols())
                return [CompletionItem(name) for name in names if name.startswith(incomplete)]
        return []


#: A file that is written, and a folder.
FILE, FOLDER = click.Path(dir_okay=False, path_type=Path), click.Path(file_okay=False, path_type=Path)


class LibraryLocation(click.Path):
    """The folder of a library, or its address on a server, postgresql://user@host/database?schema=name."""

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """The path of a folder, or an address, which is text without its password."""
        if not isinstance(value, str) or "://" not in value:
            return super().convert(value, param, ctx)
        from kineme.library.storage.address import as_location

        return as_location(value)


def opened(folder: Any, **options: Any) -> Any:
    """Open the library in a folder; options are those of `ActionLibrary`, by default it is only read."""
    from kineme.library.library import ActionLibrary

    return ActionLibrary(folder, **(options or {"read_only": True}))


def library_option_of(*, required: bool, words: str) -> Callable[[Any], Any]:
    """The option ``--library``, also from the environment."""
    return click.option(
        "--library", "-l", "folder", required=required, envvar="KINEME_LIBRARY", is_eager=True, show_envvar=True,
        type=LibraryLocation(file_okay=False, path_type=Path), help=words,
    )  # fmt: skip


library_option = library_option_of(
    required=True, words="Folder of the action library, or its address, postgresql://user@host/database."
)
force_option = under(
    "Output", click.option("--force", is_flag=True, help="Write over files that are there; never over the input.")
)
json_option = under("Output", click.option("--json", "as_json", is_flag=True, help="Answer in JSON."))
plot_option = under("Output", click.option("--plot", type=FILE, help="A drawing of it: a .png, .svg or .pdf file."))

#: Meaning of the option ``--rerun``.
RERUN = "An .rrd file for the viewer of Rerun: paths, curves, and symbols over time."
rerun_option = under("Output", click.option("--rerun", type=FILE, help=RERUN))


def error_rate_option(words: str) -> Callable[[Any], Any]:
    """The option ``--error-rate``, with what it says of itself."""
    share = Finite(0, 1, min_open=True, max_open=True)
    return click.option("--error-rate", type=share, default=0.05, show_default=True, help=words)


def source_options(command: Any) -> Any:
    """Add the argument SOURCE, a symbol or a file, with what says which one is meant."""
    index = click.option("--index", type=whole(0), help="Number of the movement in a file with several, from 0.")
    words = "Folder of the action library that SOURCE is a symbol of."
    source = click.argument("source", type=SymbolName())
    return source(library_option_of(required=False, words=words)(index(command)))


class SpecificationOption(click.Option):
    """The option ``--n-basis`` and so on: a field of `kineme.DMP`, whose default it reads when it is asked for."""

    def get_default(self, ctx: click.Context, call: bool = True) -> Any:
        """The default of the field."""
        from dataclasses import fields

        from kineme.dmp.discrete.dmp import DMP

        return next(field.default for field in fields(DMP) if field.name == self.name)


#: Fields of `kineme.DMP` that are options, with their types and what the help says of them.
SPECIFICATION: dict[str, tuple[type, str]] = {
    "formulation": (str, "Formulation"),
    "fit": (str, "What is fitted, trajectory or forcing,"),
    "n_basis": (int, "Number of basis functions"),
}


#: Add an option for each field of `SPECIFICATION`.
specification_options = under(
    "Movement",
    *(
        click.option(
            flag_of(name), type=kind, cls=SpecificationOption, show_default=True, help=f"{words} for a recording."
        )
        for name, (kind, words) in SPECIFICATION.items()
    ),
)
