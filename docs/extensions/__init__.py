"""What the site has beside the extensions of others."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING

import make_interactive

from extensions import (
    commands,
    entries,
    equations,
    formats,
    hooks,
    leftovers,
    links,
    mathjax,
    messages,
    names,
    readers,
    routes,
    whole,
)

if TYPE_CHECKING:
    from sphinx.application import Sphinx

_PAGES = (names.pages, commands.pages, formats.pages, messages.pages, routes.pages)


def _write_pages(app: Sphinx) -> None:
    """Write what is made from the code; a page that says the same is left alone, so that it is not read again."""
    folder = Path(app.srcdir) / "reference" / "generated"
    folder.mkdir(parents=True, exist_ok=True)
    written = {file: text for pages in _PAGES for file, text in pages()}
    for path in folder.iterdir():
        if path.name not in written:
            path.unlink()
    for file, text in written.items():
        path = folder / file
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
    make_interactive.write()


def _add_pages_to_draw_in(app: Sphinx, error: Exception | None) -> None:
    """Add the pages that the first page of the site shows."""
    if error is None and app.builder.format == "html":
        for file, text in make_interactive.pages_to_draw_in().items():
            (Path(app.outdir) / "_static" / file).write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect what stands in this folder."""
    app.connect("builder-inited", leftovers.remove_scripts, priority=100)  # before the gallery is made
    app.connect("builder-inited", _write_pages)
    app.connect("autodoc-process-docstring", hooks.read_docstring, priority=100)
    app.connect("autodoc-skip-member", hooks.skip_member)
    app.connect("doctree-read", entries.place_messages)
    app.connect("html-collect-pages", entries.add_messages)
    app.connect("env-get-outdated", leftovers.outdated)
    app.connect("env-purge-doc", entries.forget)
    app.connect("env-updated", entries.keep)
    app.connect("html-page-context", readers.mend_page, priority=900)
    app.connect("build-finished", mathjax.copy_mathjax)
    app.connect("build-finished", _add_pages_to_draw_in)
    app.connect("build-finished", leftovers.remove_pages, priority=800)
    app.connect("build-finished", whole.check_site, priority=900)
    app.add_directive("cited-in", equations.CitedIn)
    app.add_post_transform(links.NamesInDocstrings)
    app.add_post_transform(links.NamesInText)
    reader = logging.getLogger("sphinx.sphinx.directives.other")
    reader.addFilter(lambda record: "glob pattern" not in str(record.msg))  # a folder may wait for its pages
    return {"parallel_read_safe": True, "parallel_write_safe": True}
