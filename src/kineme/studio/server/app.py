"""The application: an action library over HTTP."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from importlib.metadata import version
from pathlib import Path

import anyio.to_thread
from fastapi import FastAPI

from kineme.studio.server import (
    change_routes,
    library_routes,
    live_socket,
    proposal_routes,
    recognize_routes,
    recording_routes,
    robot_routes,
    rollout_routes,
)
from kineme.studio.server.access import Guard
from kineme.studio.server.bodies import LimitedBodies
from kineme.studio.server.changes import Changes, LooksAfterChanges
from kineme.studio.server.description import ABOUT, REFUSALS, Described
from kineme.studio.server.live_sources import Sources
from kineme.studio.server.refusals import AnswersFailures, answer_errors
from kineme.studio.server.static_files import StaticFiles
from kineme.studio.server.studio import Studio

_THREADS = 8  # requests that are worked on at once, beside movements under way

ROUTERS = (
    library_routes.router,
    change_routes.router,
    recognize_routes.router,
    rollout_routes.router,
    proposal_routes.router,
    recording_routes.router,
    robot_routes.router,
    live_socket.router,
)


def create_app(
    folder: str | Path, token: str, *, once: str = "", read_only: bool = False, hosts: tuple[str, ...] = ()
) -> FastAPI:
    """The studio of one library, for any ASGI server.

    Parameters
    ----------
    folder : str or Path
        Of the library; it is made if there is none, unless read only.
    token : str
        What every request must know, as a cookie or as ``Authorization: Bearer``; ``/?token=...`` sets the cookie.
    once : str, default ""
        What sets it one time, as ``/?once=...``; empty for none.
    read_only : bool, default False
        Refuse every change.
    hosts : tuple of str
        Names beside those of the loopback under which it may be asked; with one, every address too.

    Raises
    ------
    DataError
        The library cannot be opened.
    """
    studio = Studio(Path(folder), read_only)
    app = Described(
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
    app.add_middleware(LooksAfterChanges)
    app.add_middleware(LimitedBodies)
    app.add_middleware(StaticFiles)
    app.add_middleware(AnswersFailures)
    app.add_middleware(Guard, token=token, once=once, hosts=hosts)
    return app


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    anyio.to_thread.current_default_thread_limiter().total_tokens = _THREADS
    changes = app.state.changes = Changes(app.state.studio)
    app.state.sources = Sources()
    app.state.studio.warm_up()
    watching = asyncio.create_task(changes.watch())
    try:
        yield
    finally:
        watching.cancel()
        with suppress(asyncio.CancelledError):
            await watching
        app.state.studio.close()
