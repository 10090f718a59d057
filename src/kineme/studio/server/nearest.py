"""The nearest of all movements in shards over HTTP: one server in front of the processes that search.

Movements of all clients that wait while a search is under way are searched together in the next one, which takes little
longer than one alone.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from fastapi import FastAPI
from pydantic import Field
from starlette.responses import JSONResponse

from kineme.errors import DataError, SpecificationError
from kineme.library.library import ActionLibrary
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.pieces.processes import Processes, UnavailableError
from kineme.pieces.scan import Query
from kineme.pieces.search import CANDIDATES, Candidates, Shards, as_dict, open_shards
from kineme.studio.server.access import Guard, own_names
from kineme.studio.server.app import LimitedBodies
from kineme.studio.server.records import Point, RequestBody, Times, trajectory
from kineme.studio.server.refusals import AnswersFailures, answer_errors
from kineme.studio.server.serve import LOOPBACK, TOKEN, is_loopback, listening_at, name_of, run, token_of_server

COMMAND = "kineme serve"
_TOGETHER = 128  # movements in one search
_MOST = 1000  # movements in one request, and neighbors of each


class MovementBody(RequestBody):
    """A movement: positions over time stamps [s], or evenly sampled over one second without them."""

    positions: Annotated[list[Point], Field(min_length=4, max_length=1_000_000)]
    times: Times | None = None


class NearestBody(RequestBody):
    """One movement or several, and how many of the nearest to give for each."""

    movements: Annotated[list[MovementBody], Field(min_length=1, max_length=_MOST)] | None = None
    positions: Annotated[list[Point], Field(min_length=4, max_length=1_000_000)] | None = None
    times: Times | None = None
    n: Annotated[int, Field(ge=1, le=_MOST)] = 10
    candidates: Annotated[int, Field(ge=1, le=10_000)] = CANDIDATES
    recognize: bool = True

    def trajectories(self) -> list[Trajectory]:
        """Return the movements. Raises `SpecificationError`: none, or both one and several."""
        if (self.movements is None) == (self.positions is None) or (self.times and self.movements):
            raise SpecificationError(
                'expected one movement as "positions" and "times", or several as "movements", got none or both'
            )
        bodies = self.movements or [MovementBody(positions=self.positions or [], times=self.times)]
        return [trajectory(_stamps(body), body.positions) for body in bodies]


def _stamps(body: MovementBody) -> list[float]:
    n = len(body.positions)
    return [i / (n - 1) for i in range(n)] if body.times is None else body.times


class Turns:
    """Searches one after the other, each for all movements that wait."""

    def __init__(self, search: Callable[[Sequence[Query], int], list[Candidates]]) -> None:
        self._search = search
        self._waiting: list[tuple[Query, int, asyncio.Future[Candidates]]] = []
        self._task: asyncio.Task[None] | None = None

    async def candidates(self, queries: Sequence[Query], k: int) -> list[Candidates]:
        """Return the best of all shards for each query."""
        loop = asyncio.get_running_loop()
        futures: list[asyncio.Future[Candidates]] = [loop.create_future() for _ in queries]
        self._waiting += [(query, k, future) for query, future in zip(queries, futures, strict=True)]
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._work())
        return list(await asyncio.gather(*futures))

    async def _work(self) -> None:
        while self._waiting:
            k = self._waiting[0][1]  # those that want as many
            alike = [i for i, entry in enumerate(self._waiting) if entry[1] == k][:_TOGETHER]
            some = [self._waiting[i] for i in alike]
            self._waiting = [entry for i, entry in enumerate(self._waiting) if i not in set(alike)]
            try:
                best = await asyncio.to_thread(self._search, [query for query, _, _ in some], k)
            except Exception as error:
                for _, _, future in some:
                    if not future.done():
                        future.set_exception(error)
                continue
            for (_, _, future), candidates in zip(some, best, strict=True):
                if not future.done():
                    future.set_result(candidates)


def create_search_app(
    shards: Shards, processes: Processes, library: ActionLibrary, token: str, hosts: tuple[str, ...] = ()
) -> FastAPI:
    """Return the search by started processes as an application, for any ASGI server; token and hosts as of `Guard`."""
    app = FastAPI(title=COMMAND, openapi_url="/openapi.json", docs_url=None, redoc_url=None)
    answer_errors(app)
    for kind, status in ((UnavailableError, 503), (DataError, 500)):
        app.add_exception_handler(kind, lambda _, error, status=status: JSONResponse({"error": str(error)}, status))
    turns = Turns(processes.candidates)

    @app.get("/health")
    def health() -> dict[str, Any]:
        """What is searched, and which processes are alive; one that has died is started at the next search."""
        pids = [process.pid for process in processes.processes if process.is_alive()]
        library_of = {"library": library.store.id, "version": library.version}
        return {"movements": len(shards), "shards": len(shards.shards), "processes": pids, **library_of}

    @app.post("/nearest")
    async def nearest(body: NearestBody) -> JSONResponse:
        """The nearest of all movements in the shards, for each movement sent."""
        movements = body.trajectories()
        if body.candidates < body.n:
            raise SpecificationError(f"expected at least n={body.n} candidates, got {body.candidates}")
        in_thread = asyncio.to_thread
        described, queries = await in_thread(shards.described, movements)
        candidates = await turns.candidates(queries, body.candidates)
        ranked = await in_thread(shards.ranked, described, candidates, body.n)
        answers = await in_thread(library.recognize, movements) if body.recognize else [None] * len(ranked)
        return JSONResponse(as_dict(shards, body.candidates, ranked, answers))

    for middleware in (LimitedBodies, AnswersFailures):
        app.add_middleware(middleware)
    app.add_middleware(Guard, token=token, hosts=hosts, command=COMMAND)
    return app


class SearchOptions(NamedTuple):
    """Options of the server."""

    library: Path
    shards: Path
    host: str = LOOPBACK
    port: int = 8765
    processes: int | None = None  # one for each processor, at most
    progress: Callable[[int, int], object] | None = None  # takes the movements that can be searched, and all


def serve_search(options: SearchOptions, ready: Callable[[str, str, int], object]) -> None:
    """Serve the shards until interrupted; `ready` is called with the address, the token and the count."""
    token = token_of_server()
    if not is_loopback(options.host) and TOKEN not in os.environ:
        raise SpecificationError(
            f"expected a token in {TOKEN} with --host {options.host}, which others on the network reach, got none; "
            "set it to 16 or more letters and digits, or leave --host out"
        )
    with (
        closing(listening_at(options.host, options.port)) as listening,
        ActionLibrary(options.library, read_only=True) as library,
    ):
        shards = open_shards(options.shards)
        if shards.reduction.library != library.store.id:
            raise SpecificationError(
                f"expected shards that were made with the library in {options.library}, got those of another one in "
                f"{options.shards}; name that library"
            )
        if options.progress is not None:
            options.progress(0, len(shards))
        hosts = () if is_loopback(options.host) else own_names(options.host)
        with Processes(replace(shards, progress=options.progress), options.processes) as processes:
            app = create_search_app(shards, processes, library, token, hosts)
            address = f"http://{name_of(options.host)}:{listening.getsockname()[1]}/"
            run(app, listening, lambda: ready(address, token, len(shards)), lambda: None, processes.stop)
