"""The nearest among 100,000, a million and ten million movements in shards, exactly: time, memory, what is compared.

Feature rows of bent handwriting are mixed with others of their kind, so that there are as many as wanted. Movements
that are asked for are drawn anew and perturbed more; strangers are of kinds that the archive does not hold. Files of
ten million take 24 GB in the folder for temporary files while it runs. ``KINEME_BENCH_MOVEMENTS`` takes another number.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

import kineme
from bench.library_movements import ASKED, SHOWN, copies, kinds
from bench.movements import SEED, Array
from bench.rows import Row
from kineme.pieces.scan import best_of, scan
from kineme.pieces.search import CANDIDATES, Shards, open_shards
from kineme.pieces.shards import Reduction, bases_digest, fit_reduction, write_reduction, write_shard
from kineme.similarity.bounds import log_bounds, reduce_features
from kineme.similarity.describe import feature_rows

COUNTS = (100_000, 1_000_000, 10_000_000)
_KINDS, _STRANGERS = 300, 40
_OF_KIND = 60  # movements of a kind that others are mixed of
_SHARD = 250_000  # movements
_TOGETHER, _ALONE = 100, 30
_CHECKED = 3  # movements whose candidates are compared with those of comparing all, up to a million


def measure(quick: bool) -> list[Row]:
    wanted = os.environ.get("KINEME_BENCH_MOVEMENTS")
    counts = (20_000,) if quick else (int(wanted),) if wanted else COUNTS
    rows = []
    for count in counts:
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place) / "shards"
            size = _write(folder, count)
            command = [sys.executable, "-m", "bench.shards", str(folder)]
            first, took = (json.loads(subprocess.run(command, stdout=subprocess.PIPE, check=True).stdout) for _ in "12")
            index = sum(file.stat().st_size for path in folder.glob("search-*") for file in path.iterdir())
        rows += _rows(count, size, index, first, took)
    return rows


def _rows(count: int, size: int, index: int, first: dict[str, Any], took: dict[str, Any]) -> list[Row]:
    """Rows of one number of movements; wall times of a busy machine are bounds, processor times count."""
    largest = count == max(COUNTS)
    details = {"movements": count, **took}
    return [
        Row(f"{count:,}: files, a movement", "bytes", size / count, details=details),
        Row(f"{count:,}: indexes, a movement", "bytes", index / count),
        Row(f"{count:,}: indexes made, a million movements, processor", "s", first["index"] / count * 1e6),
        Row(f"{count:,}: opened", "s", took["open"]),
        Row(f"{count:,}: one, median, wall", "s", took["alone"]["median"], target=("<=", 0.3) if largest else None),
        Row(f"{count:,}: one, largest, wall", "s", took["alone"]["largest"]),
        Row(f"{count:,}: one, processor", "s", took["alone"]["processor"]),
        Row(f"{count:,}: one, of it the first stage, processor", "s", took["first stage"]["processor"]),
        Row(f"{count:,}: one stranger, processor", "s", took["strangers"]["processor"]),
        Row(f"{count:,}: 100 at once, wall", "s", took["together"]["wall"], target=("<=", 3.0) if largest else None),
        Row(f"{count:,}: 100 at once, processor", "s", took["together"]["processor"]),
        Row(f"{count:,}: movements compared in the first stage, one", "share", took["compared"]),
        Row(f"{count:,}: the same, a stranger", "share", took["compared of strangers"]),
        Row(f"{count:,}: blocks that no bound rules out, one", "share", took["blocks"]),
        Row(f"{count:,}: memory beside mapped files", "MB", took["megabytes"]),
        *([Row(f"{count:,}: candidates as of comparing all", "share", took["right"], target=(">=", 1.0))]
          if "right" in took else []),
    ]  # fmt: skip


def _write(folder: Path, count: int) -> int:
    """Write shards of so many movements; return their bytes."""
    import pyarrow as pa

    folder.mkdir()
    reduction, blocks = _reduction(), _feature_rows()
    write_reduction(folder, reduction)
    total = 0
    for k, start in enumerate(range(0, count, _SHARD)):
        n = min(_SHARD, count - start)
        rows, reduced = _mixed(reduction, blocks, n, np.random.default_rng([SEED, k]))
        numbers = {"rows": rows, "reduced": reduced}
        columns: dict[str, Any] = {
            "path": pa.DictionaryArray.from_arrays(np.arange(n, dtype=np.int32) // 100, _names(k, n)),
            "place": [str(i % 100) for i in range(n)],
            "label": pa.nulls(n, pa.string()),
            "start": np.zeros(n),
            "duration": np.ones(n),
        }
        columns |= {
            name: pa.FixedSizeListArray.from_arrays(part.ravel(), part.shape[1]) for name, part in numbers.items()
        }
        table = pa.table(columns).replace_schema_metadata({b"kineme.bases": bases_digest(reduction.bases)})
        path = folder / f"part-{k:04d}.arrow"
        write_shard(path, [table])
        total += path.stat().st_size
    return total


def _names(k: int, n: int) -> list[str]:
    return [f"session {k:04d}/file {i:05d}.csv" for i in range(-(-n // 100))]


def _reduction() -> Reduction:
    shown = copies(kinds(_KINDS, 2), np.repeat(np.arange(_KINDS), 8), SEED, SHOWN)
    with tempfile.TemporaryDirectory() as place, kineme.ActionLibrary(Path(place) / "actions", create=True) as library:
        library.learn(shown)
        return fit_reduction(library.store)


def _feature_rows() -> tuple[Array, ...]:
    """Feature rows of 60 movements of each kind, in its order."""
    demos = copies(kinds(_KINDS, 2), np.repeat(np.arange(_KINDS), _OF_KIND), SEED + 1, SHOWN)
    specification = kineme.Recognizer().specification
    return tuple(block.astype(np.float32) for block in feature_rows(demos, specification))


def _mixed(reduction: Reduction, blocks: tuple[Array, ...], n: int, random: np.random.Generator) -> tuple[Any, Any]:
    """Feature rows (n, W) and reduced features of mixtures of two movements of a kind, of the norm of the first."""
    first = random.integers(0, len(blocks[0]), n)
    second = first // _OF_KIND * _OF_KIND + random.integers(0, _OF_KIND, n)
    share = random.uniform(-0.3, 0.7, (n, 1)).astype(np.float32)
    rows = np.empty((n, sum(block.shape[1] for block in blocks)), np.float32)
    reduced, done = [], 0
    for r, block in enumerate(blocks):
        mixed = block[first]
        norms = np.linalg.norm(mixed, axis=1, keepdims=True)
        mixed += share * (block[second] - mixed)
        mixed *= norms / np.linalg.norm(mixed, axis=1, keepdims=True)
        rows[:, done : done + block.shape[1]] = mixed
        done += block.shape[1]
        if r < len(reduction.bases):
            features = reduce_features(reduction.bases[r : r + 1], (mixed,), 2)[0]
            reduced.append(np.column_stack(features))
    return rows, np.ascontiguousarray(np.concatenate(reduced, axis=1))


def run(folder: Path) -> dict[str, Any]:
    """Search in a process of its own; the first one makes the indexes."""
    begin = perf_counter()
    shards = open_shards(folder)
    opened, processor = perf_counter() - begin, process_time()
    shards.prepare()
    processor = process_time() - processor
    random = np.random.default_rng(SEED + 2)
    paths = kinds(_KINDS + _STRANGERS, 2)
    asked = copies(paths, random.integers(0, _KINDS, _TOGETHER), SEED + 3, ASKED)
    strangers = copies(paths, _KINDS + np.arange(_STRANGERS), SEED + 4, ASKED)
    shards.nearest(asked[:2])  # reads what is mapped
    queries, unlike = shards.described(asked)[1], shards.described(strangers)[1]
    answer: dict[str, Any] = {"open": opened, "index": processor}
    answer["alone"] = _timed(shards.nearest, (asked[i : i + 1] for i in range(_ALONE)))
    answer["first stage"] = _timed(shards.candidates, ([query] for query in queries[:_ALONE]))
    answer["strangers"] = _timed(shards.candidates, ([query] for query in unlike[:_ALONE]))
    answer["together"] = _timed(shards.nearest, [asked])
    answer["compared"], answer["blocks"] = _compared(shards, queries[:_ALONE])
    answer["compared of strangers"], _ = _compared(shards, unlike[:_ALONE])
    status = Path("/proc/self/status").read_text()
    answer["megabytes"] = float(status.partition("RssAnon:")[2].split()[0]) / 1024
    if len(shards) <= COUNTS[1]:
        answer["right"] = float(np.mean([_is_right(shards, query) for query in queries[:_CHECKED]]))
    return answer


def _timed(function: Callable[[Any], object], arguments: Any) -> dict[str, float]:
    wall, processor = [], process_time()
    for argument in arguments:
        begin = perf_counter()
        function(argument)
        wall.append(perf_counter() - begin)
    used = (process_time() - processor) / len(wall)
    return {"wall": sum(wall), "median": float(np.median(wall)), "largest": max(wall), "processor": used}


def _compared(shards: Shards, queries: list[Any]) -> tuple[float, float]:
    """Shares of movements that are compared, and of blocks whose bound reaches the last candidate's score."""
    compared, reached, blocks = 0.0, 0, 0
    plan = shards.plan[0]
    for query in queries:
        best = best_of(CANDIDATES)
        for _, group in shards.groups:
            scan(plan, group.rows, query, best, 0)
        compared += float(best.state[2])
        for bounds in _block_bounds(shards, query):
            reached, blocks = reached + int((bounds >= best.scores[0]).sum()), blocks + len(bounds)
    return compared / len(queries) / len(shards), reached / blocks


def _block_bounds(shards: Shards, query: Any) -> Iterator[Array]:
    plan = shards.plan[0]
    for _, group in shards.groups:
        away = (np.clip(query.marks, group.rows.lows, group.rows.highs) - query.marks) ** 2
        parts = np.split(away, np.cumsum(plan.n_marks)[:-1], axis=1)
        halves = 0.5 / plan.similarity.widths**2
        logs = [log - part.sum(axis=1) * half for log, part, half in zip(plan.log_weights, parts, halves, strict=True)]
        yield np.logaddexp.reduce(np.stack(logs), axis=0)


def _is_right(shards: Shards, query: Any) -> bool:
    plan = shards.plan[0]
    asked, scores = plan.features(query.reduced[None]), []
    for _, group in shards.groups:
        for start in range(0, len(group.rows.reduced), 2**16):
            stored = plan.features(group.rows.reduced[start : start + 2**16])
            scores.append(log_bounds(plan.similarity, asked, stored)[0].astype(np.float32))
    best = shards.candidates([query])[0].scores
    return bool(np.array_equal(np.sort(best), np.sort(np.concatenate(scores))[-len(best) :]))


if __name__ == "__main__":
    sys.stdout.write(json.dumps(run(Path(sys.argv[1]))))
