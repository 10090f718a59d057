"""The state that routes share: the library, a cache of each version of it, threads, and word of every change."""

from __future__ import annotations

import asyncio
import os
import sqlite3
from collections.abc import AsyncIterator, Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from threading import Event, Lock, Thread
from typing import Annotated, NamedTuple, TypeVar

from fastapi import Depends, Request
from starlette.types import ASGIApp, Receive, Scope, Send

from kineme.errors import KinemeError
from kineme.library.library import ActionLibrary
from kineme.library.storage.address import Address
from kineme.library.storage.symbols import Symbol
from kineme.recognition.early.stream import Live
from kineme.studio.server.opened import OpenedRecordings
from kineme.studio.server.refusals import ConflictError, MissingError, StoppedError
from kineme.studio.server.uploads import Uploads
from kineme.studio.snapshot import DRAWN

PERIOD = 0.2  # seconds between looks whether the client is there

LOOKS = 0.25  # seconds between looks at the version, for changes by other processes

Result = TypeVar("Result")

_WRITERS = 4  # changes that are worked on at once; each holds a thread until it has its turn
_MOST_CACHED = 200  # things of one kind
_LONG = 4  # files that are read or searched at once; others wait


class LibraryView(NamedTuple):
    """The symbols of one version, by id, and the symbol's id of each member."""

    version: int
    symbols: dict[str, Symbol]
    symbol_of: dict[int, str]


class Studio:
    """An open library and what its clients share; any thread may use it.

    The folder, or address, is that of the library, which is made where there is none; read only, every change is
    refused. Of other files than the library's only those below the path `recordings` are read, which no client names.
    """

    def __init__(self, folder: str | Path | Address, read_only: bool = False, recordings: Path | None = None) -> None:
        self.read_only = read_only
        self.opened = None if recordings is None else OpenedRecordings(recordings)
        self.library = ActionLibrary(folder, create=not read_only, read_only=read_only)
        self.uploads = Uploads()
        self.writers = asyncio.Semaphore(_WRITERS)
        self.live = ThreadPoolExecutor(max(2, os.cpu_count() or 1), "kineme-live")
        self.long = ThreadPoolExecutor(_LONG, "kineme-long")
        self.reader = ThreadPoolExecutor(1, "kineme-episodes")
        self.works = Works()
        self.warm = -1  # the version of the library that recognition is prepared for
        self._warming: list[Thread] = []
        self._cached: dict[str, tuple[int, object]] = {}
        self._turns: dict[str, Lock] = {}
        self._turn = Lock()
        self._searches: dict[str, asyncio.Lock] = {}

    def close(self) -> None:
        """Close the library, once no thread reads or writes it, and delete what was sent."""
        self.works.close()
        for pool in (self.live, self.long, self.reader):
            pool.shutdown(wait=False, cancel_futures=True)
        self.library.close()
        self.uploads.close()

    async def reading(self, act: Callable[..., Result], *arguments: object) -> Result:
        """Return the result of `act`, which reads episodes; those who wait for the disk hold no thread of requests."""
        return await asyncio.get_running_loop().run_in_executor(self.reader, act, *arguments)

    def join(self) -> None:
        """Wait for what its threads still compute, after it is closed; the threads that they share end with them."""
        for pool in (self.live, self.long, self.reader):
            pool.shutdown()
        for thread in self._warming:
            thread.join()

    def view(self) -> LibraryView:
        """Return the symbols as they are now."""

        def make() -> LibraryView:
            version, symbols = self.library.version, self.library.symbols()
            symbol_of = {int(i): symbol.id for symbol in symbols for i in symbol.members}
            return LibraryView(version, {symbol.id: symbol for symbol in symbols}, symbol_of)

        return self.cached("view", make)

    def cached(self, name: str, make: Callable[[], Result]) -> Result:
        """Return the result of this version of the library, or make it; one thread makes it, others wait."""
        with self._turn:
            turn = self._turns.setdefault(name, Lock())
        with turn:
            version = self.library.version
            if self._cached.get(name, (None, None))[0] != version:
                try:
                    result = make()
                except KinemeError:
                    if self.library.version == version:
                        raise
                    version = -1
                if self.library.version != version:  # it has changed meanwhile: once more
                    version, result = self.library.version, make()
                self._cached[name] = version, result
            return self._cached[name][1]  # type: ignore[return-value]

    def cached_item(self, name: str, key: str, make: Callable[[], Result]) -> Result:
        """Do as `cached`, of many things of one kind; of too many the first ones are forgotten."""
        items: dict[str, Result] = self.cached(name, dict)
        with self._turn:
            if key in items:
                return items[key]
        result = make()
        with self._turn:
            items[key] = result
            if len(items) > _MOST_CACHED:
                del items[next(iter(items))]
        return result

    async def cached_in_background(self, name: str, make: Callable[[], Result]) -> Result:
        """Do as `cached`, of what takes long: those who wait for it hold no thread of the requests."""
        turn = self._searches.setdefault(name, asyncio.Lock())
        async with turn:
            return await asyncio.get_running_loop().run_in_executor(self.long, lambda: self.cached(name, make))

    def symbol(self, key: str, expected: int | None = None) -> Symbol:
        """Return the symbol of an id, unless it is gone, also since the version that the client has seen."""
        symbols = self.view().symbols
        if key not in symbols:
            raise self._gone(f"the symbol {key!r}", expected)
        return symbols[key]

    def check_movements(self, ids: list[int], expected: int | None = None) -> None:
        """Refuse ids of movements that are not in the library, in the same way."""
        there = self.cached("ids", lambda: frozenset(self.library.ids().tolist()))
        if lost := [i for i in ids if i not in there]:
            raise self._gone(f"the movement {lost[0]}", expected)

    def _gone(self, what: str, expected: int | None) -> ConflictError | MissingError:
        if expected is not None and expected < self.library.version:
            return ConflictError(f"{what} is gone: the library was changed meanwhile; look at it again")
        return MissingError(f"expected something of this library, it does not hold {what}")

    def warm_up(self) -> None:
        """Prepare recognition for the library as it is now, beside all else: the next drawing is answered at once."""
        thread = Thread(target=self._prepare, name="kineme-warm-up", daemon=True)
        thread.start()
        self._warming = [warming for warming in self._warming if warming.is_alive()] + [thread]

    def _prepare(self) -> None:
        with suppress(KinemeError):  # closed meanwhile
            version = self.library.version
            with suppress(KinemeError):  # too little to recognize with, as in a new library
                self.stream()
            if self.library.version == version:
                self.warm = version

    def stream(self) -> Live:
        """Recognize one movement under way by the library as it is now; see `kineme.ActionLibrary.stream`."""
        return self.library.stream(early=DRAWN)


