"""What is checked of the finished site: it loads nothing from elsewhere, and its links lead somewhere."""

from __future__ import annotations

import re
from functools import cache
from html import unescape
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote

from sphinx.errors import ExtensionError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from sphinx.application import Sphinx

_TAG = re.compile(r"<(\w+)\b([^>]*)>")
_ADDRESS = re.compile(r"\b(src|href|srcset|poster|data)=\"([^\"]*)\"")
_STYLE = re.compile(r"(?:url\(\s*|@import\s+)['\"]?([^'\")\s;]+)")
_ID = re.compile(r"\bid=\"([^\"]+)\"")
_ELSEWHERE = re.compile(r"[a-z][a-z0-9+.-]*:|//")
_MOST = 20  # lines of a message


def check_site(app: Sphinx, error: Exception | None) -> None:
    """Raise an error that lists what is wrong with the pages that were written."""
    if error is None and app.builder.format == "html":
        found = sorted(set(problems(Path(app.outdir))))
        if found:
            raise ExtensionError("\n".join([f"{len(found)} problems in the finished site:", *found[:_MOST]]))


def problems(folder: Path) -> Iterator[str]:
    """What a page or a style sheet loads from elsewhere, and links within the site that lead nowhere."""
    for path in folder.rglob("*.css"):
        for address in _STYLE.findall(path.read_text(encoding="utf-8")):
            if _ELSEWHERE.match(address) and not address.startswith("data:"):
                yield f"{path.relative_to(folder)} loads {address}"
    for path in folder.rglob("*.html"):
        text = path.read_text(encoding="utf-8")
        for tag, attributes in _TAG.findall(text):
            for kind, address in _ADDRESS.findall(attributes):
                where = unescape(address)
                if not _ELSEWHERE.match(where):
                    if tag == "a" and not _leads_somewhere(path, where):
                        yield f"{path.relative_to(folder)} links to {where}"
                elif tag != "a" and kind != "data" and not where.startswith("data:"):
                    yield f"{path.relative_to(folder)} loads {where}"


def _leads_somewhere(page: Path, where: str) -> bool:
    name, _, place = where.partition("#")
    target = (page.parent / unquote(name)).resolve() if name else page
    if target.suffix != ".html" or not place:
        return target.exists()
    return unquote(place) in _places(target)


@cache
def _places(page: Path) -> frozenset[str]:
    return frozenset(_ID.findall(page.read_text(encoding="utf-8"))) if page.exists() else frozenset()
