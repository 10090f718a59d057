"""A data set of LeRobot as movements: one for each episode, named by its task. Frames are read some rows at a time."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import parquet

from kineme.errors import DataError
from kineme.io.lerobot.info import Episodes, Info, read_episodes, read_info, read_tasks
from kineme.io.limits import check_expanded
from kineme.io.tables.parquet import is_list, rows_of_lists
from kineme.movements.tables.columns import choose_roles, column_numbers
from kineme.movements.tables.layout import Column, Layout, Parsed, listed, no_lines
from kineme.movements.tables.table import Segments, Table, table_movements
from kineme.reporting.text import counted, first_names
from kineme.validation import Array

_ROWS = 2**16  # rows that are decompressed at a time
_OF_FRAMES = ("episode_index", "frame_index", "timestamp", "task_index")

_SHOWN = 5  # numbers of episodes in one message

STATE = "observation.state"
_STAMP = "timestamp [s]"
_TOLERANCE = 1e-4  # s between the stored stamps and the frames at the declared rate, as LeRobot allows


def lerobot_movements(folder: Path, layout: Layout) -> Parsed:
    """Read a data set of LeRobot, version 2 or 3: ``observation.state``, or what ``columns`` names, of each episode."""
    # Refuse a choice of times, movements or labels that the data set has already made otherwise.
    named = {"label": (layout.label, ("task", "task_index")), "time": (layout.time, ("timestamp",))}
    for what, (given, names) in named.items():
        if given is not None and given not in names:
            raise DataError(f"expected {names[0]!r} as {what} of a LeRobot data set, which declares it, got {given!r}")
    if layout.keys is not None and not set(layout.keys) <= {"episode_index", "episode"}:
        raise DataError(
            f"expected 'episode_index' as movement of a LeRobot data set, got {listed(map(str, layout.keys))}"
        )
    info = read_info(folder)
    features, heads, chosen = _chosen(info, layout)
    declared, (tasks, unsaid) = read_episodes(folder, info), read_tasks(folder)
    frames, unread = _all_frames(folder, declared, features)
    frames, offsets, wrong = whole_episodes(frames, declared, unread)
    left_out = [*declared.problems, *unsaid, *unread.values(), *wrong]
    if len(offsets) < 2:
        raise DataError(f"expected episodes in a LeRobot data set, got none that is whole; the first: {left_out[0]}")
    places = [f"episode {k}" for k in frames.episodes[offsets[:-1]].tolist()]
    columns = [_stamps(frames, offsets, info.fps), *(frames.values[:, k] for k in chosen)]
    table = Table(
        (_STAMP, *heads), columns, len(frames.values), no_lines, frames.faults,
        segments=Segments(offsets, places, _labels(frames, offsets, tasks)), maker="LeRobot",
    )  # fmt: skip
    plain = Layout(time=0, columns=range(1, len(columns)), skip=layout.skip)
    roles = choose_roles(table.heads, ("number",) * len(table.heads), plain)
    parsed = table_movements(table, roles, plain, f"v{info.version}")
    ignored = (*(name for name in info.heads if name not in features), *info.others)
    return parsed._replace(detected=parsed.detected._replace(ignored=ignored), left_out=tuple(left_out))


def _chosen(info: Info, layout: Layout) -> tuple[dict[str, int], tuple[str, ...], list[int]]:
    """Return features that are read with their widths; heads of the coordinates; their columns among those features."""
    if not info.heads:
        only = f"only {listed(info.others)}" if info.others else "none"
        raise DataError(f"expected features of numbers in a LeRobot data set, got {only}")
    owners = [name for name, entries in info.heads.items() for _ in entries]
    entries = [entry for entries_of_head in info.heads.values() for entry in entries_of_head]
    full = [f"{name}.{entry}" if entry else name for name, entry in zip(owners, entries, strict=True)]
    vectors = {name: len(entries) for name, entries in info.heads.items() if entries != ("",)}
    name = STATE if STATE in info.heads else next(iter(vectors)) if len(vectors) == 1 else None
    if layout.coordinates is not None:
        short = [entry if owner == name else head for owner, entry, head in zip(owners, entries, full, strict=True)]
        numbers: Sequence[int] = _numbers_of(full, short, layout.coordinates)
    elif name is not None:
        numbers = [k for k, owner in enumerate(owners) if owner == name]
    else:
        got = listed(f"{name} ({width})" for name, width in (vectors or dict.fromkeys(info.heads, 1)).items())
        raise DataError(f"expected the feature {STATE!r}, got {got}; say which with columns=, in the shell --columns")
    features = {name: len(info.heads[name]) for name in dict.fromkeys(owners[k] for k in numbers)}
    starts = dict(zip(features, np.cumsum([0, *features.values()]).tolist(), strict=False))
    columns = [starts[owners[k]] + k - owners.index(owners[k]) for k in numbers]
    alone = len(features) == 1
    heads = tuple(entries[k] if alone and entries[k] and not entries[k].isdecimal() else full[k] for k in numbers)
    return features, heads, columns


def _numbers_of(full: Sequence[str], short: Sequence[str], columns: Sequence[Column]) -> list[int]:
    """Find columns that are called by feature and entry or, of the feature read by default, by entry alone."""
    numbers: list[int] = []
    for column in columns:
        try:
            numbers += column_numbers(full, [column])
        except DataError:
            of_entry: tuple[int, ...] = ()
            if isinstance(column, str) and not column.isdecimal():
                with suppress(DataError):
                    of_entry = column_numbers(short, [column])
            if not of_entry:
                raise
            numbers += of_entry
    return numbers


def _all_frames(folder: Path, declared: Episodes, features: dict[str, int]) -> tuple[Frames, dict[str, str]]:
    """Return the frames of all shards in the order of their episodes; shard -> why it could not be read."""
    parts: list[Frames] = []
    unread: dict[str, str] = {}
    taken, width = 0, sum(features.values())
    episodes_of: dict[str, list[int]] = {}
    for k, shard in zip(declared.numbers.tolist(), declared.shards, strict=True):
        episodes_of.setdefault(shard, []).append(k)
    for shard, episodes in episodes_of.items():
        try:
            part = read_shard(folder, shard, features, taken)
        except DataError as error:
            unread[shard] = f"{error}; left out {episode_names(episodes)}"
            continue
        parts += part
        taken += 8 * (width + 4) * sum(len(frames.values) for frames in part)
    if not parts:
        raise DataError(
            f"expected shards that can be read, got none; the first: {next(iter(unread.values()), 'without frames')}"
        )
    return joined(parts), unread


def _stamps(frames: Frames, offsets: NDArray[np.intp], fps: float) -> Array:
    """Give seconds since the beginning of each episode: of its frames at the declared rate, else as they are stored."""
    even = frames.frames / fps
    others = np.add.reduceat(~(np.abs(frames.stamps - even) <= _TOLERANCE), offsets[:-1]) > 0
    return np.where(np.repeat(others, np.diff(offsets)), frames.stamps, even)


def _labels(frames: Frames, offsets: NDArray[np.intp], tasks: dict[int, str]) -> list[str | None]:
    """Return the task of each episode, the most frequent one where there are several."""
    first = frames.tasks[offsets[:-1]]
    mixed = np.add.reduceat(frames.tasks != np.repeat(first, np.diff(offsets)), offsets[:-1]) > 0
    for i in np.flatnonzero(mixed).tolist():
        numbers, counts = np.unique(frames.tasks[offsets[i] : offsets[i + 1]], return_counts=True)
        first[i] = numbers[counts.argmax()]
    return [tasks.get(k) or None for k in first.tolist()]


def whole_episodes(
    frames: Frames, declared: Episodes, unread: Collection[str]
) -> tuple[Frames, NDArray[np.intp], list[str]]:
    """Return the frames of the whole episodes, where each begins and ends, and what is wrong with the others."""
    n = len(frames.values)
    offsets = np.concatenate(([0], np.flatnonzero(np.diff(frames.episodes)) + 1, [n])).astype(np.intp)[: n + 1]
    numbers, lengths = frames.episodes[offsets[:-1]], np.diff(offsets)
    wrong = _miscounted(numbers, lengths, declared) | _disordered(frames, offsets, numbers) | _divided(numbers)
    bad = np.isin(numbers, list(wrong))
    left_out = [
        f"{f'episode {k}' if k >= 0 else 'frames without an episode_index'}: {reason}"
        for k, reason in sorted(wrong.items())
    ]
    # Episodes without frames in shards that were read.
    absent = set(np.setdiff1d(declared.numbers, numbers).tolist())
    places = zip(declared.numbers.tolist(), declared.shards, strict=True) if absent else ()
    left_out += [
        f"episode {k}: expected frames in {shard}, got none"
        for k, shard in places
        if k in absent and shard not in unread
    ]
    left_out += [
        f"episode {after}: its frames stand behind those of episode {before}; it is read all the same"
        for before, after in pairwise(numbers[~bad].tolist())
        if after < before
    ]
    if bad.any():
        frames = _taken(frames, np.repeat(~bad, lengths))
        offsets = np.concatenate(([0], np.cumsum(lengths[~bad]))).astype(np.intp)
    return frames, offsets, left_out


def episode_names(numbers: Sequence[int]) -> str:
    """Return numbers of episodes for a message; the first and the last of many in a row."""
    if len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1:
        return f"episodes {numbers[0]} to {numbers[-1]}"
    return f"{'episode' if len(numbers) == 1 else 'episodes'} {first_names(numbers, _SHOWN)}"


def _divided(numbers: NDArray[np.int64]) -> dict[int, str]:
    episodes, counts = np.unique(numbers, return_counts=True)
    pairs = zip(episodes.tolist(), counts.tolist(), strict=True)
    return {k: f"expected its frames in one place, got them in {count} places" for k, count in pairs if count > 1}


def _disordered(frames: Frames, offsets: NDArray[np.intp], numbers: NDArray[np.int64]) -> dict[int, str]:
    """Return episodes whose frames do not count from 0 in steps of 1."""
    expected = np.arange(len(frames.frames)) - np.repeat(offsets[:-1], np.diff(offsets))
    odd = np.flatnonzero(frames.frames != expected)
    runs, firsts = np.unique(np.searchsorted(offsets, odd, side="right") - 1, return_index=True)
    return {
        int(numbers[run]): f"expected frame {expected[k]} next, got frame {frames.frames[k]}"
        for run, k in zip(runs.tolist(), odd[firsts].tolist(), strict=True)
    }


def _miscounted(numbers: NDArray[np.int64], lengths: NDArray[np.intp], declared: Episodes) -> dict[int, str]:
    where = np.searchsorted(declared.numbers, numbers).clip(max=len(declared.numbers) - 1)
    is_declared = declared.numbers[where] == numbers
    wrong = dict.fromkeys(numbers[~is_declared].tolist(), "expected an episode that the meta folder declares")
    for i in np.flatnonzero(is_declared & (declared.lengths[where] != lengths)).tolist():
        expected = counted(int(declared.lengths[where[i]]), "frame")
        wrong[int(numbers[i])] = f"expected {expected} as declared, got {lengths[i]}"
    return wrong


def _taken(frames: Frames, mask: NDArray[np.bool_]) -> Frames:
    """Return the kept frames; what is wrong with them keeps its rows."""
    row = np.cumsum(mask) - 1
    faults = {int(row[k]): reason for k, reason in frames.faults.items() if mask[k]}
    return Frames._make([*(column[mask] for column in frames[:5]), faults])


class Frames(NamedTuple):
    """Consecutive frames: their features side by side, and what tells them apart."""

    values: Array  # shape (T, d)
    # episodes, frames, tasks: shape (T,)
    episodes: NDArray[np.int64]
    frames: NDArray[np.int64]
    tasks: NDArray[np.int64]
    stamps: Array  # shape (T,); seconds since the beginning of the episode, as they are stored
    faults: dict[int, str]  # row -> what is wrong there


def read_shard(folder: Path, shard: str, features: Mapping[str, int], taken: int) -> list[Frames]:
    """Read the frames of a shard, in parts, with features by their widths; earlier shards have taken so many bytes."""
    path = folder / shard
    if not path.is_file():
        raise DataError(f"expected the shard {shard}, found none")
    try:
        with parquet.ParquetFile(path) as file:
            names_of_columns = set(file.schema_arrow.names)
            needed = [*features, "episode_index", "frame_index", "timestamp"]
            if missing := [name for name in needed if name not in names_of_columns]:
                raise DataError(f"expected the column {missing[0]!r}, got none")
            width = sum(features.values()) + len(_OF_FRAMES)
            check_expanded(taken + 8 * width * max(file.metadata.num_rows, 0), "a data set")
            columns = [*needed, *(["task_index"] if "task_index" in names_of_columns else [])]
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
    """Return consecutive frames as one."""
    starts = np.concatenate(([0], np.cumsum([len(part.values) for part in parts]))).tolist()
    faults = {
        start + row: reason for start, part in zip(starts, parts, strict=False) for row, reason in part.faults.items()
    }
    return Frames._make([*(np.concatenate([part[k] for part in parts]) for k in range(5)), faults])


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
    tasks = _integers(batch.column("task_index")) if "task_index" in names else np.full(batch.num_rows, -1, np.int64)
    stamps = _numbers(batch.column("timestamp"), "timestamp")
    return Frames(
        np.concatenate(values, axis=1), _integers(batch.column("episode_index")),
        _integers(batch.column("frame_index")), tasks, stamps, faults,
    )  # fmt: skip


def _numbers(column: Any, name: str) -> Array:
    try:
        return np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DataError(f"expected numbers in {name!r}, got {column.type}") from error


def _integers(column: Any) -> NDArray[np.int64]:
    """Return whole numbers, -1 where there is none."""
    return np.asarray(column.fill_null(-1).to_numpy(zero_copy_only=False), dtype=np.int64)
