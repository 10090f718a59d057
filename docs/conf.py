"""How Sphinx builds the site: ``make docs``."""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import kineme

if TYPE_CHECKING:
    from sphinx.application import Sphinx

DOCS = Path(__file__).parent
sys.path.append(str(DOCS))  # for `site`, the extensions of these pages

project = "kineme"
author = "The kineme developers"
project_copyright = f"2026, {author}"
version = release = kineme.__version__

extensions = [
    "myst_parser",
    "sphinx_design",
    "sphinx_copybutton",
    "sphinx.ext.mathjax",
]
source_suffix = {".md": "markdown"}
exclude_patterns = ["site", "**/README.md"]
nitpicky = True
highlight_language = "text"
pygments_style, pygments_dark_style = "friendly", "monokai"

myst_enable_extensions = ["attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_dmath_allow_digits = myst_dmath_allow_space = False
myst_heading_anchors = 4

copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
copybutton_only_copy_prompt_lines = True

html_theme = "pydata_sphinx_theme"
html_title = "kineme"
html_static_path = ["site/static"]
html_css_files = ["kineme.css"]
html_favicon = html_logo = "site/static/kineme.svg"
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "logo": {"text": "kineme", "alt_text": "kineme"},
    "header_links_before_dropdown": 6,
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "navigation_with_keys": False,
    "show_nav_level": 1,
    "show_toc_level": 2,
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "friendly",
    "pygments_dark_style": "monokai",
    "search_as_you_type": True,
}
html_sidebars = {"index": []}
mathjax_path = "mathjax/tex-chtml.js"


def _copy_mathjax(app: Sphinx, error: Exception | None) -> None:
    """The one script and the fonts that pages need, of the package that brings all of MathJax."""
    from importlib.util import find_spec
    from shutil import copytree

    found = find_spec("sphinx-mathjax-offline")
    if error or found is None or found.origin is None:
        return
    source = Path(found.origin).parent / "static" / "mathjax"
    target = Path(app.outdir) / "_static" / "mathjax"
    (target / "output").mkdir(parents=True, exist_ok=True)
    (target / "tex-chtml.js").write_bytes((source / "tex-chtml.js").read_bytes())
    fonts = Path("output", "chtml", "fonts", "woff-v2")
    copytree(source / fonts, target / fonts, dirs_exist_ok=True)


def setup(app: Sphinx) -> None:
    """Add what this site has beside the extensions."""
    app.connect("build-finished", _copy_mathjax)
    reader = logging.getLogger("sphinx.sphinx.directives.other")
    reader.addFilter(lambda record: "glob pattern" not in str(record.msg))  # a folder may wait for its pages
