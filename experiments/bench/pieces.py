"""Archives in pieces: what planning, processes and more movements cost.

The movements of an archive are 20,000 in each file, a hundred samples in the plane. Ten files differ; the others are
further names of these, so that ten million movements take the room of two hundred thousand.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import process_time

import numpy as np

from bench.motion_layer import Cost, _run, _taught
from bench.rows import Row
from bench.work_sets import work_episodes, write_set

_IN_A_FILE, _DISTINCT, _SAMPLES = 20_000, 10, 100
_MEMORY = 1024.0  # MB of a worker, at most
_FILES = 100_000
_MOST_WRITTEN = 1_000_000  # movements whose parts are on the disk: of ten million they are 30 GB
_SMALL = 1  # MiB of a piece of the data set, so that there are several


def measure(quick: bool) -> list[Row]:
    counts = (100_000, 200_000) if quick else (100_000, 1_000_000, 10_000_000)
    return [*_planned(), *_by_processes((12, 24) if quick else (60, 240)), *_by_movements(counts)]


def _planned() -> Iterator[Row]:
    """Time to plan an archive of small files."""
    from kineme.pieces import plan

    with tempfile.TemporaryDirectory() as name:
        for k in range(_FILES):
            if not k % 1000:
                folder = Path(name) / f"{k // 1000:03d}"
                folder.mkdir()
            (folder / f"{k:06d}.csv").write_text("t,x\n0,0\n1,1\n")
        before = process_time()
        pieces = len(plan(name).pieces)
        taken = process_time() - before
    yield Row(f"plan {_FILES:,} files", "s", taken, target=("<=", 10.0), details={"pieces": pieces})


def _by_processes(counts: tuple[int, int]) -> Iterator[Row]:
    """Processor time and memory of annotating data sets of two sizes, by one process and by several in pieces.

    The start of a process, and what it prepares of the library, cost the same whatever the size: the line through both
    sizes tells what more of the archive costs.
    """
    costs: dict[str, list[Cost]] = {}
    for count in counts:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            library = _taught(folder, 200, 1)
            write_set(folder / "set", (work.episode for work in work_episodes(count, 200, (0, 1, 2, 3))))
            command = ("annotate", folder / "set", "--library", library)
            costs.setdefault("one process", []).append(_run(*command, "-o", folder / "labels.csv"))
            for n in (1, 2):
                divided = ("--piece-size", _SMALL, "--workers", n)
                costs.setdefault(f"workers {n}", []).append(_run(*command, *divided, "-o", folder / f"out{n}"))
            costs.setdefault("gather", []).append(_run("gather", folder / "out2", "-o", folder / "gathered.csv"))
    seconds = {name: [cost.seconds for cost in both] for name, both in costs.items()}
    slopes = {name: (large - small) / (counts[1] - counts[0]) for name, (small, large) in seconds.items()}
    details = {"seconds": seconds, "episodes": counts, "an_episode": slopes}
    share = slopes["workers 2"] / slopes["workers 1"]
    what = f"annotate, each of {counts[0]} to {counts[1]} episodes more: two workers' processor time of one's"
    yield Row(what, "x", share, target=("<=", 1.1), details=details)
    yield Row("  of that without pieces", "x", slopes["workers 2"] / slopes["one process"], details=details)
    first = seconds["workers 2"][1] / seconds["workers 1"][1]
    yield Row(f"  of all {counts[1]}, starting of processes included", "x", first, details=details)
    yield Row("  memory of a worker", "MB", costs["workers 2"][1].memory, target=("<=", _MEMORY))


def _by_movements(counts: tuple[int, ...]) -> Iterator[Row]:
    """Processor time of commands over archives of more and more movements, and how far from a line it is."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rng = np.random.default_rng(0)
        originals = []
        for k in range(_DISTINCT):
            steps = rng.normal(size=(_IN_A_FILE, _SAMPLES, 2)).astype(np.float32)
            path = folder / f"original{k}.npz"
            labels = np.array([f"kind {j % 20}" for j in range(_IN_A_FILE)])
            np.savez(path, positions=steps.cumsum(axis=1), labels=labels)
            originals.append(path)
        for count in counts:
            (folder / str(count)).mkdir()
            for k in range(count // _IN_A_FILE):
                os.link(originals[k % _DISTINCT], folder / str(count) / f"{k:06d}.npz")
        yield from _of_counts(folder, "inspect", counts)
        _run("learn", originals[0], "--units", 0.01, "--library", folder / "actions")
        written = tuple(count for count in counts if count <= _MOST_WRITTEN)
        yield from _of_counts(folder, "features", written, "--library", folder / "actions")
        yield from _of_counts(folder, "learn", written, "--library", folder / "learned")


def _of_counts(folder: Path, command: str, counts: tuple[int, ...], *options: object) -> Iterator[Row]:
    """The same of one command, whose parts are removed again."""
    taken: dict[int, Cost] = {}
    for count in counts:
        output = folder / f"{command}-{count}"
        taken[count] = _run(command, folder / str(count), *options, "--units", 0.01, "-o", output, "--workers", 2)
        shutil.rmtree(output)
    small, *_, large = counts
    slope = (taken[large].seconds - taken[small].seconds) / (large - small)
    for count, cost in taken.items():
        line = taken[small].seconds + slope * (count - small)
        details = {"movements": count, "of_the_line": cost.seconds / line - 1.0}
        yield Row(f"{command} {count:,} movements, two workers", "s of processors", cost.seconds, details=details)
        yield Row("  memory of a process", "MB", cost.memory, target=("<=", _MEMORY))
    rate = taken[large].seconds / large / (taken[counts[-2]].seconds / counts[-2])
    yield Row("  per movement, of that of the archive before", "x", rate, target=("<=", 1.05))
