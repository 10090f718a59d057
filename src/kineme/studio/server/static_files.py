"""The files of the page, read once: nothing else of the disk can be asked for."""

from __future__ import annotations

from importlib.resources import files
from importlib.resources.abc import Traversable

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

_KINDS = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".json": "application/json",
    ".webmanifest": "application/manifest+json",
    ".txt": "text/plain; charset=utf-8",
}
#: Folders of the package whose files are served, and under which path.
_FOLDERS = {"": ("studio", "web"), "runtime/": ("studio", "javascript")}
#: Files of other rooms: what draws an arm.
_VENDORED = {
    "vendor/scene.min.js": ("robots", "view", "vendor", "scene.min.js"),
    "vendor/viewer.js": ("robots", "view", "page", "viewer.js"),
}


def static_routes() -> list[Route]:
    """One route for each file; ``/`` is the page."""
    package = files("kineme")
    found: dict[str, Traversable] = {}
    for path, folder in _FOLDERS.items():
        found |= _below(package.joinpath(*folder), path)
    found |= {path: package.joinpath(*where) for path, where in _VENDORED.items()}
    if "index.html" in found:
        found[""] = found["index.html"]
    return [_route(f"/{path}", file) for path, file in found.items()]


def _below(folder: Traversable, path: str) -> dict[str, Traversable]:
    found: dict[str, Traversable] = {}
    for one in folder.iterdir():
        if one.is_dir():
            found |= _below(one, f"{path}{one.name}/")
        elif _ending(one.name) in _KINDS:
            found[path + one.name] = one
    return found


def _ending(name: str) -> str:
    return f".{name.rpartition('.')[2]}"


def _route(path: str, file: Traversable) -> Route:
    kind = _KINDS[_ending(file.name)]

    def serve(_: Request) -> Response:
        return Response(file.read_bytes(), media_type=kind)

    return Route(path, serve, methods=["GET"], include_in_schema=False)
