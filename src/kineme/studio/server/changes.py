"""Tell every client that the library has changed, whoever changed it."""

from __future__ import annotations

import asyncio
import sqlite3
from collections.abc import Callable
from contextlib import suppress

from starlette.types import ASGIApp, Receive, Scope, Send

from kineme.errors import KinemeError
from kineme.studio.server.studio import Studio

PERIOD = 0.25  # seconds between looks at the version, for changes by other processes

Tell = Callable[[int], object]  # must not wait


class Changes:
    """Watch the version of a library, and tell it to those who listen."""

    def __init__(self, studio: Studio, period: float = PERIOD) -> None:
        self.studio, self.period = studio, period
        self.version = studio.library.version
        self._listeners: set[Tell] = set()
        self._look = asyncio.Event()

    def listen(self, tell: Tell) -> None:
        """Call `tell` with every new version."""
        self._listeners.add(tell)

    def leave(self, tell: Tell) -> None:
        """Call it no more."""
        self._listeners.discard(tell)

    def look(self) -> None:
        """Look at once, as after a change of our own."""
        self._look.set()

    async def watch(self) -> None:
        """Look again and again, until cancelled."""
        while True:
            # Not `asyncio.wait_for`: before Python 3.12 it loses a cancellation that comes just after a change.
            with suppress(TimeoutError):
                async with asyncio.timeout(self.period):
                    await self._look.wait()
            self._look.clear()
            with suppress(KinemeError, sqlite3.Error):  # what cannot be read now: it is looked at again
                await self._compare()

    async def _compare(self) -> None:
        version = await asyncio.to_thread(lambda: self.studio.library.version)
        if version == self.version:
            return
        self.version = version
        for tell in list(self._listeners):
            tell(version)
        self.studio.warm_up()


class LooksAfterChanges:
    """Look at the version after every request that may have changed it."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on."""
        await self.app(scope, receive, send)
        if scope["type"] == "http" and scope["method"] != "GET":
            scope["app"].state.changes.look()
