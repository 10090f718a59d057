"""Work over row tiles in a few threads.

Compiled kernels are single-threaded and release the GIL; parallelism is a short-lived thread pool,
which survives forks and concurrent callers, unlike Numba's own parallel layers.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from kineme.errors import SpecificationError


def n_threads() -> int:
    """Threads to use: ``KINEME_NUM_THREADS`` if set, else the processors this process may use."""
    wanted = os.environ.get("KINEME_NUM_THREADS")
    if wanted is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if not wanted.isdigit() or int(wanted) < 1:
        raise SpecificationError(f"expected KINEME_NUM_THREADS to be a whole number from 1, got {wanted!r}")
    return int(wanted)


def for_tiles(work: Callable[[int, int], object], n_rows: int, tile_rows: int) -> None:
    """Call ``work(start, stop)`` for consecutive row ranges that cover ``range(n_rows)``.

    Parameters
    ----------
    work : callable
        Writes its own rows of a shared result; its return value is ignored.
    n_rows, tile_rows : int
        Number of rows in all, and at most this many in one call.
    """
    tiles = [(start, min(start + tile_rows, n_rows)) for start in range(0, n_rows, tile_rows)]
    threads = min(n_threads(), len(tiles))
    if threads <= 1:
        for start, stop in tiles:
            work(start, stop)
        return
    with ThreadPoolExecutor(threads) as pool:
        for result in [pool.submit(work, *tile) for tile in tiles]:
            result.result()
