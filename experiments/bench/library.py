"""The action library: 200,000 movements learned, served, and recognized in two stages, against comparing all.

``KINEME_BENCH_MOVEMENTS=2000000`` takes another number of movements in the plane; its results go to a file of its own.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

import kineme
from bench.library_movements import ASKED, N_SAMPLES, SHOWN, copies, kinds
from bench.movements import SEED, Array
from bench.rows import Row, save, table
from kineme.library.recognize import LibraryRecognizer
from kineme.similarity.describe import describe

_BATCH = 50_000  # movements in one call
_PER_KIND = 200


def measure(quick: bool) -> list[Row]:
    wanted = os.environ.get("KINEME_BENCH_MOVEMENTS")
    if wanted and not quick:
        load = os.getloadavg()[0]
        rows = _measure(int(wanted), 2, 100)
        print(f"\n{table(rows)}\nsaved {save(f'library-{int(wanted)}', rows, load)}")
        return []
    if quick:
        return _measure(5_000, 2, 50)
    return _measure(200_000, 2, 500) + _measure(20_000, 3, 40)


def _measure(n: int, n_dims: int, n_questions: int) -> list[Row]:
    paths = kinds(max(2, n // _PER_KIND), n_dims)
    random = np.random.default_rng(SEED)
    half = n_questions // 2
    truth = random.integers(0, len(paths), n_questions)
    asked = [copies(paths, part, SEED + k, how) for k, (part, how) in enumerate(
        ((truth[:half], SHOWN), (truth[half:], ASKED)))]  # fmt: skip
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "actions"
        rate = _learn(folder, paths, random.integers(0, len(paths), n))
        questions = Path(name) / "questions.npy"
        np.save(questions, np.concatenate([one.positions.reshape(-1, N_SAMPLES, n_dims) for one in asked]))
        cold, warm = _serve(folder, questions), _serve(folder, questions)
        disk = sum(path.stat().st_size for path in folder.iterdir())
        with kineme.ActionLibrary(folder) as library:
            best = _exhaustive(library, np.load(questions))
            width = sum(library.specification.widths(n_dims))
    labels = [f"kind {k:05d}" for k in truth]
    ranked = [one[1] for one in warm["found"]]
    ours, theirs = (float(np.mean([a == b for a, b in zip(one, labels, strict=True)])) for one in (ranked, best))
    agreement = float(np.mean([a == b for a, b in zip(ranked, best, strict=True)]))
    plain = 4 * n * (N_SAMPLES * n_dims + width)
    details = {"n": n, "dims": n_dims, "kinds": len(paths), "questions": n_questions, "seed": SEED}
    details |= {key: value for key, value in warm.items() if key != "found"}
    details |= {"accuracy": ours, "accuracy_exhaustive": theirs, "first_without_caches": cold["first"]}
    details |= {"unknown": float(np.mean([one[0] is None for one in warm["found"]]))}
    details |= {"shown": repr(SHOWN), "asked": [repr(SHOWN), repr(ASKED)]}
    held = n == 200_000 and n_dims == 2  # what was set as targets
    what = f"{n:,} movements, {n_dims}-D"
    return [
        Row(f"{what}: learn", "/s", rate, target=(">=", 20_000.0) if held else None, details=details),
        Row("  disk, of raw float32 and features", "x", disk / plain, target=("<=", 1.5)),
        Row("  open", "ms", 1000 * warm["open"], target=("<=", 1000.0)),
        Row("  first answer, with caches", "ms", 1000 * warm["first"]),
        Row("  first answer, caches made", "ms", 1000 * cold["first"]),
        Row("  recognize one, median", "ms", 1000 * warm["median"], target=("<=", 20.0) if held else None),
        Row("  recognize one, processor time", "ms", 1000 * warm["processor"]),
        Row("  same class as comparing all", "", agreement, target=(">=", 0.99)),
        Row("  accuracy", "", ours, theirs, "comparing all", ours / theirs, (">=", 0.99)),
        Row("  memory while serving, peak", "MB", warm["megabytes"], target=("<=", 500.0) if held else None),
        Row("  memory while caches are made, peak", "MB", cold["megabytes"]),
    ]


def _learn(folder: Path, paths: Array, which: Any) -> float:
    """Movements learned per second; making them up is not counted."""
    seconds = 0.0
    with kineme.ActionLibrary(folder, create=True) as library:
        for start in range(0, len(which), _BATCH):
            demos = copies(paths, which[start : start + _BATCH], start, SHOWN)
            begin = perf_counter()
            library.learn(demos)
            seconds += perf_counter() - begin
    return len(which) / seconds


def _serve(folder: Path, questions: Path) -> dict[str, Any]:
    command = [sys.executable, "-m", "bench.library_serving", str(folder), str(questions)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=Path(__file__).parents[1])
    return dict(json.loads(done.stdout))


def _exhaustive(library: Any, asked: Array) -> list[str]:
    """The symbol of the most similar of all movements, by the same averaged kernel."""
    comparison = LibraryRecognizer(library.store, exhaustive=0).current().model.comparison
    described = describe(asked, comparison)
    ids = library.ids()
    ends = np.cumsum(library.specification.widths(library.n_dims))[:-1]
    kept = [library.specification.comparison.by_rows.index(by_row) for by_row in comparison.specification.by_rows]
    top, best = np.full(len(asked), -np.inf), np.zeros(len(asked), dtype=np.int64)
    for start in range(0, len(ids), 4096):
        blocks = np.split(library.features(ids[start : start + 4096]), ends, axis=1)
        stored = comparison.prepared(tuple(blocks[r] for r in kept))
        logs = comparison.similarity.log_average(described, stored)
        nearest = logs.max(axis=1)
        better = nearest > top
        top[better], best[better] = nearest[better], ids[start + logs.argmax(axis=1)[better]]
    return [str(label) for label in library.movements(ids=best).labels]
