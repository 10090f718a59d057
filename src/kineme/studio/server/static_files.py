"""The files of the page, read once and kept in memory: nothing else of the disk can be asked for."""

from __future__ import annotations

import hashlib
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import NamedTuple

from starlette.types import ASGIApp, Receive, Scope, Send

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


class StaticFile(NamedTuple):
    """What is sent of a file: its bytes, its kind, and a tag that is another one when they are."""

    body: bytes
    kind: bytes
    tag: bytes


class StaticFiles:
    """Answer for the files of the page at once, and pass everything else on.

    The page is made of some fifty modules. Answering for them before routes are searched, and without a thread for
    each, is a large part of a short first view.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app, self.files = app, static_files()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send a file, or only that it is the one that the browser has."""
        file = self.files.get(scope["path"]) if scope["type"] == "http" else None
        if file is None or scope["method"] not in {"GET", "HEAD"}:
            await self.app(scope, receive, send)
            return
        same = dict(scope["headers"]).get(b"if-none-match") == file.tag
        headers = [(b"etag", file.tag)]
        if not same:
            headers += [(b"content-type", file.kind), (b"content-length", b"%d" % len(file.body))]
        await send({"type": "http.response.start", "status": 304 if same else 200, "headers": headers})
        await send({"type": "http.response.body", "body": b"" if same or scope["method"] == "HEAD" else file.body})


def static_files() -> dict[str, StaticFile]:
    """All files by their path; ``/`` is the page."""
    package = files("kineme")
    found: dict[str, Traversable] = {}
    for path, folder in _FOLDERS.items():
        found |= _below(package.joinpath(*folder), path)
    found |= {path: package.joinpath(*where) for path, where in _VENDORED.items()}
    found[""] = found["index.html"]
    return {f"/{path}": _read(file) for path, file in found.items()}


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


def _read(file: Traversable) -> StaticFile:
    body = file.read_bytes()
    tag = f'"{hashlib.sha256(body).hexdigest()[:20]}"'
    return StaticFile(body, _KINDS[_ending(file.name)].encode(), tag.encode())
