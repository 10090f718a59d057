"""Work that takes long: how much of it is done, and its end where nobody waits for it any more."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import Executor
from threading import Event, Lock
from typing import TypeVar

from fastapi import Request

PERIOD = 0.2  # seconds between looks whether the client is there

Made = TypeVar("Made")


class StoppedError(Exception):
    """Nobody waits for the work any more; 499, which nobody reads."""


class Work:
    """One piece of work, which looks now and then whether it is still wanted."""

    def __init__(self) -> None:
        self.share = 0.0
        self._stopped = Event()

    def stop(self) -> None:
        """It is not wanted any more."""
        self._stopped.set()

    def check(self) -> None:
        """End the work, if it is not wanted any more.

        Raises
        ------
        StoppedError
        """
        if self._stopped.is_set():
            raise StoppedError

    def tell(self, share: float) -> None:
        """So much is done; raises as `check` does."""
        self.share = share
        self.check()


class Works:
    """What is worked on, by the key that its client knows."""

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
        """It is done, or is not wanted any more."""
        work.stop()
        with self._turn:
            if self._works.get(key) is work:
                del self._works[key]

    def share(self, key: str) -> float | None:
        """How much is done; None if nothing is worked on."""
        work = self._works.get(key)
        return None if work is None else work.share

    def close(self) -> None:
        """Nothing is wanted any more."""
        for work in list(self._works.values()):
            work.stop()


async def while_wanted(request: Request, pool: Executor, work: Work, act: Callable[[], Made]) -> Made:
    """What is made by `act`, which looks at `work`; where its client goes meanwhile, it is not wanted any more.

    Raises
    ------
    StoppedError
        It was stopped.
    """
    made = asyncio.get_running_loop().run_in_executor(pool, act)
    try:
        while not (await asyncio.wait({made}, timeout=PERIOD))[0]:
            if await request.is_disconnected():
                work.stop()
        return made.result()
    finally:  # where the server ends too
        work.stop()
