"""Pieces on an executor: this process, processes of this machine, or the workers of a cluster of Dask."""

from __future__ import annotations

import os
import pickle
import signal
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from itertools import islice
from multiprocessing import get_context
from threading import Thread
from time import monotonic
from typing import Any, NamedTuple

import kineme
from kineme.errors import DataError, SpecificationError
from kineme.io.records import needs
from kineme.pieces.planning import Piece
from kineme.pieces.run import Job, Outcome, failed, run_piece

Outcomes = Generator[Outcome, None, None]

TIME_LIMIT = 6 * 3600.0  # s, of a piece: that of the usual size is some minutes of work, a bag alone may take hours

_SUBMITTED = 10_000  # pieces that a scheduler holds at once
_RETRIES = 3
_ENDED = "the process that worked on it was ended by the system, twice: it may need more memory than there is"
_LATE = "it was not done within {:g} min, and the process that worked on it was ended; see --time-limit"
_THREADS = ("KINEME_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")


def execute(
    job: Job, pieces: Sequence[Piece], workers: int | None = None, client: Any = None, time_limit: float = TIME_LIMIT
) -> Outcomes:
    """Yield the outcomes of pieces as they are done: in this process, in `workers` others, or by a client of Dask.

    A process that works on one piece for longer than the limit [s] is ended, and the piece fails; this process cannot
    be interrupted, and a cluster has limits of its own. Raises `SpecificationError`: both are given, fewer than one
    worker, or no time; `DataError`: workers of a cluster have other versions.
    """
    if workers is not None and client is not None:
        raise SpecificationError("expected workers, or a client, not both")
    if client is not None:
        return _on_cluster(job, pieces, client)
    if workers is None:
        return (run_piece(job, piece) for piece in pieces)
    if workers < 1 or not time_limit > 0:
        raise SpecificationError(f"expected at least one worker and a time above 0, got {workers} and {time_limit}")
    return _in_processes(job, pieces, workers, time_limit)


class _Process(NamedTuple):
    """A pool of one process, so that a piece that ends it, or hangs, is known."""

    pool: ProcessPoolExecutor
    number: Future[int]  # of the process, once it has begun

    def kill(self) -> None:
        """End it, also while foreign code runs that gives way to nothing else in it."""
        with suppress(OSError, BrokenProcessPool):
            os.kill(self.number.result(), getattr(signal, "SIGKILL", signal.SIGTERM))


def _in_processes(job: Job, pieces: Sequence[Piece], workers: int, time_limit: float) -> Outcomes:
    """Yield outcomes of processes with one thread each, which end with this one.

    A piece whose process is ended is done again, alone, after all others, and fails if it ends that one, too.
    """
    with _processes(job) as (start, first):
        idle = [first, *(start() for _ in range(min(workers, len(pieces)) - 1))]
        suspects: list[Piece] = []
        for outcome in _outcomes(job, pieces, idle, start, time_limit):
            if isinstance(outcome, Piece):
                suspects.append(outcome)
            else:
                yield outcome
        for outcome in _outcomes(job, suspects, idle[:1], start, time_limit):
            yield failed(job, outcome, _ENDED) if isinstance(outcome, Piece) else outcome


def _outcomes(
    job: Job, pieces: Sequence[Piece], idle: list[_Process], start: Callable[[], _Process], time_limit: float
) -> Iterator[Outcome | Piece]:
    """Yield outcomes of idle processes, which become others where they end, and pieces that have ended theirs."""
    waiting = iter(pieces)
    busy: dict[Future[Outcome], tuple[Piece, _Process, float]] = {}
    while True:
        for piece in islice(waiting, len(idle)):
            process = idle.pop()
            try:
                future = process.pool.submit(run_piece, job, piece)
            except BrokenProcessPool:
                process = start()
                future = process.pool.submit(run_piece, job, piece)
            busy[future] = piece, process, monotonic()
        if not busy:
            return
        latest = min(began for _, _, began in busy.values()) + time_limit
        wait(busy, min(max(0.0, latest - monotonic()), 3600.0), return_when=FIRST_COMPLETED)
        for future, (piece, process, began) in list(busy.items()):
            if future.done():
                has_ended = isinstance(future.exception(), BrokenProcessPool)
                idle.append(start() if has_ended else process)
                yield piece if has_ended else future.result()
            elif monotonic() - began > time_limit:
                process.kill()
                idle.append(start())
                yield failed(job, piece, _LATE.format(time_limit / 60))
            else:
                continue
            del busy[future]


