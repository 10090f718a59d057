"""The script that typesets formulas comes with the site: the one file and the fonts that pages need."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from shutil import copytree
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

SCRIPT = "mathjax/tex-chtml.js"
_FONTS = Path("output", "chtml", "fonts", "woff-v2")


def copy_mathjax(app: Sphinx, error: Exception | None) -> None:
    """Copy both from the package that brings all of MathJax."""
    found = find_spec("sphinx-mathjax-offline")
    if error or found is None or found.origin is None:
        return
    source = Path(found.origin).parent / "static" / "mathjax"
    target = Path(app.outdir) / "_static" / "mathjax"
    copytree(source / _FONTS, target / _FONTS, dirs_exist_ok=True)
    (target / "tex-chtml.js").write_bytes((source / "tex-chtml.js").read_bytes())
