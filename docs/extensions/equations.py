"""Equations of the paper: where in the code each of them is."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

import kineme
from extensions.public import NAMES

_CITED = re.compile(r"Eqs?\. ((?:\(\d\)(?:, | and |-)?)+)")
_OTHERS = re.compile(r"\b(?:19|20)\d\d\b|source|et al")  # a sentence about another paper
_ROOT = Path(kineme.__file__).parent


class CitedIn(SphinxDirective):
    """``{cited-in} 4``: the names whose docstrings cite an equation of the paper."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The names, as code in one paragraph; those that are public become links later."""
        names = places()[int(self.arguments[0])]
        listed = [part for name in names for part in (nodes.literal(name, name), nodes.Text(", "))]
        return [nodes.paragraph("", "", nodes.strong("", "In the code: "), *listed[:-1])]


@cache
def places() -> dict[int, list[str]]:
    """Number of an equation -> names whose docstrings cite it, public ones as they are imported."""
    public = {f"{one.home}.{one.name}": one.path for one in NAMES}
    found: dict[int, list[str]] = {}
    for path in sorted(_ROOT.rglob("*.py")):
        inside = path.relative_to(_ROOT)
        module = ".".join(["kineme", *inside.with_suffix("").parts]).removesuffix(".__init__")
        for name, text in _docstrings(ast.parse(path.read_text(encoding="utf-8")), module):
            owner, _, member = name.rpartition(".")
            shown = public.get(name) or (f"{public[owner]}.{member}" if owner in public else name)
            if any(part.startswith("_") for part in name.split(".")):
                continue
            for number in _cited(text):
                if shown not in found.setdefault(number, []):
                    found[number].append(shown)
    return found


def _cited(text: str) -> set[int]:
    sentences = re.split(r"(?<=[.:])\s+(?=[A-Z])|\n\n", text)
    own = [sentence for sentence in sentences if not _OTHERS.search(sentence)]
    return {int(number) for one in own for cited in _CITED.findall(one) for number in re.findall(r"\d", cited)}


def _docstrings(tree: ast.AST, path: str) -> Iterator[tuple[str, str]]:
    """Names of a module, its classes and functions, and their docstrings."""
    if isinstance(tree, (ast.Module, ast.ClassDef, ast.FunctionDef)):
        yield path, ast.get_docstring(tree) or ""
        for node in tree.body:
            if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
                yield from _docstrings(node, f"{path}.{node.name}")
