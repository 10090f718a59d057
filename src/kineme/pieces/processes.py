"""Processes that search shards: one for each share of them, started anew where one dies."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kineme.errors import KinemeError
from kineme.pieces.search import Candidates, Shards, open_shards
from kineme.runtime.parallel import n_threads

_PATIENCE = 120.0  # seconds that one search may take; a process that needs longer hangs, and is started anew
_START = 600.0  # seconds until it is ready: indexes may have to be made


class UnavailableError(KinemeError):
    """A process that searches has died, or does not answer, and so has the one that was started instead."""


class Process:
    """A process that searches some of the groups of the shards in a folder."""

    def __init__(self, folder: Path, most: int, groups: Sequence[int], threads: int) -> None:
        self._options = str(folder), most, list(groups), threads
        self._process: Any = None
        self._pipe: Any = None

    @property
    def pid(self) -> int | None:
        """Number of the process; None before it is started."""
        return None if self._process is None else self._process.pid

    def is_alive(self) -> bool:
        """Tell whether it runs."""
        return self._process is not None and self._process.is_alive()

    def start(self) -> None:
        """Start it, and wait until it is ready."""
        context = multiprocessing.get_context("spawn")  # a fork would take over locks and connections
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, *self._options), daemon=True)
        self._process.start()
        theirs.close()
        self._receive(_START)

    def search(self, queries: Sequence[Any], k: int) -> list[Candidates]:
        """Return the best of its groups for each query; a process that has died is started once more."""
        for attempt in range(2):
            try:
                if not self.is_alive():
                    self.start()
                self._pipe.send((queries, k))
                return self._receive(_PATIENCE)
            except KinemeError:  # it says what is wrong, and would say it again
                raise
            except (OSError, EOFError, TimeoutError) as error:
                self.stop()
                if attempt:
                    raise UnavailableError(
                        "expected a process that searches shards to answer, it ended twice; look at the log of the "
                        "server, and whether shards are damaged or memory is short"
                    ) from error
        raise AssertionError

    def _receive(self, patience: float) -> Any:
        if not self._pipe.poll(patience):
            raise TimeoutError
        answer = self._pipe.recv()
        if isinstance(answer, KinemeError):
            raise answer
        return answer

    def stop(self) -> None:
        """End it."""
        if self._process is not None:
            with suppress(OSError):
                self._pipe.close()
            self._process.kill()
            self._process.join()
            self._process = None


def _serve(pipe: Any, folder: str, most: int, groups: list[int], threads: int) -> None:
    """Answer queries until nobody asks any more."""
    os.environ["KINEME_NUM_THREADS"] = str(threads)
    try:
        shards = replace(open_shards(folder), most=most)
        for _, group in (shards.groups[g] for g in groups):
            for array in group.rows:
                np.asarray(array).ravel()[::1024].sum()  # read once, so that it is in memory
        pipe.send(None)
    except KinemeError as error:
        pipe.send(error)
        return
    with suppress(EOFError, KeyboardInterrupt, OSError):
        while True:
            queries, k = pipe.recv()
            pipe.send(shards.candidates(queries, k, groups))


class Processes:
    """All processes of a folder of shards; to be used as a context manager. One search at a time.

    There are `count`, by default one for each processor, and fewer where there are fewer groups of shards.
    """

    def __init__(self, shards: Shards, count: int | None = None) -> None:
        count = n_threads() if count is None else count
        shards = replace(shards, most=max(1, min(shards.most, -(-len(shards) // count))))
        shards.prepare()
        sizes = [len(group.rows.reduced) for _, group in shards.groups]
        count = min(len(sizes), count)
        shares: list[list[int]] = [[] for _ in range(count)]
        for g in np.argsort(sizes)[::-1].tolist():  # the largest first, each to whom has the fewest rows
            min(shares, key=lambda share: sum(sizes[other] for other in share)).append(g)
        threads = max(1, n_threads() // count)
        self.shards = shards
        self.processes = [Process(shards.folder, shards.most, sorted(share), threads) for share in shares]
        self._pool = ThreadPoolExecutor(count, "kineme-search")

    def __enter__(self) -> Processes:
        list(self._pool.map(Process.start, self.processes))
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        self._pool.shutdown()

    def stop(self) -> None:
        """End all processes."""
        for process in self.processes:
            process.stop()

    def candidates(self, queries: Sequence[Any], k: int) -> list[Candidates]:
        """Return the same as `Shards.candidates`, from all processes."""
        answers = list(self._pool.map(lambda process: process.search(queries, k), self.processes))
        return [self.shards.best(parts, k) for parts in zip(*answers, strict=True)]
