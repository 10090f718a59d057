"""A library as one HTML page that recognizes and moves, without server and network."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from kineme.errors import KinemeError, SpecificationError
from kineme.library.library import ActionLibrary
from kineme.reporting.atomic import whole_file
from kineme.reporting.page import filled
from kineme.reporting.text import counted, in_markup
from kineme.similarity.describe import N_POINTS
from kineme.studio.snapshot import DRAWN, Snapshot, snapshot_of_library

_IMPORT = re.compile(r'^import \{([^}]*)\} from "(\.[^"]+)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:async )?(?:function|const|class) (\w+))", re.MULTILINE)
_LEFT = re.compile(r"^(?:import|export)\b", re.MULTILINE)

FOLDER = Path(__file__).parent
_TOKENS = FOLDER.parent / "web" / "tokens.css"
_FROM_ABOVE = 0.8  # of the direction of the view: y is up where it is mostly along z


def library_page(library: ActionLibrary, title: str, most: int | None = None) -> tuple[str, Snapshot]:
    """Make the text of the page, and the snapshot that it holds: `most` movements, see `snapshot_of_library`."""
    if len(library):
        check_drawable(library.n_dims)
    snapshot = snapshot_of_library(library, most, DRAWN)
    return page_of(snapshot, title), snapshot


def check_drawable(n_dims: int | None) -> None:
    """Check that movements are in the plane or in space."""
    if n_dims not in (2, 3):
        raise SpecificationError(
            f"expected movements in the plane or in space, got {n_dims} dimensions, which cannot be drawn; learn two "
            "or three columns of the recordings, in the shell with --columns"
        )


def page_of(snapshot: Snapshot, title: str, frame: str = "") -> str:
    """Make the page of a snapshot, whose body is of the class `frame`, see `filled_page`."""
    snapshot.header["view"] = view_of(snapshot)
    parts = {
        "title": in_markup(title),
        "summary": in_markup(summary_of(snapshot)),
        "footer": in_markup("Recognized and generated in this page by kineme; nothing leaves it."),
        "snapshot": snapshot.to_json(),
        "frame": frame,
    }
    return filled_page("page.html", "face.js", parts)


def filled_page(template: str, script: str, parts: dict[str, str]) -> str:
    """Fill a template; the policy of the page allows its own script and style by hashes, no more."""
    styles = [_TOKENS, FOLDER / "page.css", *[FOLDER / "notebook.css"] * bool(parts["frame"])]
    style = "".join(part.read_text(encoding="utf-8") for part in styles)
    text = (FOLDER / template).read_text(encoding="utf-8")
    return filled(text, parts, style, {"script": bundled(FOLDER / script)})


def write_page(
    path: str | Path, library: ActionLibrary, title: str | None = None, most: int | None = None, *, replace: bool = True
) -> Snapshot:
    """Write the page of a library, see `library_page`; the title is by default the name of the library's folder."""
    text, snapshot = library_page(library, title or library.store.name, most)
    with whole_file(Path(path), replace=replace) as beside:
        beside.write_text(text, encoding="utf-8")
    return snapshot


def view_of(snapshot: Snapshot) -> list[float]:
    """Right, up and near on the screen: the plane in which the movements are largest is that of the screen, z is up."""
    d = snapshot.header["comparison"]["n_dims"]
    if d == 2:
        return [1.0, 0.0, 0.0, 1.0]
    paths = snapshot.arrays["paths"].reshape(-1, d, N_POINTS).astype(float)
    away = (paths - paths.mean(axis=2, keepdims=True)).transpose(0, 2, 1).reshape(-1, d)
    near = np.linalg.eigh(away.T @ away)[1][:, 0]
    axis = np.eye(3)[1] if abs(near[2]) > _FROM_ABOVE else np.eye(3)[2]
    up = axis - near * near[axis.argmax()]
    up /= np.linalg.norm(up)
    near = near if abs(near[2]) <= _FROM_ABOVE or near[2] > 0 else -near
    return np.concatenate((np.cross(up, near), up, near)).tolist()


def summary_of(snapshot: Snapshot) -> str:
    """Count the symbols and movements of a page, as in "4 symbols, 24 of 28 movements"."""
    held, n_all = snapshot.header["n_movements"], snapshot.header.get("n_all", snapshot.header["n_movements"])
    of_all = "" if held == n_all else f" of {n_all:,}"
    symbols = counted(len(snapshot.header["classes"]), "symbol")
    return f"{symbols}, {held:,}{of_all} {'movement' if n_all == 1 else 'movements'}"


def bundled(entry: Path) -> str:
    """The module and those it imports, each in a function; they import and export as `_IMPORT` and `_EXPORT` say."""
    done: dict[Path, str] = {}
    parts = ['"use strict";']
    _add(entry.resolve(), done, parts)
    return "\n".join(parts) + "\n"


def _add(path: Path, done: dict[Path, str], parts: list[str]) -> str:
    """Append a module, after those that it imports, and return its name."""
    if path in done:
        return done[path]
    done[path] = f"module{len(done)}"
    text = path.read_text(encoding="utf-8")
    needed = {source: _add((path.parent / source).resolve(), done, parts) for _, source in _IMPORT.findall(text)}
    names = _EXPORT.findall(text)
    body = _IMPORT.sub(lambda match: f"const {{{match[1]}}} = {needed[match[2]]};\n", _EXPORT.sub("", text))
    if _LEFT.search(body):
        raise KinemeError(f"expected only plain imports and exports in {path.name}")
    parts.append(f"// {path.name}\nconst {done[path]} = (() => {{\n{body}return {{ {', '.join(names)} }};\n}})();")
    return done[path]
