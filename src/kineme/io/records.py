"""Records of problems with a file, and of what a recording holds besides its movements."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from shlex import quote
from typing import NamedTuple

from kineme.errors import DataError, KinemeError
from kineme.reporting.text import first_names

_SHOWN = 20  # columns that a sentence names

UNKNOWN = "unknown"  # the label of unknown motion, in files that have but one text for each stretch
NO_SYMBOLS = frozenset({"", "-", "?", UNKNOWN})  # what people write over the name of a symbol where there is none


class Problem(NamedTuple):
    """Something that could not be read."""

    file: str
    line: int | None  # counted from 1; None if the file has no lines
    reason: str
    error: type[KinemeError] = DataError  # what is raised if only this file is read
    samples: int = 0  # left out of a movement that was read; 0 if the movement or the file was not
    missing: tuple[str, ...] = ()  # columns without values, whatever begins so; without them it could be read

    @property
    def what(self) -> str:
        """Line and reason, without the file."""
        return f"line {self.line}: {self.reason}" if self.line else self.reason

    def __str__(self) -> str:
        return f"{self.file}{', ' if self.line else ': '}{self.what}"


def note_on_missing(problems: Sequence[Problem]) -> list[str]:
    """Say which columns keep several movements from being read, if there are such, and how to leave them out."""
    lacking = [problem for problem in problems if problem.missing]
    if len(lacking) < 2:
        return []
    counts = Counter(name for problem in lacking for name in problem.missing)
    names = [name for name, _ in counts.most_common()]
    shown = first_names([f"{name} in {counts[name]}" for name in names], _SHOWN)
    return [
        f"{len(lacking)} movements were not read, since columns have no values for too long: {shown}; leave them "
        f"out with --exclude {in_shell(names)}, say --columns, or fill longer gaps with --fill-gaps"
    ]


def in_shell(names: Sequence[str]) -> str:
    """Write columns as one argument of an option, quoted where a shell needs it."""
    return quote(",".join(f'"{name}"' if "," in name else name for name in names))


class Contents(NamedTuple):
    """A list of things in a recording, as a table."""

    name: str  # what they are: ``"topics"``
    heads: tuple[str, ...]
    rows: tuple[tuple[str | int, ...], ...]
    note: str = ""  # what should be known about the list


@contextmanager
def damaged_as(said: str, *errors: type[Exception], remedy: str = "") -> Iterator[None]:
    """Raise what a package raises on damaged bytes as a `DataError` that begins so, and ends with the remedy."""
    try:
        yield
    except KinemeError:
        raise
    except errors as error:
        raise DataError(f"{said} ({error}){remedy}") from error


@contextmanager
def needs(package: str, purpose: str, extra: str) -> Iterator[None]:
    """Raise a `DataError` that names the extra to install, where an import of a package fails."""
    try:
        yield
    except ImportError as error:
        raise DataError(f"expected the package {package} to {purpose}; pip install 'kineme[{extra}]'") from error
