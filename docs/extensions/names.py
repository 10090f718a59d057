"""A page for every public name, and one for each group of them, in ``reference/generated/``."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from itertools import groupby
from types import ModuleType

from extensions.docstrings import to_rest
from extensions.public import MODULES, NAMES, Public, first_sentence


def pages() -> Iterator[tuple[str, str]]:
    """File name and text of each page, in reStructuredText."""
    for one in NAMES:
        if not isinstance(one.value, ModuleType):
            yield f"{one.path}.rst", _page(one)
    for file, title, names in _groups():
        yield f"{file}.rst", _group(title, names)
    links = [f"* :doc:`{file}`: {_links(names)}" for file, _, names in _groups()]
    yield "index.rst", "\n".join(["Python", "======", "", *links, "", _toctree([one[0] for one in _groups()])])


def _groups() -> Iterator[tuple[str, str, list[Public]]]:
    """Groups of kineme itself, each followed by the modules that it names."""
    modules = {module.__name__: module for module in MODULES}
    for title, found in groupby(NAMES, lambda one: (one.module, one.group)):
        names = list(found)
        if title[0] != "kineme":
            continue
        yield _file(title[1]), title[1], names
        for one in names:
            if one.path in modules:
                yield one.path, one.path, [name for name in NAMES if name.module == one.path]


def _links(names: list[Public]) -> str:
    return ", ".join(
        f"``{one.name}``" if isinstance(one.value, ModuleType) else f":doc:`{one.name} <{one.path}>`" for one in names
    )


def _file(title: str) -> str:
    return title.lower().replace(",", "").replace(" ", "-")


def _page(one: Public) -> str:
    head = f"{one.name}\n{'=' * len(one.name)}\n\n.. currentmodule:: {one.module}\n\n"
    value = one.value
    gallery = f".. minigallery:: {one.path}\n   :add-heading: In the gallery\n   :heading-level: -\n"
    foot = f"\nDefined in ``{one.home}``.\n\n{gallery}"
    if isinstance(value, type):
        return f"{head}.. autoclass:: {one.name}\n   :members:\n   :inherited-members:\n{foot}"
    if inspect.isroutine(value):
        return f"{head}.. autofunction:: {one.name}\n{foot}"
    shown = repr(value)
    more = f"   :value: {shown}\n" if len(shown) < 200 and "object at" not in shown else ""
    return f"{head}.. py:data:: {one.name}\n{more}\n   {to_rest(one.text)}\n{foot}"


def _group(title: str, names: list[Public]) -> str:
    lines = [title, "=" * len(title), ""]
    if title.startswith("kineme."):
        lines += [f".. py:module:: {title}", "", to_rest(inspect.getdoc(_module(title)) or ""), ""]
    for group, found in groupby(names, lambda one: one.group):
        rows = list(found)
        if len({one.group for one in names}) > 1:
            lines += [group, "-" * len(group), ""]
        lines += [".. list-table::", "   :widths: 30 70", "   :class: names", ""]
        for one in rows:
            target = f":doc:`{one.name} <{one.path}>`"
            lines += [f"   * - {target}", f"     - {to_rest(first_sentence(one.text))}"]
        lines.append("")
    return "\n".join([*lines, _toctree([one.path for one in names if not isinstance(one.value, ModuleType)])])


def _module(name: str) -> ModuleType:
    return next(module for module in MODULES if module.__name__ == name)


def _toctree(files: list[str]) -> str:
    return "\n".join([".. toctree::", "   :hidden:", "", *(f"   {file}" for file in files), ""])
