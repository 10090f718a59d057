"""A data set of LeRobot with 1,000,000 frames of 14 channels, read and learned into a library."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

import kineme
from bench.movements import SEED
from bench.rows import Row

_CHANNELS, _FPS, _PER_SHARD = 14, 50, 250_000  # frames in a shard
_TASKS, _SHORT = 20, 100  # frames in an episode, of the target


def measure(quick: bool) -> list[Row]:
    rows = []
    for frames, length in ((50_000, _SHORT),) if quick else ((1_000_000, _SHORT), (1_000_000, 400)):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name) / "set"
            write_data_set(folder, frames // length, length)
            rows += _measure(folder, Path(name) / "actions", frames, length)
    return rows


def _measure(folder: Path, library: Path, frames: int, length: int) -> list[Row]:
    episodes = frames // length
    begin = perf_counter()
    read = kineme.read_recordings(folder)
    seconds = perf_counter() - begin
    with kineme.ActionLibrary(library, create=True) as actions:
        begin = perf_counter()
        added = actions.learn(read).added
        learned = perf_counter() - begin
    assert added == episodes
    bare = _bare(folder)
    what = f"{frames:,} frames, {_CHANNELS} channels, {length} in an episode"
    details: dict[str, Any] = {"episodes": episodes, "seconds": {"read": seconds, "learn": learned, "bare": bare}}
    rate = 60 * episodes / (seconds + learned)
    target = (">=", 20_000.0) if length == _SHORT else None
    return [
        Row(f"{what}: read and learn", "episodes/min", rate, target=target, details=details),
        Row("  read", "frames/s", frames / seconds, frames / bare, "pyarrow's read of the columns", bare / seconds),
        Row("  learn", "episodes/s", episodes / learned),
    ]


def _bare(folder: Path) -> float:
    """Seconds of pyarrow alone for the columns that are needed."""
    from pyarrow import parquet

    begin = perf_counter()
    for shard in sorted(folder.glob("data/*/*.parquet")):
        columns = ["observation.state", "timestamp", "frame_index", "episode_index", "task_index"]
        table = parquet.read_table(shard, columns=columns, use_threads=False)
        table.column("observation.state").combine_chunks().flatten().to_numpy()
    return perf_counter() - begin


def write_data_set(folder: Path, episodes: int, length: int) -> None:
    """A data set of version 3.0 whose episodes are smooth, all different, of 20 tasks."""
    import pyarrow as pa
    from pyarrow import parquet

    random = np.random.default_rng(SEED)
    per_shard = max(1, _PER_SHARD // length)
    (folder / "meta" / "episodes" / "chunk-000").mkdir(parents=True)
    (folder / "data" / "chunk-000").mkdir(parents=True)
    vector = {"dtype": "float32", "shape": [_CHANNELS], "names": {"motors": [f"joint_{k}" for k in range(_CHANNELS)]}}
    info = {
        "codebase_version": "v3.0", "fps": _FPS, "total_episodes": episodes, "total_frames": episodes * length,
        "chunks_size": 1000, "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "features": {"observation.state": vector, "action": vector}, "robot_type": "bench",
    }  # fmt: skip
    (folder / "meta" / "info.json").write_text(json.dumps(info), encoding="utf-8")
    paths = _paths(random, _TASKS, length)
    for first in range(0, episodes, per_shard):
        numbers = np.arange(first, min(first + per_shard, episodes))
        state = paths[numbers % _TASKS] * random.uniform(0.8, 1.2, (len(numbers), 1, _CHANNELS))
        state = (state + 0.1 * _paths(random, len(numbers), length)).astype(np.float32).reshape(-1, _CHANNELS)
        lists = pa.FixedSizeListArray.from_arrays(pa.array(state.ravel()), _CHANNELS)
        frame = np.tile(np.arange(length), len(numbers))
        columns = {
            "observation.state": lists, "action": lists, "timestamp": (frame / _FPS).astype(np.float32),
            "frame_index": frame, "episode_index": np.repeat(numbers, length),
            "index": np.repeat(numbers, length) * length + frame, "task_index": np.repeat(numbers % _TASKS, length),
        }  # fmt: skip
        parquet.write_table(pa.table(columns), folder / "data" / "chunk-000" / f"file-{first // per_shard:03d}.parquet")
    known = np.arange(episodes)
    table = {
        "episode_index": known, "tasks": [[f"task {k % _TASKS}"] for k in known.tolist()],
        "length": np.full(episodes, length), "data/chunk_index": np.zeros(episodes, np.int64),
        "data/file_index": known // per_shard, "dataset_from_index": known * length,
        "dataset_to_index": (known + 1) * length,
    }  # fmt: skip
    parquet.write_table(pa.table(table), folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    tasks = {"task_index": np.arange(_TASKS), "task": [f"task {k}" for k in range(_TASKS)]}
    parquet.write_table(pa.table(tasks), folder / "meta" / "tasks.parquet")


def _paths(random: np.random.Generator, n: int, length: int) -> Any:
    """Smooth paths (n, length, channels): sums of a few waves."""
    t = np.linspace(0.0, 1.0, length)[None, :, None]
    strength, phase = random.normal(size=(3, n, 1, _CHANNELS)), random.uniform(0, 6, (3, n, 1, _CHANNELS))
    return sum(strength[k] / (k + 1) * np.sin(3 * (k + 1) * t + phase[k]) for k in range(3))
