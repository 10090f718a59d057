"""Work over row tiles in a few threads, in a short-lived pool that survives forks and concurrent callers.

While the pool works, the BLAS library is held to one thread per caller: two tiles side by side beat one tile split in
two, because a tile stays in one core's cache.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from threading import Lock, active_count
from typing import Any

from kineme.errors import SpecificationError
from kineme.runtime.forks import at_fork

_blas_lock = Lock()
_blas_holds: list[Any] = []  # one entry per active caller; the first entry is the limiter
_limited = False  # whether the last fork held BLAS to one thread


def n_threads() -> int:
    """Threads to use: ``KINEME_NUM_THREADS`` if set, else the processors this process may use."""
    wanted = os.environ.get("KINEME_NUM_THREADS")
    if wanted is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if not wanted.isdecimal() or int(wanted) < 1:
        raise SpecificationError(f"expected KINEME_NUM_THREADS to be a whole number from 1, got {wanted!r}")
    return int(wanted)


def for_tiles(work: Callable[[int, int], object], n_rows: int, tile_rows: int) -> None:
    """Call ``work(start, stop)`` for consecutive ranges of at most `tile_rows` that cover ``range(n_rows)``.

    It writes its own rows of a shared result; its return value is ignored.
    """
    tiles = [(start, min(start + tile_rows, n_rows)) for start in range(0, n_rows, tile_rows)]
    threads = min(n_threads(), len(tiles))
    # Also for a single tile: its small products are slower when BLAS splits them, and a fork in the meantime, which
    # ends the threads of OpenBLAS, would wait for them for ever.
    with single_threaded_blas():
        if threads <= 1:
            for start, stop in tiles:
                work(start, stop)
            return
        from concurrent.futures import ThreadPoolExecutor  # not for small work

        with ThreadPoolExecutor(threads) as pool:
            for result in [pool.submit(work, *tile) for tile in tiles]:
                result.result()


@contextmanager
def single_threaded_blas() -> Iterator[None]:
    """Hold BLAS to one thread per caller; the last caller to leave restores what was there.

    The limit is a property of the process, so concurrent callers are counted: without the count,
    the second one in would save, and later restore, the first one's limit.
    """
    with _blas_lock:
        _blas_holds.append(None if _blas_holds else _limit())
    try:
        yield
    finally:
        with _blas_lock:
            first = _blas_holds[0]
            _blas_holds.pop()
            if not _blas_holds:
                _restore(first)


def _limit() -> Any:
    """Set BLAS to one thread; return the limiter that restores the former number."""
    with _control() as controller:
        return controller.limit(limits=1, user_api="blas")


def _restore(limiter: Any) -> None:
    with _control():
        limiter.restore_original_limits()


@contextmanager
def _control() -> Iterator[Any]:
    """Let the calling thread set limits; from threadpoolctl 3.7 on, only the first thread that tries may."""
    controller = _controller("scipy.linalg" in sys.modules)
    libraries = [library for library in controller.lib_controllers if hasattr(library, "clear_controlling_thread")]
    for library in libraries:
        library.clear_controlling_thread(force=True)
    try:
        yield controller
    finally:
        for library in libraries:
            library.clear_controlling_thread(force=True)


@cache
def _controller(scipy_is_loaded: bool) -> Any:
    """Controller of the loaded BLAS libraries; SciPy brings its own, which is loaded later than NumPy's."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


@contextmanager
def _held_over_fork() -> Iterator[None]:
    """Over a fork, hold BLAS to one thread if another thread may be calling it.

    OpenBLAS takes locks to work in several threads and to change their number; a lock held by a thread that does not
    exist in the child is never released. With one thread OpenBLAS takes no locks, so the child stays with one. The
    limit is set here even if another caller holds one already, since other libraries may have restored theirs
    meanwhile.
    """
    global _limited  # noqa: PLW0603 - read in the child
    parent = os.getpid()
    with _blas_lock:
        _limited = active_count() > 1
        limiter = _limit() if _limited else None
        yield
        if limiter is not None and os.getpid() == parent:
            _restore(limiter)


def _in_child() -> None:
    """Add a hold that is never released, so that no call changes the number of threads in the child."""
    global _blas_lock  # noqa: PLW0603 - another thread may have held it
    _blas_lock = Lock()
    if _limited or _blas_holds:
        _blas_holds.append(None)


at_fork(_held_over_fork, _in_child)
