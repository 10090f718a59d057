"""Public names: where each is found, and in which group of which module."""

from __future__ import annotations

import inspect
import re
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import kineme
from kineme._lazy import names_in


class Public(NamedTuple):
    """A public name: as ``kineme.kernels`` and ``RBF``, where it is defined, and the heading that it stands under."""

    module: str
    name: str
    home: str
    group: str

    @property
    def value(self) -> object:
        """What it names."""
        return getattr(import_module(self.module), self.name)

    @property
    def path(self) -> str:
        """As ``kineme.kernels.RBF``."""
        return f"{self.module}.{self.name}"

    @property
    def text(self) -> str:
        """Its docstring, or of a constant the comment ``#:`` above it."""
        if inspect.isroutine(self.value) or isinstance(self.value, (type, ModuleType)):
            return inspect.getdoc(self.value) or ""
        lines = inspect.getsource(import_module(self.home)).splitlines()
        at = next((k for k, line in enumerate(lines) if re.match(rf"{self.name}\b\s*[:=]", line)), 0)
        above = []
        while at > 0 and lines[at - 1].startswith("#:"):
            at -= 1
            above.insert(0, lines[at].removeprefix("#:").strip())
        return " ".join(above)


def _listed(module: ModuleType) -> list[Public]:
    stub = Path(str(module.__file__)).with_suffix(".pyi")
    if not stub.exists():
        return [Public(module.__name__, name, module.__name__, "Classes") for name in module.__all__]
    return [
        Public(module.__name__, name, home, title)
        for title, lines in re.findall(r"^# ([^\n]+)\n((?:from .*\n)+)", stub.read_text(encoding="utf-8"), re.MULTILINE)
        for name, (home, _) in names_in(lines).items()
    ]


#: Modules with public names: kineme itself, then in the order of the flow.
MODULES = [kineme, *(one for name in kineme.__all__ if isinstance(one := getattr(kineme, name), ModuleType))]
NAMES = [one for module in MODULES for one in _listed(module)]
#: Names that stand for one thing alone, as users write them: ``RBF``, ``kernels.RBF``, ``kineme.kernels.RBF``.
PUBLIC: dict[str, str] = {}
for _one in NAMES:
    _last = _one.module.rpartition(".")[2]
    for _written in (_one.name, f"{_last}.{_one.name}", _one.path, f"{_one.home}.{_one.name}"):
        PUBLIC.setdefault(_written, _one.path)


def first_sentence(text: str) -> str:
    """The first sentence of a docstring, on one line."""
    paragraph = " ".join(text.strip().partition("\n\n")[0].split())
    return re.split(r"(?<=[.!?]) (?=[A-Z])", paragraph)[0]
