"""Pieces on an executor: this process, processes of this machine, or the workers of a cluster of Dask."""

from __future__ import annotations

import os
import pickle
import signal
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from itertools import islice
from multiprocessing import get_context
from threading import Thread
from typing import Any

import kineme
from kineme.errors import DataError, SpecificationError
from kineme.io.records import needs
from kineme.pieces.planning import Piece
from kineme.pieces.run import Job, Outcome, failed, run_piece

Outcomes = Generator[Outcome, None, None]

_AHEAD = 2  # pieces of each worker that wait for it
_SUBMITTED = 10_000  # pieces that a scheduler holds at once
_RETRIES = 3
_ENDED = "the process that worked on it was ended by the system, twice: it may need more memory than there is"
_THREADS = ("KINEME_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")


def execute(job: Job, pieces: Sequence[Piece], workers: int | None = None, client: Any = None) -> Outcomes:
    """Yield the outcomes of pieces as they are done: in this process, in `workers` others, or by a client of Dask.

    Raises `SpecificationError`: both are given, or fewer than one worker; `DataError`: workers of a cluster have other
    versions.
    """
    if workers is not None and client is not None:
        raise SpecificationError("expected workers, or a client, not both")
    if client is not None:
        return _on_cluster(job, pieces, client)
    if workers is None:
        return (run_piece(job, piece) for piece in pieces)
    if workers < 1:
        raise SpecificationError(f"expected at least one worker, got {workers}")
    return _in_processes(job, pieces, workers)


def _in_processes(job: Job, pieces: Sequence[Piece], workers: int) -> Outcomes:
    """Yield outcomes of processes with one thread each.

    What is under way ends with this process, and when it is interrupted. When a process is ended from outside, nobody
    knows by which piece: those under way are done again, each alone, and the one that ends its process a second time
    fails.
    """
    waiting = iter(pieces)
    broken = True
    while broken:
        suspects: list[Piece] = []
        with _pool(job, workers) as pool:
            futures: dict[Future[Outcome], Piece] = {}
            broken = False
            while not broken:
                for piece in islice(waiting, workers * _AHEAD - len(futures)):
                    try:
                        futures[pool.submit(run_piece, job, piece)] = piece
                    except BrokenProcessPool:
                        suspects.append(piece)
                        broken = True
                        break
                if not futures:
                    break
                for future in wait(futures, return_when=FIRST_COMPLETED).done:
                    piece = futures.pop(future)
                    try:
                        yield future.result()
                    except BrokenProcessPool:
                        suspects.append(piece)
                        broken = True
            suspects += futures.values()
        for piece in suspects:
            yield _alone(job, piece)


def _alone(job: Job, piece: Piece) -> Outcome:
    """Return the outcome of a piece in a process of its own."""
    with _pool(job, 1) as pool:
        try:
            return pool.submit(run_piece, job, piece).result()
        except BrokenProcessPool:
            return failed(job, piece, _ENDED)


@contextmanager
def _pool(job: Job, workers: int) -> Iterator[ProcessPoolExecutor]:
    """Context manager: processes that begin anew, whose libraries use one thread, and which end when this one does.

    Raises `SpecificationError`: they do not find the function of the job.
    """
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))  # they read it when they are imported
    context = get_context("spawn")
    reader, writer = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_begin, initargs=(reader,))
    try:
        try:
            data = pickle.dumps(job)
            # Processes are started by work, and have the environment of that moment.
            checks = [pool.submit(_check_job, data) for _ in range(workers)]
            checks[0].result()
        except Exception as error:  # whatever pickle and modules raise
            raise SpecificationError(
                "expected a function of a module that other processes can import, and a script that calls it below if "
                f"__name__ == '__main__', got {type(error).__name__}: {error}; or leave out workers"
            ) from error
        yield pool
    except BaseException:
        writer.close()  # ends what is under way, which may take long, or hang
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
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


def _check_job(data: bytes) -> None:
    pickle.loads(data)


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
    """Context manager: a client of the scheduler of a cluster of Dask at an address, as ``tcp://head:8786``.

    It waits so long for the scheduler to answer [s].
    """
    with needs("distributed", "use a cluster of Dask", "cluster"):
        from distributed import Client
    try:
        client = Client(address, timeout=timeout, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise DataError(f"expected a scheduler of Dask at {address}, got none that answers ({error})") from error
    with client:
        yield client