def studio_of(request: Request) -> Studio:
    """The studio that a request is for."""
    studio: Studio = request.app.state.studio
    return studio


async def writable_studio_of(request: Request) -> AsyncIterator[Studio]:
    """The same for a change, of which few are worked on at once: while another process writes, others still read."""
    studio = studio_of(request)
    if studio.read_only:
        raise PermissionError(
            "this studio shows the library for reading only; start it without --read-only to change it"
        )
    async with studio.writers:
        yield studio


Reads = Annotated[Studio, Depends(studio_of)]
Writes = Annotated[Studio, Depends(writable_studio_of)]


class News:
    """What those who listen are told; what is called must not wait."""

    def __init__(self) -> None:
        self._listeners: set[Callable[..., object]] = set()

    def listen(self, tell: Callable[..., object]) -> None:
        """Call `tell` with whatever is new."""
        self._listeners.add(tell)

    def leave(self, tell: Callable[..., object]) -> None:
        """Call it no more."""
        self._listeners.discard(tell)

    def tell(self, *news: object) -> None:
        """Tell everyone."""
        for listener in list(self._listeners):
            listener(*news)


class Changes(News):
    """The versions of a library, for those who listen."""

    def __init__(self, studio: Studio, period: float = LOOKS) -> None:
        super().__init__()
        self.studio, self.period = studio, period
        self.version = studio.library.version
        self._look = asyncio.Event()

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
                version = await asyncio.to_thread(lambda: self.studio.library.version)
                if version != self.version:
                    self.version = version
                    self.tell(version)
                    self.studio.warm_up()


class NotifyAfterChanges:
    """Look at the version after every request that may have changed it."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on."""
        await self.app(scope, receive, send)
        if scope["type"] == "http" and scope["method"] != "GET":
            scope["app"].state.changes.look()


class Work:
    """One piece of work, which looks now and then whether it is still wanted."""

    def __init__(self) -> None:
        self.share = 0.0
        self._stopped = Event()

    def stop(self) -> None:
        """Note that it is not wanted any more."""
        self._stopped.set()

    def check(self) -> None:
        """End the work by a StoppedError, if it is not wanted any more."""
        if self._stopped.is_set():
            raise StoppedError

    def tell(self, share: float) -> None:
        """Note how much is done; raises as `check` does."""
        self.share = share
        self.check()


class Works:
    """Work under way, by the key that its client knows."""

    def __init__(self) -> None:
        self._works: dict[str, Work] = {}
        self._turn = Lock()

    def begin(self, key: str) -> Work:
        """Begin work; what was done before under the same key is not wanted any more."""
        work = Work()
        with self._turn:
            before = self._works.pop(key, None)
            self._works[key] = work
        if before is not None:
            before.stop()
        return work

    def end(self, key: str, work: Work) -> None:
        """Note that it is done, or not wanted any more."""
        work.stop()
        with self._turn:
            if self._works.get(key) is work:
                del self._works[key]

    def share(self, key: str) -> float | None:
        """Return how much is done; None if nothing is worked on."""
        work = self._works.get(key)
        return None if work is None else work.share

    def close(self) -> None:
        """Stop all work."""
        for work in list(self._works.values()):
            work.stop()


async def while_wanted(request: Request, pool: Executor, work: Work, act: Callable[[], Result]) -> Result:
    """Return the result of `act`, which looks at `work`; where its client goes meanwhile, it is not wanted any more."""
    result = asyncio.get_running_loop().run_in_executor(pool, act)
    try:
        while not (await asyncio.wait({result}, timeout=PERIOD))[0]:
            if await request.is_disconnected():
                work.stop()
        return result.result()
    finally:  # where the server ends too
        work.stop()
