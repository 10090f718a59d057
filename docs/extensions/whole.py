"""What is checked of the finished site: it loads nothing from elsewhere, and what it loads and links to is there."""

from __future__ import annotations

import os
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

_TAG = re.compile(r"<(\w+)\b((?:\"[^\"]*\"|'[^']*'|[^>\"']++)*+)>")
_ADDRESS = re.compile(r"(?<![\w-])(src|href|srcset|poster|data)\s*=\s*(\"[^\"]*\"|'[^']*'|[^\s\"'>]+)")
_STYLE = re.compile(r"(?:url\(\s*|@import\s+)['\"]?([^'\")\s;]+)")
_STYLED = re.compile(r"<style\b[^>]*>(.*?)</style>|\sstyle=(\"[^\"]*\"|'[^']*')", re.DOTALL)
_SCRIPT = re.compile(r"(<script\b[^>]*>).*?</script>", re.DOTALL)
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
    """What a page or a style sheet loads from elsewhere, and what of the site it loads or links to and is not there."""
    for path in folder.rglob("*.css"):
        yield from _loaded_by_style(path.read_text(encoding="utf-8"), str(path.relative_to(folder)))
    pages = (path for path in folder.rglob("*.html") if path.parent != folder / "_static")  # templates of the theme
    for path in pages:
        text, name = path.read_text(encoding="utf-8"), str(path.relative_to(folder))
        for block, attribute in _STYLED.findall(text):
            yield from _loaded_by_style(block or unescape(attribute), name)
        for tag, attributes in _TAG.findall(_SCRIPT.sub(r"\1", text)):
            verb = "links to" if tag == "a" else "loads"
            for kind, address in _ADDRESS.findall(attributes):
                for where in _addresses(kind, unescape(address.strip("\"'"))):
                    if _ELSEWHERE.match(where):
                        wrong = tag != "a" and not where.startswith("data:")
                    else:
                        wrong = not _leads_somewhere(path, where)
                    if wrong:
                        yield f"{name} {verb} {where}"


def _loaded_by_style(style: str, name: str) -> Iterator[str]:
    for address in _STYLE.findall(style):
        if _ELSEWHERE.match(address) and not address.startswith("data:"):
            yield f"{name} loads {address}"


def _addresses(kind: str, address: str) -> list[str]:
    """One address, or those of pictures of several sizes."""
    return [one.split()[0] for one in address.split(",") if one.strip()] if kind == "srcset" else [address]


def _leads_somewhere(page: Path, where: str) -> bool:
    name, _, place = where.partition("#")
    target = os.path.normpath(f"{page.parent}/{unquote(name.partition('?')[0])}" if name else page)
    if not target.endswith(".html") or not place:
        return _is_there(target)
    return unquote(place) in _places(target)


@cache  # every page links to most others
def _is_there(path: str) -> bool:
    return Path(path).exists()


@cache
def _places(page: str) -> frozenset[str]:
    return frozenset(_ID.findall(Path(page).read_text(encoding="utf-8"))) if _is_there(page) else frozenset()
