"""What earlier builds wrote and no source stands for any more: pages that were deleted, scripts that were renamed."""

from __future__ import annotations

from pathlib import Path
from shutil import rmtree
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection

    from sphinx.application import Sphinx
    from sphinx.environment import BuildEnvironment

_OWN = ("images", "backreferences")  # folders of the gallery that no folder of scripts stands for


def remove_scripts(app: Sphinx) -> None:
    """Remove what the gallery made of scripts that are gone; Sphinx would read it as pages that nothing lists."""
    gallery, scripts = Path(app.srcdir) / "gallery", Path(app.srcdir).parent / "examples"
    for folder in gallery.glob("*/"):
        if folder.name not in _OWN and not (scripts / folder.name).is_dir():
            rmtree(folder)
    for made in gallery.glob("*/plot_*"):
        if not (scripts / made.parent.name / f"{made.name.partition('.')[0]}.py").exists():
            made.unlink()


def outdated(
    app: Sphinx, env: BuildEnvironment, added: Collection[str], changed: Collection[str], removed: Collection[str]
) -> list[str]:
    """All pages, if one has come or gone: each lists the others at its side."""
    return list(env.found_docs) if added or removed else []


def remove_pages(app: Sphinx, error: Exception | None) -> None:
    """Remove pages that are not of this build, to which links would still lead."""
    if error is None and app.builder.format == "html":
        folder = Path(app.outdir)
        ours = {folder / app.builder.get_target_uri(page) for page in app.env.found_docs} | {folder / "search.html"}
        for path in set(folder.rglob("*.html")) - ours:
            if not path.relative_to(folder).parts[0].startswith("_"):
                path.unlink()
