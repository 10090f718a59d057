"""A library on a PostgreSQL server beside one in a folder: learning, and eight writers beside one.

Movements are those of the subject ``library``, learned by both stores in turns. Writers are processes that have
described their movements before: what is measured is storing. On few cores they wait for these, and not for each other.
Whether they do is told by the share of its time in which one keeps the others waiting, and by writers whose lines are
slow, which leave the cores idle.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
from time import perf_counter, sleep
from typing import Any

import numpy as np

import kineme
from bench.library_movements import SHOWN, copies, kinds
from bench.movements import SEED
from bench.postgres_server import programs, running_server
from bench.rows import Row
from kineme.library.commit import Batch, commit, evenly_sampled, find_stored, serialize_new
from kineme.library.learn import digests
from kineme.library.storage.postgres import ServerConnection

_WRITERS, _BATCH = 8, 2048
_LINE = 2e6  # bytes per second of a slow line
_SETTINGS = ("shared_buffers=512MB", "max_wal_size=4GB")


def measure(quick: bool) -> list[Row]:
    if programs() is None:
        print("no PostgreSQL server here (apt-get install postgresql): nothing is measured")
        return []
    n, batches = (4_000, 2) if quick else (40_000, 6)
    with running_server(*_SETTINGS) as server, tempfile.TemporaryDirectory() as folder:
        places = {"SQLite": f"{folder}/actions", "PostgreSQL": server.address("learned")}
        rates = _learn(places, n, n // 4)
        one, share = _write(server.address("single"), 1, batches)
        many, _ = _write(server.address("many"), _WRITERS, batches)
        one_slow, _ = _write(server.address("slow"), 1, 2, _LINE)
        many_slow, _ = _write(server.address("slow%20too"), _WRITERS, 2, _LINE)
        one_file, _ = _write(f"{folder}/single", 1, batches)
        many_file, _ = _write(f"{folder}/many", _WRITERS, batches)
    cores = len(os.sched_getaffinity(0))
    details = {"n": n, "batch": _BATCH, "batches": batches, "writers": _WRITERS, "cores": cores, "seed": SEED}
    target = (">=", 3.0) if cores > _WRITERS else None  # on fewer, processes wait for cores
    ours, peer = rates["PostgreSQL"], rates["SQLite"]
    return [
        Row("learn, 2-D", "/s", ours, peer, "SQLite", ours / peer, (">=", 0.5), details),
        Row("store what is described, one writer", "/s", one, one_file, "SQLite", one / one_file),
        Row(f"  {_WRITERS} writers at once", "/s", many, many_file, f"SQLite, {_WRITERS} writers", many / many_file),
        Row(f"  {_WRITERS} writers beside one", "/s", many, one, "one writer", many / one, target),
        Row(f"  {_WRITERS} writers beside one, lines of 2 MB/s", "/s", many_slow, one_slow, "one writer",
            many_slow / one_slow, (">=", 3.0)),
        Row("  share in which one keeps others waiting", "", share, target=("<=", 1 / 3)),
    ]  # fmt: skip


def _learn(places: dict[str, str], n: int, call: int) -> dict[str, float]:
    """Movements learned per second in each place, one call in one place and the next in the other."""
    paths, random = kinds(max(2, n // 200), 2), np.random.default_rng(SEED)
    libraries = {name: kineme.ActionLibrary(place, create=True) for name, place in places.items()}
    seconds = dict.fromkeys(places, 0.0)
    libraries["SQLite"].specification.dmp.learn(copies(paths, np.arange(2), 0, SHOWN))  # compiles
    for start in range(0, n, call):
        demos = copies(paths, random.integers(0, len(paths), call), start, SHOWN)
        for name, library in libraries.items() if start // call % 2 else reversed(libraries.items()):
            begin = perf_counter()
            library.learn(demos)
            seconds[name] += perf_counter() - begin
    for library in libraries.values():
        assert len(library) == n
        assert not library.verify()
        library.close()
    return {name: n / seconds[name] for name in places}


def _write(place: str, writers: int, batches: int, line: float = math.inf) -> tuple[float, float]:
    """Movements stored per second by processes at once, and the share of their time in which others have to wait.

    Each takes its bytes through a line of so many bytes per second.
    """
    kineme.ActionLibrary(place, create=True).close()
    command = [sys.executable, "-m", "bench.postgres", place]
    pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    processes = [subprocess.Popen([*command, str(k), str(batches), str(line)], **pipes) for k in range(writers)]
    for process in processes:
        assert process.stdout.readline() == "described\n"
    begin = perf_counter()
    for process in processes:
        process.stdin.write("store\n")
        process.stdin.flush()
    shares = [float(process.stdout.readline()) for process in processes]
    seconds = perf_counter() - begin
    for process in processes:
        process.communicate()
        assert not process.returncode
    with kineme.ActionLibrary(place) as library:
        assert len(library) == writers * batches * _BATCH
        assert not library.verify()
    return writers * batches * _BATCH / seconds, float(np.mean(shares))


def _store_described(place: str, writer: int, batches: int, line: float) -> None:
    """Describe batches of movements of this writer's own, wait for a word, and store them."""
    turn, waited = [0.0], ServerConnection.wait_for_turn

    def wait_for_turn(*arguments: Any) -> None:
        waited(*arguments)
        turn[0] = perf_counter()

    copied = ServerConnection.copy_rows

    def copy_rows(connection: ServerConnection, table: str, rows: Any) -> None:
        sleep(sum(len(value) for row in rows for value in row if isinstance(value, bytes)) / line)
        copied(connection, table, rows)

    ServerConnection.wait_for_turn = wait_for_turn  # type: ignore[method-assign]
    ServerConnection.copy_rows = copy_rows  # type: ignore[method-assign]
    paths = kinds(20, 2)
    with kineme.ActionLibrary(place, wait=600.0) as library:
        described = [_described(library, paths, 1 + writer * batches + k) for k in range(batches)]
        print("described", flush=True)
        sys.stdin.readline()
        begin, alone = perf_counter(), 0.0
        for batch in described:
            commit(library.store, batch)
            alone += perf_counter() - turn[0]
        print(alone / (perf_counter() - begin), flush=True)


def _described(library: kineme.ActionLibrary, paths: Any, seed: int) -> Batch:
    demos = copies(paths, np.random.default_rng(seed).integers(0, len(paths), _BATCH), seed, SHOWN)
    nothing: list[Any] = [None] * _BATCH
    batch = Batch(demos, digests(demos, evenly_sampled(demos)), demos.labels.tolist(), nothing, nothing, nothing)
    with library.store.reading() as connection:
        assert not find_stored(connection, batch).by_digest
    serialize_new(library.store, demos, batch, list(range(_BATCH)))
    return batch


if __name__ == "__main__":
    _store_described(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]))
