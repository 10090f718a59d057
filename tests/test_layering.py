"""Imports go only downwards, in the order in which CONTRIBUTING.md lists the layers."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "kineme"
FRONT_DOOR = ("__init__", "__main__")  # they may import everything


def _layers():
    """Layer -> its line in the list, from the bottom up."""
    listed = (ROOT / "CONTRIBUTING.md").read_text().partition("    src/kineme/\n")[2].partition("\n\n")[0]
    rows = [re.split(r"\s{2,}", line.strip())[0].replace("/", "").split(", ") for line in listed.splitlines()]
    return {name: height for height, row in enumerate(rows) for name in row}


def _imported(path):
    """Modules of kineme that a file imports, at the top or inside functions."""
    for node in ast.walk(ast.parse(path.read_text())):
        names = [alias.name for alias in node.names] if isinstance(node, (ast.Import, ast.ImportFrom)) else []
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name}: import with the full name"
            names = [f"{node.module}.{name}" for name in names]
        yield from (name.split(".") for name in names if name.startswith("kineme."))


def _modules():
    return [path for path in sorted(PACKAGE.rglob("*.py")) if path.stem not in FRONT_DOOR or path.parent != PACKAGE]


def _layer_of(path):
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


@pytest.mark.parametrize("path", _modules(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_module_imports_from_its_own_layer_and_from_those_below(path):
    layers, own = _layers(), _layer_of(path)
    assert own in layers, f"list the layer {own!r} in CONTRIBUTING.md"
    for _, layer, *_ in _imported(path):
        assert layers[layer] <= layers[own], f"{own} is below {layer}"


def test_kernels_know_nothing_of_movements():
    imported = {layer for path in (PACKAGE / "kernels").glob("*.py") for _, layer, *_ in _imported(path)}
    assert imported <= {"kernels", "compiled", "parallel", "validation", "errors"}


def test_compiled_code_is_imported_inside_functions_only():
    """At the top of a module it would cost every user the half second that Numba takes to load."""
    for path in _modules():
        top = [node for node in ast.parse(path.read_text()).body if isinstance(node, (ast.Import, ast.ImportFrom))]
        names = {getattr(node, "module", None) or "" for node in top} | {a.name for node in top for a in node.names}
        if path.name != "_compiled.py":
            assert not any(name.startswith("numba") or name.split(".")[-1] == "_compiled" for name in names), path
