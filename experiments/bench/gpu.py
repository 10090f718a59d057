"""Primitives as modules of PyTorch on a GPU beside all cores of the processor of that machine, see `bench.tensors`."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from typing import Any

import kineme
from bench.rows import Row
from bench.tensors import DIMS, DURATION, RATE, N, numbers, ours
from bench.timing import medians

SIZES = {1: 50, 1024: 20, 100_000: 1}  # movements at once -> calls that are timed together
LEAST = 50.0  # times faster than the processor, of the largest batch


def measure(quick: bool) -> list[Row]:
    """Rows of one movement and of batches; targets are how many times faster the GPU is."""
    if not find_spec("torch"):
        print("not measured: torch is not installed", file=sys.stderr)
        return []
    import torch

    if not torch.cuda.is_available():
        print("not measured: no GPU for PyTorch", file=sys.stderr)
        return []
    torch.set_num_threads(os.cpu_count() or 1)
    return [row for n in (list(SIZES)[:2] if quick else SIZES) for row in _rows(n)]


def _rows(n: int) -> list[Row]:
    import torch

    card, cores = torch.cuda.get_device_name(), f"{torch.get_num_threads()} cores"
    calls, rows, on_processor = SIZES[n], [], _works(n, "cpu")
    for name, work in _works(n, "cuda").items():
        here = on_processor.get(name)
        rivals = {"gpu": partial(_finished, work, calls)}
        if here is not None:
            rivals["cpu"] = partial(_repeated, here, calls)
        seconds = medians(rivals, 5)
        ms = 1e3 * seconds["gpu"] / calls
        cpu_ms = None if here is None else 1e3 * seconds["cpu"] / calls
        target = (">=", LEAST) if n == max(SIZES) and cpu_ms else None
        ratio = cpu_ms / ms if cpu_ms else None
        rows.append(Row(f"{name}, {n} at once", "ms", ms, cpu_ms, cores, ratio, target, {"card": card}))
    return rows


def _works(n: int, device: str) -> dict[str, Callable[[], object]]:
    import torch

    mp = kineme.torch.Primitive(DIMS, N, rate=RATE, duration=DURATION, device=device)
    weights, start, goal = numbers(n, device)
    state = {"at": torch.full((n,), 0.7, device=device), "position": start, "velocity": torch.zeros_like(start)}
    works = ours(n, device) | {"replanning": lambda: mp.replan(weights, goal=goal, **state)}
    return works if device == "cpu" else works | {"rollout as a CUDA graph": _captured(works["rollout"])}


def _captured(work: Callable[[], object]) -> Callable[[], object]:
    """The same work, recorded once and repeated without the processor."""
    import torch

    work()
    graph = torch.cuda.CUDAGraph()
    with torch.cuda.graph(graph):
        results: Any = work()

    def repeat() -> Any:
        graph.replay()
        return results

    return repeat


def _repeated(work: Callable[[], object], calls: int) -> None:
    for _ in range(calls):
        work()


def _finished(work: Callable[[], object], calls: int) -> None:
    import torch

    _repeated(work, calls)
    torch.cuda.synchronize()
