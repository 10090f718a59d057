"""The episodes of a data set of LeRobot: their lengths, their tasks, and the shards that hold them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.lerobot.info import Info
from kineme.io.limits import check_expanded

_V2 = "meta/episodes.jsonl"
_V3 = "meta/episodes/*/*.parquet"
_TASKS = ("meta/tasks.parquet", "meta/tasks.jsonl")
_SHARD = ("data/chunk_index", "data/file_index")
_LARGEST = 2**62
_AN_EPISODE, _A_TASK = 200, 100  # bytes that one takes once it is read
_AT_ONCE = 2**16  # rows


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
    places: tuple[NDArray[np.int64], ...]
    if info.version == 2:
        rows = list(_lines(folder / _V2, ("episode_index", "length"), problems))
        columns = [np.array([row[name] for row in rows], dtype=np.int64) for name in ("episode_index", "length")]
        numbers, lengths = columns
        names, places = ("episode_chunk", "episode_index"), (numbers // info.chunk, numbers)
    else:
        numbers, lengths, *chunks_and_files = _table(folder, ("episode_index", "length", *_SHARD), problems)
        names, places = ("chunk_index", "file_index"), tuple(chunks_and_files)
    if not len(numbers):
        first = f"; the first problem: {problems[0]}" if problems else ""
        raise DataError(f"expected episodes in a LeRobot data set, got none in its meta folder{first}")
    order = np.argsort(numbers, kind="stable")
    shards = _shards(info.data_path, names, [place[order] for place in places])
    return Episodes(numbers[order], lengths[order], shards, problems)


def _shards(data_path: str, names: Sequence[str], places: Sequence[NDArray[np.int64]]) -> list[str]:
    """The file of each episode; several episodes of one file share its text."""
    paths: dict[tuple[int, ...], str] = {}
    n_bytes = 0
    shards = []
    for place in zip(*(one.tolist() for one in places), strict=True):
        if place not in paths:
            try:
                paths[place] = data_path.format(**dict(zip(names, place, strict=True)))
            except (KeyError, IndexError, ValueError, AttributeError) as error:
                raise DataError(
                    f"expected a data_path such as data/chunk-000/file-000.parquet, got {data_path!r}"
                ) from error
            n_bytes += len(paths[place])
            check_expanded(n_bytes, "a set of names of shards")
        shards.append(paths[place])
    return shards


def read_tasks(folder: Path) -> tuple[dict[int, str], list[str]]:
    """Task number -> its text; what of the tasks could not be read, or that no file says them."""
    parquet, lines = (folder / name for name in _TASKS)
    problems: list[str] = []
    tasks: dict[int, str] = {}
    try:
        if parquet.is_file():
            tasks = _texts_of_tasks(parquet)
        elif lines.is_file():
            tasks = {row["task_index"]: str(row["task"]) for row in _lines(lines, ("task_index",), problems, "task")}
        else:
            problems = [f"expected {_TASKS[0]} or {_TASKS[1]}, found none; episodes have no labels"]
    except DataError as error:
        problems = [f"{error}; episodes have no labels"]
    return tasks, problems


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


def _table(folder: Path, names: Sequence[str], problems: list[str]) -> list[NDArray[np.int64]]:
    """Columns of all files of meta/episodes that can be read, in the order of the files."""
    import pyarrow as pa

    files = sorted(folder.glob(_V3))
    if not files:
        raise DataError(f"expected {_V3} of a LeRobot data set of version 3, found none")
    parts = [[np.empty(0, np.int64)] for _ in names]
    n_rows = 0
    for file in files:
        try:
            table = _rows(file, names, _AN_EPISODE, n_rows)
            for name in names:
                column = table.column(name)
                if not pa.types.is_integer(column.type) or column.null_count:
                    raise DataError(f"expected whole numbers as {name} in {file.name}, got {column.type}")
        except DataError as error:
            problems.append(str(error))
            continue
        n_rows += table.num_rows
        for part, name in zip(parts, names, strict=True):
            part.append(table.column(name).to_numpy().astype(np.int64))
    return [np.concatenate(part) for part in parts]


def _texts_of_tasks(path: Path) -> dict[int, str]:
    """The first column of texts is that of the tasks, by preference that of LeRobot or of an unnamed index."""
    import pyarrow as pa
    from pyarrow import parquet

    with _damage_named(path):
        schema = parquet.read_schema(path)
    values = [(one.name, one.type.value_type if pa.types.is_dictionary(one.type) else one.type) for one in schema]
    texts = [name for name, kind in values if pa.types.is_string(kind) or pa.types.is_large_string(kind)]
    name = next((one for one in ("task", "__index_level_0__", *texts) if one in texts), None)
    table = _rows(path, ("task_index", *([name] if name else [])), _A_TASK, texts=texts)
    if name is None or not pa.types.is_integer(table.column("task_index").type):
        return {}
    tasks: dict[int, str] = {}
    for numbers, codes in zip(table.column("task_index").chunks, table.column(name).chunks, strict=True):
        known = codes.dictionary.to_pylist()  # each text once, in however many rows it stands
        rows = zip(numbers.to_pylist(), codes.indices.to_pylist(), strict=True)
        tasks |= {k: known[code] for k, code in rows if k is not None and code is not None}
    return tasks


def _rows(path: Path, names: Sequence[str], a_row: int, before: int = 0, texts: Sequence[str] = ()) -> Any:
    """Columns of a Parquet file as a table of Arrow; a row takes so many bytes, and there are others before."""
    import pyarrow as pa
    from pyarrow import parquet

    with _damage_named(path), parquet.ParquetFile(path, read_dictionary=list(texts)) as file:
        missing = {*names} - {*file.schema_arrow.names}
        if missing:
            raise DataError(f"expected the columns {sorted(names)} in {path.name}, got no {sorted(missing)[0]!r}")
        batches, n_rows, n_bytes = [], before, 0
        for batch in file.iter_batches(_AT_ONCE, columns=list(names), use_threads=False):
            n_rows, n_bytes = n_rows + batch.num_rows, n_bytes + batch.nbytes
            check_expanded(max(a_row * n_rows, n_bytes), path.name)
            batches.append(batch)
        return pa.Table.from_batches(batches) if batches else file.read(columns=list(names))


@contextmanager
def _damage_named(path: Path) -> Iterator[None]:
    import pyarrow as pa

    try:
        yield
    except DataError:
        raise
    except (pa.ArrowException, OSError) as error:
        raise DataError(
            f"expected {path.name} in the meta folder of a LeRobot data set, got a damaged file ({error})"
        ) from error
