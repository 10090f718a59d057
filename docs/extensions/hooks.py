"""What autodoc is told: how docstrings are read, and which members are shown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from extensions.docstrings import to_rest

if TYPE_CHECKING:
    from sphinx.application import Sphinx


def read_docstring(app: Sphinx, what: str, name: str, value: object, options: Any, lines: list[str]) -> None:
    """Turn the lines of a docstring into reStructuredText, in place; napoleon reads its sections afterwards."""
    lines[:] = [*to_rest("\n".join(lines).rstrip()).split("\n"), ""]


def skip_member(app: Sphinx, what: str, name: str, value: object, skip: bool, options: Any) -> bool | None:
    """Leave out what a class has from elsewhere, as from scikit-learn and tuples."""
    function = getattr(value, "fget", None) or getattr(value, "__func__", None) or value
    function = getattr(function, "__wrapped__", function)
    home = getattr(function, "__module__", None)
    return None if home is not None and home.startswith("kineme") else True
