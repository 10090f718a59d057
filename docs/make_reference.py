"""Write reference/names.md, the public names of kineme, from the stubs that list them: ``make reference``."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import kineme
from kineme._lazy import names_in

PAGE = Path(__file__).with_name("reference") / "names.md"
MODULES = [kineme, *(one for name in kineme.__all__ if isinstance(one := getattr(kineme, name), ModuleType))]

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
    yield f"## {module.__name__}\n\n{_first_sentence(module.__doc__ or '')}\n"
    stub = Path(str(module.__file__)).with_suffix(".pyi").read_text(encoding="utf-8")
    for title, lines in re.findall(r"^# ([^\n]+)\n((?:from .*\n)+)", stub, re.MULTILINE):
        yield f"**{title}**\n\n| name | what it is | defined in |\n|---|---|---|"
        yield from (_row(public, home, there) for public, (home, there) in names_in(lines).items())
        yield ""


def _row(public: str, home: str, there: str) -> str:
    if isinstance(value := getattr(import_module(home), there), ModuleType):
        return (
            f"| [`{public}`](#{f'{home}.{there}'.replace('.', '')}) | {_first_sentence(value.__doc__ or '')} | below |"
        )
    documented = inspect.isroutine(value) or isinstance(value, type)
    text = inspect.getdoc(value) if documented else _comment_above(home, there)
    return f"| `{public}` | {_first_sentence(text or '').replace('|', chr(92) + '|')} | `{home}` |"


def _comment_above(home: str, name: str) -> str:
    """What the comment ``#:`` above a constant says."""
    found = re.search(rf"((?:^#: .*\n)+){name}\b", inspect.getsource(import_module(home)), re.MULTILINE)
    return " ".join(line.removeprefix("#: ") for line in found[1].splitlines()) if found else ""


def _first_sentence(text: str) -> str:
    paragraph = " ".join(text.strip().partition("\n\n")[0].split())
    return re.split(r"(?<=[.!?]) (?=[A-Z])", paragraph)[0]


if __name__ == "__main__":
    PAGE.write_text(reference(), encoding="utf-8")
    print(f"{PAGE}: {sum(len(module.__all__) for module in MODULES)} names")
