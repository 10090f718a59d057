"""The application: an action library over HTTP."""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import anyio.to_thread
from fastapi import FastAPI
from pydantic import BaseModel, Field
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from kineme.library.storage.address import Address
from kineme.studio.server import (
    change_routes,
    episode_routes,
    library_routes,
    live_socket,
    recognition_routes,
    recording_routes,
    robot_routes,
    rollout_routes,
    wand,
)
from kineme.studio.server.access import Guard
from kineme.studio.server.live_socket import Sources
from kineme.studio.server.refusals import AnswersFailures, answer_errors, refuse
from kineme.studio.server.studio import Changes, NotifyAfterChanges, Studio

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
_PACKAGE = Path(__file__).parents[2]
#: Folders of the package whose files are served, and under which path.
_FOLDERS = {"": "studio/web", "runtime/": "studio/javascript"}
#: Files of other rooms: what draws an arm.
_VENDORED = {
    "vendor/scene.min.js": "robots/view/vendor/scene.min.js",
    "vendor/viewer.js": "robots/view/page/viewer.js",
}

ABOUT = """An action library: what movements are, what they are called, and how they go on.

Times are in seconds, positions in the unit of the library. Numbers that are not finite are null. The websocket
`/api/live` takes movements while they happen, and tells of every change of the library.
"""

_STATUSES = (
    "400: what is asked for makes no sense, 401: without the token, 403: for reading only, or from the page of another "
    "site, 404: not there, 408: the request stopped arriving, 409: the library was changed meanwhile, 413: too large, "
    "422: a field is wrong."
)


class Refusal(BaseModel):
    """The reason why nothing was done."""

    error: str = Field(description="What was expected, what came, and what to do.")


#: Of every route.
REFUSALS: dict[int | str, dict[str, Any]] = {
    "4XX": {"model": Refusal, "description": _STATUSES},
    "5XX": {"model": Refusal, "description": "503: another process writes; try again. 500: the server failed."},
}

_TOKENS = {
    "bearer": {"type": "http", "scheme": "bearer", "description": "The token in the address that the studio prints."},
    "cookie": {"type": "apiKey", "in": "cookie", "name": "kineme_...", "description": "Set by `/?token=...`."},
}


class StudioApp(FastAPI):
    """An application whose description says that it wants a token."""

    def openapi(self) -> dict[str, Any]:
        """The description, made once."""
        described = super().openapi()
        described["components"]["securitySchemes"] = _TOKENS
        described["security"] = [{name: []} for name in _TOKENS]
        return described


JSON_BYTES = 8 * 2**20
FILE_BYTES = 256 * 2**20
FILES = "/api/recordings"  # where files are sent to; anything else is JSON
SILENCE = 20.0  # seconds without a byte

_THREADS = 8  # requests that are worked on at once, beside movements under way

ROUTERS = (
    library_routes.router,
    change_routes.router,
    recognition_routes.router,
    rollout_routes.router,
    change_routes.proposal_router,
    recording_routes.router,
    recording_routes.annotation_router,
    episode_routes.router,
    robot_routes.router,
    live_socket.router,
    wand.router,
)


def create_app(
    folder: str | Path | Address,
    token: str,
    *,
    once: str = "",
    read_only: bool = False,
    hosts: tuple[str, ...] = (),
    recordings: str | Path | None = None,
) -> FastAPI:
    """The studio of one library, for any ASGI server; the library is made if there is none, unless read only.

    Every request must know the token, as a cookie or as ``Authorization: Bearer``; ``/?token=...`` sets the cookie, and
    ``/?once=...`` sets it one time. The hosts are as of `Guard`; `recordings` are those whose episodes it shows.
    """
    studio = Studio(folder, read_only, None if recordings is None else Path(recordings))
    app = StudioApp(
        title="kineme studio",
        version=version("kineme"),
        description=ABOUT,
        responses=REFUSALS,
        openapi_url="/api/openapi.json",
        docs_url=None,  # these pages load scripts from elsewhere
        redoc_url=None,
        lifespan=_lifespan,
    )
    app.state.studio = studio
    answer_errors(app)
    for router in ROUTERS:
        app.include_router(router)
    for middleware in (NotifyAfterChanges, LimitedBodies, StaticFiles, AnswersFailures):
        app.add_middleware(middleware)
    app.add_middleware(Guard, token=token, once=once, hosts=hosts)
    return app


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    anyio.to_thread.current_default_thread_limiter().total_tokens = _THREADS
    changes = app.state.changes = Changes(app.state.studio)
    app.state.sources, app.state.wand = Sources(), None
    app.state.studio.warm_up()
    watching = asyncio.create_task(changes.watch())
    try:
        yield
    finally:
        wand.close_wand(app)
        watching.cancel()
        with suppress(asyncio.CancelledError):
            await watching
        app.state.studio.close()


class _RefusedError(Exception):
    """Ends the work on a request, unless that catches everything."""


class LimitedBodies:
    """Refuse requests that are too large or stop arriving: 413 and 408, whatever their head says."""

    def __init__(self, app: ASGIApp, silence: float = SILENCE) -> None:
        self.app, self.silence = app, silence

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on with a limited `receive`; what is refused there is answered here."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        most = FILE_BYTES if scope["path"] == FILES else JSON_BYTES
        received, complete = 0, False
        refused: tuple[int, str] | None = None

        def check(size: int) -> None:
            nonlocal refused
            if size > most:
                refused = 413, f"expected at most {most // 2**20} MB, got more; send less at once"
                raise _RefusedError

        async def limited() -> Message:
            nonlocal received, complete, refused
            if complete:  # what comes after the body is that the client has gone, whenever it does
                return await receive()
            try:
                async with asyncio.timeout(self.silence):
                    message = await receive()
            except TimeoutError:
                refused = 408, f"expected the rest of the request, got nothing for {self.silence:g} s"
                raise _RefusedError from None
            received += len(message.get("body", b""))
            complete = not message.get("more_body", False)
            check(received)
            return message

        async def unless_refused(message: Message) -> None:
            if refused is None:
                await send(message)

        announced = dict(scope["headers"]).get(b"content-length", b"0")
        with suppress(_RefusedError):
            check(int(announced[:20]) if announced.isdigit() else 0)
            await self.app(scope, limited, unless_refused)
        if refused is not None:
            await refuse(scope, send, *refused)


class StaticFile(NamedTuple):
    """A file as it is sent: its bytes, its kind, and a tag that is another one when they are."""

    body: bytes
    kind: bytes
    tag: bytes


class StaticFiles:
    """Answer for the fifty files of the page at once, without routes and threads, and pass everything else on."""

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
    """Read all files, by their path; ``/`` is the page."""
    by_path = {path: _PACKAGE / where for path, where in _VENDORED.items()}
    for path, folder in _FOLDERS.items():
        below = (file for file in (_PACKAGE / folder).rglob("*") if file.suffix in _KINDS)
        by_path |= {path + file.relative_to(_PACKAGE / folder).as_posix(): file for file in below}
    by_path[""] = by_path["index.html"]
    answers = {}
    for path, file in by_path.items():
        body = file.read_bytes()
        tag = f'"{hashlib.sha256(body).hexdigest()[:20]}"'
        answers[f"/{path}"] = StaticFile(body, _KINDS[file.suffix].encode(), tag.encode())
    return answers
