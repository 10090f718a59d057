"""Write reference/names.md, the public names of kineme, from the stubs that list them: ``make reference``."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from types import ModuleType

from extensions.public import MODULES, NAMES, Public, first_sentence

PAGE = Path(__file__).with_name("reference") / "names.md"

_HEAD = """# All names

Every public name, in the order in which movements flow through kineme: recordings, primitives, features, recognition,
symbols. Written by `make reference` from the stubs that kineme loads its names from. Docstrings state formula, shapes,
units and errors: `help(kineme.DMP)`.
"""


def reference() -> str:
    """The page."""
    return "\n".join([_HEAD, *(line for module in MODULES for line in _section(module))])


def _section(module: ModuleType) -> Iterator[str]:
    """A module: what it is for, and a table for each of its groups of names."""
    yield f"## {module.__name__}\n\n{first_sentence(module.__doc__ or '')}\n"
    names = [one for one in NAMES if one.module == module.__name__]
    for group, found in groupby(names, lambda one: one.group):
        yield f"**{group}**\n\n| name | what it is | defined in |\n|---|---|---|"
        yield from map(_row, found)
        yield ""


def _row(one: Public) -> str:
    said = first_sentence(one.text).replace("|", r"\|")
    if isinstance(one.value, ModuleType):
        return f"| [`{one.name}`](#{one.value.__name__.replace('.', '')}) | {said} | below |"
    return f"| `{one.name}` | {said} | `{one.home}` |"


if __name__ == "__main__":
    PAGE.write_text(reference(), encoding="utf-8")
    print(f"{PAGE}: {sum(len(module.__all__) for module in MODULES)} names")
