"""The episodes of a data set of LeRobot: their lengths, their tasks, and the shards that hold them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.files.lerobot.info import Info
from kineme.files.limits import check_expanded

_V2 = "meta/episodes.jsonl"
_V3 = "meta/episodes/*/*.parquet"
_TASKS = ("meta/tasks.parquet", "meta/tasks.jsonl")
_SHARD = ("data/chunk_index", "data/file_index")


class Episodes(NamedTuple):
    """What is declared of the episodes, in their order.

    Attributes
    ----------
    numbers, lengths : ndarray of shape (n,)
    shards : list of n str
        The file that holds each, relative to the data set.
    """

    numbers: NDArray[np.int64]
    lengths: NDArray[np.int64]
    shards: list[str]


def read_episodes(folder: Path, info: Info) -> Episodes:
    """The episodes as meta/episodes says.

    Raises
    ------
    DataError
        It is missing or damaged, or names shards outside of the data set.
    """
    if info.version == 2:
        rows = list(_lines(folder / _V2))
        numbers = _whole([row.get("episode_index") for row in rows], "episode_index", _V2)
        lengths = _whole([row.get("length") for row in rows], "length", _V2)
        places = [{"episode_chunk": int(k) // info.chunk, "episode_index": int(k)} for k in numbers]
    else:
        table = _table(folder, ("episode_index", "length", *_SHARD))
        numbers, lengths, chunks, files = (
            _whole(table[name], name, _V3) for name in ("episode_index", "length", *_SHARD)
        )
        places = [{"chunk_index": c, "file_index": f} for c, f in zip(chunks.tolist(), files.tolist(), strict=True)]
    if not len(numbers):
        raise DataError("expected episodes in a LeRobot data set, got none in its meta folder")
    order = np.argsort(numbers, kind="stable")
    try:
        shards = [info.data_path.format(**places[k]) for k in order]
    except (KeyError, IndexError, ValueError, AttributeError) as error:
        raise DataError(
            f"expected a data_path such as data/chunk-000/file-000.parquet, got {info.data_path!r}"
        ) from error
    return Episodes(numbers[order], lengths[order], shards)


def read_tasks(folder: Path) -> dict[int, str]:
    """Task number -> its text; empty where no file says it."""
    parquet, lines = (folder / name for name in _TASKS)
    if parquet.is_file():
        rows = _columns(parquet, None)
        texts = next(
            (rows[name] for name in ("task", "__index_level_0__", *rows) if name in rows and _are_texts(rows[name])), []
        )
        return {int(k): str(text) for k, text in zip(rows.get("task_index", []), texts, strict=False) if k is not None}
    if lines.is_file():
        return {int(row["task_index"]): str(row["task"]) for row in _lines(lines) if {"task_index", "task"} <= set(row)}
    return {}


def _are_texts(values: Sequence[Any]) -> bool:
    return bool(values) and isinstance(values[0], str)


def _lines(path: Path) -> Iterator[dict[str, Any]]:
    try:
        check_expanded(10 * path.stat().st_size)
        text = path.read_text(encoding="utf-8")
        for k, line in enumerate(text.splitlines(), 1):
            if line.strip():
                row = json.loads(line)
                if not isinstance(row, dict):
                    raise DataError(f"expected an object in line {k} of {path.name}, got {line[:40]!r}")
                yield row
    except (OSError, ValueError, RecursionError) as error:
        raise DataError(
            f"expected meta/{path.name} of a LeRobot data set, got none that can be read ({error})"
        ) from error


def _table(folder: Path, names: Sequence[str]) -> dict[str, list[Any]]:
    """Columns of all files of meta/episodes, in the order of the files."""
    files = sorted(folder.glob(_V3))
    if not files:
        raise DataError(f"expected {_V3} of a LeRobot data set of version 3, found none")
    whole: dict[str, list[Any]] = {name: [] for name in names}
    for file in files:
        for name, values in _columns(file, names).items():
            whole[name] += values
    return whole


def _columns(path: Path, names: Sequence[str] | None) -> dict[str, list[Any]]:
    import pyarrow as pa
    from pyarrow import parquet

    try:
        check_expanded(20 * path.stat().st_size)
        file = parquet.ParquetFile(path)
        missing = {*(names or ())} - {*file.schema_arrow.names}
        if missing:
            raise DataError(f"expected the columns {sorted(names or ())} in {path.name}, got no {sorted(missing)[0]!r}")
        return dict(file.read(columns=None if names is None else list(names), use_threads=False).to_pydict())
    except (pa.ArrowException, OSError) as error:
        raise DataError(
            f"expected {path.name} in the meta folder of a LeRobot data set, got a damaged file ({error})"
        ) from error


def _whole(values: Sequence[Any], name: str, where: str) -> NDArray[np.int64]:
    array = np.array(values)
    if array.dtype.kind not in "iu" and len(array):
        raise DataError(f"expected whole numbers as {name} in {where}, got {values[0]!r}")
    return array.astype(np.int64)
