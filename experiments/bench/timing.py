"""Timing rivals fairly: warmed up, taken in turns, the median of each."""

from __future__ import annotations

import gc
from collections.abc import Callable
from time import perf_counter

import numpy as np

from kineme.runtime.parallel import single_threaded_blas


def medians(rivals: dict[str, Callable[[], object]], repeats: int, warm_up: int = 2) -> dict[str, float]:
    """Median seconds of each rival. In turns, so that a slow spell of the machine falls on all of them."""
    times: dict[str, list[float]] = {name: [] for name in rivals}
    for turn in range(warm_up + repeats):
        for name, work in rivals.items():
            gc.collect()
            begin = perf_counter()
            result = work()
            elapsed = perf_counter() - begin
            del result
            if turn >= warm_up:
                times[name].append(elapsed)
    return {name: float(np.median(values)) for name, values in times.items()}


def alone(work: Callable[[], object]) -> Callable[[], object]:
    """The work with BLAS on one thread: faster for a peer's many tiny products, by far on a busy machine."""

    def single_threaded() -> object:
        with single_threaded_blas():
            return work()

    return single_threaded
