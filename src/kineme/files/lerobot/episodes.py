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
_LARGEST = 2**62


class Episodes(NamedTuple):
    """What is declared of the episodes, in their order.

    Attributes
    ----------
    numbers, lengths : ndarray of shape (n,)
    shards : list of n str
        The file that holds each, relative to the data set.
    problems : list of str
        What of meta/episodes could not be read.
    """

    numbers: NDArray[np.int64]
    lengths: NDArray[np.int64]
    shards: list[str]
    problems: list[str]


def read_episodes(folder: Path, info: Info) -> Episodes:
    """The episodes as meta/episodes says.

    Raises
    ------
    DataError
        It is missing, or none of it can be read, or it names shards outside of the data set.
    """
    problems: list[str] = []
    if info.version == 2:
        rows = list(_lines(folder / _V2, ("episode_index", "length"), problems))
        numbers = _whole([row.get("episode_index") for row in rows], "episode_index", _V2)
        lengths = _whole([row.get("length") for row in rows], "length", _V2)
        places = [{"episode_chunk": int(k) // info.chunk, "episode_index": int(k)} for k in numbers]
    else:
        table = _table(folder, ("episode_index", "length", *_SHARD), problems)
        numbers, lengths, chunks, files = (
            _whole(table[name], name, _V3) for name in ("episode_index", "length", *_SHARD)
        )
        places = [{"chunk_index": c, "file_index": f} for c, f in zip(chunks.tolist(), files.tolist(), strict=True)]
    if not len(numbers):
        first = f"; the first problem: {problems[0]}" if problems else ""
        raise DataError(f"expected episodes in a LeRobot data set, got none in its meta folder{first}")
    order = np.argsort(numbers, kind="stable")
    try:
        shards = [info.data_path.format(**places[k]) for k in order]
    except (KeyError, IndexError, ValueError, AttributeError) as error:
        raise DataError(
            f"expected a data_path such as data/chunk-000/file-000.parquet, got {info.data_path!r}"
        ) from error
    return Episodes(numbers[order], lengths[order], shards, problems)


def read_tasks(folder: Path) -> tuple[dict[int, str], list[str]]:
    """Task number -> its text; what of the tasks could not be read, or that no file says them."""
    parquet, lines = (folder / name for name in _TASKS)
    problems: list[str] = []
    tasks: dict[int, str] = {}
    try:
        if parquet.is_file():
            rows = _columns(parquet, ("task_index",), others=True)
            names = ("task", "__index_level_0__", *rows)
            texts = next((rows[name] for name in names if name in rows and _are_texts(rows[name])), [])
            known = zip(rows["task_index"], texts, strict=False)
            tasks = {int(k): str(text) for k, text in known if isinstance(k, int)}
        elif lines.is_file():
            tasks = {row["task_index"]: str(row["task"]) for row in _lines(lines, ("task_index",), problems, "task")}
        else:
            problems = [f"expected {_TASKS[0]} or {_TASKS[1]}, found none; episodes have no labels"]
    except DataError as error:
        problems = [f"{error}; episodes have no labels"]
    return tasks, problems


def _are_texts(values: Sequence[Any]) -> bool:
    return bool(values) and isinstance(values[0], str)


def _lines(path: Path, whole: Sequence[str], problems: list[str], text: str = "") -> Iterator[dict[str, Any]]:
    """Objects that have whole numbers, and the text if one is named; other lines are problems."""
    try:
        check_expanded(10 * path.stat().st_size)
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError) as error:
        raise DataError(
            f"expected meta/{path.name} of a LeRobot data set, got none that can be read ({error})"
        ) from error
    for k, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            row = json.loads(line)
        except (ValueError, RecursionError):
            row = None
        numbers = [row.get(name) for name in whole] if isinstance(row, dict) else [None]
        if all(type(one) is int and abs(one) < _LARGEST for one in numbers) and (not text or row.get(text)):
            yield row
        else:
            wanted = ", ".join([*whole, *([text] if text else [])])
            problems.append(f"meta/{path.name}, line {k}: expected an object with {wanted}, got {line[:40]!r}")


def _table(folder: Path, names: Sequence[str], problems: list[str]) -> dict[str, list[Any]]:
    """Columns of all files of meta/episodes that can be read, in the order of the files."""
    files = sorted(folder.glob(_V3))
    if not files:
        raise DataError(f"expected {_V3} of a LeRobot data set of version 3, found none")
    whole: dict[str, list[Any]] = {name: [] for name in names}
    for file in files:
        try:
            columns = _columns(file, names)
        except DataError as error:
            problems.append(str(error))
            continue
        for name, values in columns.items():
            whole[name] += values
    return whole


def _columns(path: Path, names: Sequence[str], others: bool = False) -> dict[str, list[Any]]:
    """Columns of a file: those named, and all others if that is said."""
    import pyarrow as pa
    from pyarrow import parquet

    try:
        check_expanded(20 * path.stat().st_size)
        file = parquet.ParquetFile(path)
        missing = {*names} - {*file.schema_arrow.names}
        if missing:
            raise DataError(f"expected the columns {sorted(names)} in {path.name}, got no {sorted(missing)[0]!r}")
        return dict(file.read(columns=None if others else list(names), use_threads=False).to_pydict())
    except (pa.ArrowException, OSError) as error:
        raise DataError(
            f"expected {path.name} in the meta folder of a LeRobot data set, got a damaged file ({error})"
        ) from error


def _whole(values: Sequence[Any], name: str, where: str) -> NDArray[np.int64]:
    array = np.array(values)
    if array.dtype.kind not in "iu" and len(array):
        raise DataError(f"expected whole numbers as {name} in {where}, got {values[0]!r}")
    return array.astype(np.int64)
