"""JavaScript modules as one script: a page that is one file cannot import."""

from __future__ import annotations

import re
from pathlib import Path

from kineme.errors import KinemeError

_IMPORT = re.compile(r'^import \{([^}]*)\} from "(\.[^"]+)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:async )?(?:function|const|class) (\w+))", re.MULTILINE)
_LEFT = re.compile(r"^(?:import|export)\b", re.MULTILINE)


def bundled(entry: Path) -> str:
    """The module and those that it imports, each in a function of its own, in the order in which they need each other.

    Understood are ``import { a, b } from "./file.js";`` and ``export`` before a function, class or constant.
    """
    done: dict[Path, str] = {}
    parts = ['"use strict";']
    _add(entry.resolve(), done, parts)
    return "\n".join(parts) + "\n"


def _add(path: Path, done: dict[Path, str], parts: list[str]) -> str:
    """Append a module, after those that it imports; its name."""
    if path in done:
        return done[path]
    done[path] = f"module{len(done)}"
    text = path.read_text(encoding="utf-8")
    needed = {source: _add((path.parent / source).resolve(), done, parts) for _, source in _IMPORT.findall(text)}
    names = _EXPORT.findall(text)
    body = _IMPORT.sub(lambda found: f"const {{{found[1]}}} = {needed[found[2]]};\n", _EXPORT.sub("", text))
    if _LEFT.search(body):
        raise KinemeError(f"expected only plain imports and exports in {path.name}")
    parts.append(f"// {path.name}\nconst {done[path]} = (() => {{\n{body}return {{ {', '.join(names)} }};\n}})();")
    return done[path]
