"""Write an episode of LeRobot, version 3.0: into a new data set, or behind the others of one that is there."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.lerobot.info import MARKER, read_json
from kineme.io.records import needs
from kineme.reporting.atomic import whole_folder, write_atomically
from kineme.validation import Array

_QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}

Statistics = dict[str, list[Any]]  # min, max, mean, std, count and quantiles, a number for each entry

_DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_EPISODES = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_TASKS, _STATISTICS = "meta/tasks.parquet", "meta/stats.json"
_COUNTERS = ("frame_index", "episode_index", "index", "task_index")
_IN_CHUNK = 1000  # files

Features = Mapping[str, Array]  # feature -> (T, d)


def write_episode(
    folder: Path, features: Features, entries: Mapping[str, str | None], fps: float, task: str, robot: str
) -> int:
    """Write one episode, and return its number; every file is written whole or not at all, what counts episodes last.

    It begins a new folder, or is the last one of a data set of version 3 with the same features, names and rate.
    `features` such as ``action`` have the entries that `entries` names, each with its unit, None where it is not known.
    """
    with needs("pyarrow", "write LeRobot", "parquet"):
        import pyarrow  # noqa: F401 - so that the message names the extra
    vector = {"dtype": "float32", "shape": [len(entries)], "names": list(entries), "units": list(entries.values())}
    counter = {"dtype": "int64", "shape": [1], "names": None}
    stamp = {"timestamp": {"dtype": "float32", "shape": [1], "names": None}}
    entry = {**dict.fromkeys(features, vector), **stamp, **dict.fromkeys(_COUNTERS, counter)}
    if (folder / MARKER).is_file():
        info = read_json(folder / MARKER, MARKER)
        _check(info, entry, fps)
        return _append(folder, info, features, task)
    info = {
        "codebase_version": "v3.0", "fps": int(fps) if float(fps).is_integer() else fps, "features": entry,
        "total_episodes": 0, "total_frames": 0, "total_tasks": 0, "chunks_size": _IN_CHUNK,
        "data_files_size_in_mb": 100, "video_files_size_in_mb": 200, "data_path": _DATA, "video_path": None,
        "robot_type": robot, "splits": {},
    }  # fmt: skip
    with whole_folder(folder) as hidden:
        return _append(hidden, info, features, task)


def _check(info: Any, entry: Mapping[str, Any], fps: float) -> None:
    version, declared = info.get("codebase_version"), info.get("features")
    if not str(version).startswith("v3."):
        raise DataError(f"expected a LeRobot data set of version 3 to append to, got {version}")
    if info.get("fps") != fps:
        raise DataError(f"expected the {info.get('fps')} frames per second of the data set, got {fps:g}")
    if info.get("data_path") != _DATA:
        raise DataError(f"expected a data set with the data_path {_DATA}, got {info.get('data_path')}")
    if declared != entry:
        differing = sorted(name for name in {*declared, *entry} if declared.get(name) != entry.get(name))
        raise DataError(
            f"expected the features of the data set to append to it; they differ in {', '.join(differing)}: "
            f"{declared.get(differing[0])} there, {entry.get(differing[0])} here"
        )


def _append(folder: Path, info: dict[str, Any], features: Features, task: str) -> int:
    """Write data first, then tasks, the episode, statistics, and info, which counts them."""
    number, start = int(info["total_episodes"]), int(info["total_frames"])
    length = len(next(iter(features.values())))
    tasks = _tasks(folder)
    has_task = task in tasks
    tasks = tasks if has_task else [*tasks, task]
    from pyarrow import parquet

    last = -1  # the file behind all that hold an earlier episode; one that was never counted is written over
    for path in (folder / "meta" / "episodes").glob("chunk-*/file-*.parquet"):
        table = parquet.read_table(path, columns=["episode_index", "data/chunk_index", "data/file_index"]).to_pydict()
        for episode, *numbers in zip(*table.values(), strict=True):
            if episode < number:
                own = (int(path.parent.name.removeprefix("chunk-")), int(path.stem.removeprefix("file-")))
                last = max([last, *(chunk * _IN_CHUNK + file for chunk, file in (own, numbers))])
    place = {"chunk_index": (last + 1) // _IN_CHUNK, "file_index": (last + 1) % _IN_CHUNK}
    frame = np.arange(length)
    columns: dict[str, NDArray[Any]] = {
        **{name: np.asarray(values, dtype=np.float32) for name, values in features.items()},
        "timestamp": (frame / info["fps"]).astype(np.float32),
        "frame_index": frame,
        "episode_index": np.full(length, number),
        "index": start + frame,
        "task_index": np.full(length, tasks.index(task)),
    }
    statistics = {name: statistics_of(values) for name, values in columns.items()}
    _write(folder / _DATA.format(**place), {name: _column(values) for name, values in columns.items()})
    if not has_task:
        # The texts are the index, as pandas and LeRobot read it.
        index = {
            "index_columns": ["task"], "column_indexes": [], "pandas_version": "2.2.3",
            "columns": [
                {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
                for name, kind, numpy in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
            ],
        }  # fmt: skip
        rows = {"task_index": np.arange(len(tasks)), "task": list(tasks)}
        _write(folder / _TASKS, rows, {"pandas": json.dumps(index)})
    row: dict[str, Any] = {
        "episode_index": number, "tasks": [task], "length": length, "data/chunk_index": place["chunk_index"],
        "data/file_index": place["file_index"], "dataset_from_index": start, "dataset_to_index": start + length,
        **{f"stats/{name}/{key}": value for name, values in statistics.items() for key, value in values.items()},
        "meta/episodes/chunk_index": place["chunk_index"], "meta/episodes/file_index": place["file_index"],
    }  # fmt: skip
    _write(folder / _EPISODES.format(**place), {name: [value] for name, value in row.items()})
    before = read_json(folder / _STATISTICS, _STATISTICS) if number else {}
    _write_json(
        folder / _STATISTICS, {name: merged_statistics(before.get(name), values) for name, values in statistics.items()}
    )
    counts = {"total_episodes": number + 1, "total_frames": start + length, "total_tasks": len(tasks)}
    _write_json(folder / MARKER, info | counts | {"splits": {"train": f"0:{number + 1}"}})
    return number


def _tasks(folder: Path) -> list[str]:
    from pyarrow import parquet

    if not (folder / _TASKS).is_file():
        return []
    table = parquet.read_table(folder / _TASKS).to_pydict()
    texts = table.get("task", table.get("__index_level_0__"))
    if texts is None or sorted(table["task_index"]) != list(range(len(texts))):
        raise DataError(f"expected {_TASKS} with a text for each task from 0 on, got another one")
    return [text for _, text in sorted(zip(table["task_index"], texts, strict=True))]


def _column(values: NDArray[Any]) -> Any:
    import pyarrow as pa

    if values.ndim == 1:
        return pa.array(values)
    return pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), values.shape[1])


def _write(path: Path, columns: Mapping[str, Any], metadata: dict[str, str] | None = None) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    buffer = io.BytesIO()
    parquet.write_table(pa.table(dict(columns)).replace_schema_metadata(metadata), buffer)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, buffer.getvalue())


def _write_json(path: Path, content: Any) -> None:
    write_atomically(path, (json.dumps(content, indent=4, ensure_ascii=False) + "\n").encode())


def statistics_of(values: NDArray[Any]) -> Statistics:
    """Return statistics of one feature over the frames of an episode, values of shape (T,) or (T, d)."""
    rows = np.asarray(values, dtype=np.float64).reshape(len(values), -1)
    statistics = {name: getattr(rows, name)(axis=0).tolist() for name in ("min", "max", "mean", "std")}
    quantiles = np.quantile(rows, list(_QUANTILES.values()), axis=0).tolist()
    return {**statistics, "count": [len(rows)], **dict(zip(_QUANTILES, quantiles, strict=True))}


def merged_statistics(first: Statistics | None, second: Statistics) -> Statistics:
    """Merge the statistics of two parts of the frames; the quantiles are weighted means, as LeRobot takes them."""
    if first is None:
        return second
    a, b = (
        {name: np.asarray(values, dtype=np.float64) for name, values in statistics.items()}
        for statistics in (first, second)
    )
    n = a["count"] + b["count"]
    share = b["count"] / n
    mean = a["mean"] + share * (b["mean"] - a["mean"])
    variance = (1 - share) * a["std"] ** 2 + share * b["std"] ** 2 + share * (1 - share) * (b["mean"] - a["mean"]) ** 2
    merged = {
        "min": np.minimum(a["min"], b["min"]), "max": np.maximum(a["max"], b["max"]), "mean": mean,
        "std": np.sqrt(variance),
    }  # fmt: skip
    merged |= {name: a[name] + share * (b[name] - a[name]) for name in _QUANTILES if name in a}
    return {**{name: values.tolist() for name, values in merged.items()}, "count": [int(n[0])]}