@contextmanager
def _processes(job: Job) -> Iterator[tuple[Callable[[], _Process], _Process]]:
    """Context manager: a function that starts a process of one thread, which ends with this one, and the first one."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))  # they read it when they are imported
    context = get_context("spawn")
    reader, writer = context.Pipe(duplex=False)
    started: list[_Process] = []

    def start() -> _Process:
        pool = ProcessPoolExecutor(1, mp_context=context, initializer=_begin, initargs=(reader,))
        # A process is started by work, and has the environment of that moment.
        started.append(_Process(pool, pool.submit(_number_of, data)))
        return started[-1]

    try:
        try:
            data = pickle.dumps(job)
            first = start()
            first.number.result()
        except Exception as error:  # whatever pickle and modules raise
            raise SpecificationError(
                "expected a function of a module that other processes can import, and a script that calls it below if "
                f"__name__ == '__main__', got {type(error).__name__}: {error}; or leave out workers"
            ) from error
        yield start, first
    except BaseException:
        writer.close()  # ends what is under way, which may take long
        for process in started:
            process.kill()  # or hang
        raise
    finally:
        for process in started:
            process.pool.shutdown(wait=True, cancel_futures=True)
        writer.close()
        reader.close()
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _begin(reader: Any) -> None:
    """Let a process end with the one that has started it; a terminal interrupts both, and that one says what ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with, args=(reader,), daemon=True).start()


def _end_with(reader: Any) -> None:
    with suppress(EOFError, OSError):
        reader.recv_bytes()  # nothing is sent: it waits until the other end is closed, by whatever
    os._exit(1)


def _number_of(data: bytes) -> int:
    """Return the number of this process, which has found what a job needs."""
    pickle.loads(data)
    return os.getpid()


def _on_cluster(job: Job, pieces: Sequence[Piece], client: Any) -> Outcomes:
    """Yield outcomes of the workers of a cluster; the scheduler holds some thousand pieces at a time."""
    from distributed import as_completed

    _check_versions(client)
    waiting = iter(pieces)
    first = list(islice(waiting, _SUBMITTED))
    if not first:
        return
    piece_of = {}

    def submit(piece: Piece) -> Any:
        future = client.submit(run_piece, job, piece, pure=False, retries=_RETRIES)
        piece_of[future.key] = piece
        return future

    running = as_completed([submit(piece) for piece in first], loop=client.loop)
    for future in running:
        piece = piece_of.pop(future.key)
        error = future.exception() if future.status in ("error", "lost") else None
        if future.status == "cancelled":
            error = DataError("the cluster cancelled it")
        yield failed(job, piece, f"the cluster gave it up ({error})") if error is not None else future.result()
        future.release()
        for other in islice(waiting, 1):
            running.add(submit(other))


def _check_versions(client: Any) -> None:
    """Refuse a cluster whose workers have other versions: their parts would differ."""
    try:
        client.get_versions(check=True)
    except ValueError as error:
        raise DataError(f"expected the same versions on all workers, got others: {error}") from error
    for worker, version in client.run(_version).items():
        if version != kineme.__version__:
            raise DataError(
                f"expected kineme {kineme.__version__} on all workers, got {version} on {worker}; install the same"
            )


def _version() -> str:
    return kineme.__version__


@contextmanager
def cluster_client(address: str, timeout: float = 10.0) -> Iterator[Any]:
    """Context manager: a client of the scheduler of a cluster of Dask at an address, as ``tcp://head:8786``."""
    with needs("distributed", "use a cluster of Dask", "cluster"):
        from distributed import Client
    try:
        client = Client(address, timeout=timeout, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise DataError(f"expected a scheduler of Dask at {address}, got none that answers ({error})") from error
    with client:
        yield client
