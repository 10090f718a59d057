"""How Sphinx builds the site: ``make docs``."""

from __future__ import annotations

import sys
from pathlib import Path

import kineme

DOCS = Path(__file__).parent
sys.path.append(str(DOCS))  # for `extensions` and `gallery_style`

project = "kineme"
author = "The kineme developers"
project_copyright = f"2026, {author}"
version = release = kineme.__version__

extensions = [
    "myst_parser",
    "sphinx_design",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.mathjax",
    "extensions",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["extensions", "templates", "**/README.md"]
default_role = "literal"  # between single backticks in docstrings
nitpicky = True
highlight_language = "text"
suppress_warnings = ["sphinx_gallery.space_in_filename"]  # in the path of the checkout; the scripts have none
smartquotes = False  # options begin with two hyphens, and quotes are as they are written

myst_enable_extensions = ["attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_dmath_allow_digits = myst_dmath_allow_space = False
myst_heading_anchors = 4

copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
copybutton_only_copy_prompt_lines = True

autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
python_maximum_signature_line_length = 88
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

#: Chapters in the order of the flow; others come behind them.
_CHAPTERS = (
    "movements", "recognition", "primitives", "modulation", "adapting", "control", "rhythm_and_poses", "kernels",
    "anchoring", "robots",
)  # fmt: skip
sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": "/plot_",
    "subsection_order": [f"../examples/{chapter}" for chapter in _CHAPTERS] + ["*"],
    "backreferences_dir": "gallery/backreferences",
    "doc_module": ("kineme",),
    "download_all_examples": False,
    "notebook_extensions": set(),
    "show_signature": False,
    "write_computation_times": False,
    "min_reported_time": 1,
    "capture_repr": (),
    "image_scrapers": ("gallery_style.scrape",),
    "reset_modules": ("gallery_style.reset",),
    "thumbnail_size": (480, 240),
    "within_subsection_order": "FileNameSortKey",
}

html_theme = "pydata_sphinx_theme"
html_title = "kineme"
html_static_path = ["static"]
templates_path = ["templates"]
html_search_scorer = str(DOCS / "extensions" / "search.js")
html_show_search_summary = False  # it would be fetched, which a browser refuses for files
html_use_index = html_domain_indices = False  # the search reads the entries
html_css_files = ["kineme.css", "gallery.css"]
html_favicon = html_logo = "static/kineme.svg"
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "logo": {"text": "kineme"},
    "header_links_before_dropdown": 7,
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "navigation_with_keys": False,
    "show_nav_level": 1,
    "show_toc_level": 2,
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "github-dark-high-contrast",
    "search_as_you_type": True,
}
html_sidebars = {"index": [], "beside-others": []}
mathjax_path = "mathjax/tex-chtml.js"
