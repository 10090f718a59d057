"""The frames of a data set of LeRobot: shard after shard, the columns that are needed, some rows at a time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.limits import check_expanded
from kineme.io.tables.list_columns import is_list, rows_of_lists
from kineme.validation import Array

_ROWS = 2**16  # rows that are decompressed at a time
_OF_FRAMES = ("episode_index", "frame_index", "timestamp", "task_index")


class Frames(NamedTuple):
    """Consecutive frames: their features side by side, and what tells them apart.

    Attributes
    ----------
    values : ndarray of shape (T, d)
    episodes, frames, tasks : ndarray of shape (T,)
    stamps : ndarray of shape (T,)
        Seconds since the beginning of the episode, as they are stored.
    faults : dict
        Row -> what is wrong there.
    """

    values: Array
    episodes: NDArray[np.int64]
    frames: NDArray[np.int64]
    tasks: NDArray[np.int64]
    stamps: Array
    faults: dict[int, str]


def read_shard(folder: Path, shard: str, features: Mapping[str, int], taken: int) -> list[Frames]:
    """The frames of a shard, in parts.

    Parameters
    ----------
    features : mapping of str to int
        Features that are read, with their widths.
    taken : int
        Bytes that earlier shards take, for the limit.

    Raises
    ------
    DataError
        There is no such file, it is damaged, or lacks a feature; the message names it.
    """
    import pyarrow as pa
    from pyarrow import parquet

    path = folder / shard
    if not path.is_file():
        raise DataError(f"expected the shard {shard}, found none")
    try:
        with parquet.ParquetFile(path) as file:
            known = set(file.schema_arrow.names)
            needed = [*features, "episode_index", "frame_index", "timestamp"]
            if missing := [name for name in needed if name not in known]:
                raise DataError(f"expected the column {missing[0]!r}, got none")
            width = sum(features.values()) + len(_OF_FRAMES)
            check_expanded(taken + 8 * width * max(file.metadata.num_rows, 0), "a data set")
            columns = [*needed, *(["task_index"] if "task_index" in known else [])]
            parts, n_rows = [], 0
            for batch in file.iter_batches(_ROWS, columns=columns, use_threads=False):
                parts.append(_frames(batch, features))
                n_rows += len(parts[-1].values)
                check_expanded(taken + 8 * width * n_rows, "a data set")
    except DataError as error:
        raise DataError(f"the shard {shard}: {error}") from error
    except (pa.ArrowException, OSError, ValueError) as error:
        raise DataError(f"expected the shard {shard} to be a Parquet file, got a damaged one ({error})") from error
    return parts


def joined(parts: list[Frames]) -> Frames:
    """Consecutive frames as one."""
    starts = np.concatenate(([0], np.cumsum([len(part.values) for part in parts]))).tolist()
    faults = {
        start + row: reason for start, part in zip(starts, parts, strict=False) for row, reason in part.faults.items()
    }
    arrays = [np.concatenate([part[k] for part in parts]) for k in range(5)]
    return Frames(arrays[0], arrays[1], arrays[2], arrays[3], arrays[4], faults)


def _frames(batch: Any, features: Mapping[str, int]) -> Frames:
    values: list[Array] = []
    faults: dict[int, str] = {}
    for name, width in features.items():
        column = batch.column(name)
        if is_list(column.type):
            rows, wrong = rows_of_lists(column, width, name)
            faults |= wrong
        else:
            rows = _numbers(column, name)[:, None]
        values.append(rows)
    names = batch.schema.names
    tasks = _whole(batch.column("task_index")) if "task_index" in names else np.full(batch.num_rows, -1, np.int64)
    stamps = _numbers(batch.column("timestamp"), "timestamp")
    return Frames(
        np.concatenate(values, axis=1), _whole(batch.column("episode_index")), _whole(batch.column("frame_index")),
        tasks, stamps, faults,
    )  # fmt: skip


def _numbers(column: Any, name: str) -> Array:
    try:
        return np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DataError(f"expected numbers in {name!r}, got {column.type}") from error


def _whole(column: Any) -> NDArray[np.int64]:
    """Whole numbers, -1 where there is none."""
    return np.asarray(column.fill_null(-1).to_numpy(zero_copy_only=False), dtype=np.int64)
