"""What the routes share: the library, what of it is shown at a version, and threads for movements under way."""

from __future__ import annotations

import asyncio
import os
from collections.abc import AsyncIterator, Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from threading import Lock, Thread
from typing import Annotated, NamedTuple, TypeVar

from fastapi import Depends, Request

from kineme.errors import KinemeError
from kineme.library.library import ActionLibrary
from kineme.library.storage.symbols import Symbol
from kineme.recognition.early.stream import Live
from kineme.studio.server.refusals import ConflictError, MissingError
from kineme.studio.server.uploads import Uploads
from kineme.studio.server.work import Works
from kineme.studio.snapshot.recognition import DRAWN

Made = TypeVar("Made")

_WRITERS = 4  # changes that are worked on at once; each holds a thread until it has its turn
_KEPT = 200  # things of one kind
_LONG = 4  # files that are read or searched at once; others wait


class Shown(NamedTuple):
    """The symbols of one version, by id, and the symbol's id of each member."""

    version: int
    symbols: dict[str, Symbol]
    symbol_of: dict[int, str]


class Studio:
    """An open library and what its clients share; any thread may use it.

    Parameters
    ----------
    folder : Path
        Of the library, which is made where there is none.
    read_only : bool
        Refuse every change.
    """

    def __init__(self, folder: Path, read_only: bool = False) -> None:
        self.read_only = read_only
        self.library = ActionLibrary(folder, create=not read_only, read_only=read_only)
        self.uploads = Uploads()
        self.writers = asyncio.Semaphore(_WRITERS)
        self.live = ThreadPoolExecutor(max(2, os.cpu_count() or 1), "kineme-live")
        self.long = ThreadPoolExecutor(_LONG, "kineme-long")
        self.works = Works()
        self.warm = -1  # the version of the library that recognition is prepared for
        self._warming: list[Thread] = []
        self._kept: dict[str, tuple[int, object]] = {}
        self._turns: dict[str, Lock] = {}
        self._turn = Lock()
        self._searches: dict[str, asyncio.Lock] = {}

    def close(self) -> None:
        """Close the library, once no thread reads or writes it, and delete what was sent."""
        self.works.close()
        for pool in (self.live, self.long):
            pool.shutdown(wait=False, cancel_futures=True)
        self.library.close()
        self.uploads.close()

    def join(self) -> None:
        """Wait for what its threads still compute, after it is closed; the threads that they share end with them."""
        for pool in (self.live, self.long):
            pool.shutdown()
        for thread in self._warming:
            thread.join()

    def shown(self) -> Shown:
        """The symbols as they are now."""
        return self.kept("shown", self._show)

    def _show(self) -> Shown:
        version, symbols = self.library.version, self.library.symbols()
        symbol_of = {int(i): symbol.id for symbol in symbols for i in symbol.members}
        return Shown(version, {symbol.id: symbol for symbol in symbols}, symbol_of)

    def kept(self, name: str, make: Callable[[], Made]) -> Made:
        """What was made at this version of the library, else made now; one thread makes it, others wait."""
        with self._turn:
            turn = self._turns.setdefault(name, Lock())
        with turn:
            if self._kept.get(name, (None, None))[0] != self.library.version:
                self._kept[name] = self._made(make)
            return self._kept[name][1]  # type: ignore[return-value]

    def _made(self, make: Callable[[], Made]) -> tuple[int, Made]:
        """What is made of one version: made once more if the library changes meanwhile."""
        version = self.library.version
        try:
            made = make()
        except KinemeError:
            if self.library.version == version:
                raise
        else:
            if self.library.version == version:
                return version, made
        return self.library.version, make()

    def kept_some(self, name: str, key: str, make: Callable[[], Made]) -> Made:
        """As `kept`, of many things of one kind; of too many the first ones are forgotten."""
        several: dict[str, Made] = self.kept(name, dict)
        with self._turn:
            if key in several:
                return several[key]
        made = make()
        with self._turn:
            several[key] = made
            if len(several) > _KEPT:
                del several[next(iter(several))]
        return made

    async def searched(self, name: str, make: Callable[[], Made]) -> Made:
        """As `kept`, of what takes long: those who wait for the one that makes it hold no thread of the requests."""
        turn = self._searches.setdefault(name, asyncio.Lock())
        async with turn:
            return await asyncio.get_running_loop().run_in_executor(self.long, lambda: self.kept(name, make))

    def symbol(self, key: str, expected: int | None = None) -> Symbol:
        """The symbol of an id.

        Raises
        ------
        ConflictError
            It is gone since the version that the client has seen.
        MissingError
            There is none.
        """
        shown = self.shown()
        if key not in shown.symbols:
            raise self._gone(f"the symbol {key!r}", expected)
        return shown.symbols[key]

    def check_movements(self, ids: list[int], expected: int | None = None) -> None:
        """Refuse ids of movements that are not in the library, in the same way."""
        there = self.kept("ids", lambda: frozenset(self.library.ids().tolist()))
        if lost := [one for one in ids if one not in there]:
            raise self._gone(f"the movement {lost[0]}", expected)

    def _gone(self, what: str, expected: int | None) -> ConflictError | MissingError:
        if expected is not None and expected < self.library.version:
            return ConflictError(f"{what} is gone: the library was changed meanwhile; look at it again")
        return MissingError(f"expected something of this library, it does not hold {what}")

    def warm_up(self) -> None:
        """Prepare recognition for the library as it is now, beside all else: the next drawing is answered at once."""
        thread = Thread(target=self._prepare, name="kineme-warm-up", daemon=True)
        thread.start()
        self._warming = [one for one in self._warming if one.is_alive()] + [thread]

    def _prepare(self) -> None:
        with suppress(KinemeError):  # closed meanwhile
            version = self.library.version
            with suppress(KinemeError):  # too little to recognize with, as in a new library
                self.stream()
            if self.library.version == version:
                self.warm = version

    def stream(self) -> Live:
        """What recognizes one movement under way, by the library as it is now; see `kineme.ActionLibrary.stream`."""
        return self.library.stream(early=DRAWN)


def studio_of(request: Request) -> Studio:
    """The studio that a request is for."""
    studio: Studio = request.app.state.studio
    return studio


async def writable_studio_of(request: Request) -> AsyncIterator[Studio]:
    """The same for a change, of which few are worked on at once: while another process writes, others still read.

    Raises
    ------
    PermissionError
        The studio is open for reading only.
    """
    studio = studio_of(request)
    if studio.read_only:
        raise PermissionError(
            "this studio shows the library for reading only; start it without --read-only to change it"
        )
    async with studio.writers:
        yield studio


Reads = Annotated[Studio, Depends(studio_of)]
Writes = Annotated[Studio, Depends(writable_studio_of)]
