"""Episodes of a data set of LeRobot as they are stored, and the frames that they are cut from, some rows at a time.

Frames come from shards of Parquet or from a table of Lance, in batches that fit into little memory.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import parquet

from kineme.errors import DataError
from kineme.io.lerobot.info import Episodes, Info, read_episodes, read_info, read_tasks, read_videos
from kineme.io.limits import check_expanded
from kineme.io.records import needs
from kineme.io.tables.parquet import is_list, rows_of_lists
from kineme.movements.episodes import Episode, place_of
from kineme.reporting.text import counted
from kineme.validation import Array

_ROWS = 2**16  # rows that are decompressed at a time
_BYTES = 2**24  # of the numbers in them
_READ = 2**20  # bytes of a file of Parquet that are read at a time
_COUNTERS = ("episode_index", "frame_index", "timestamp", "task_index")
_SHOWN = 5  # frames of an episode whose faults are named
_FAR = 2**62  # a number beyond all episodes
_MOST_NUMBERS = 1000  # episodes that a filter of Lance names; of more, all frames are read


class Frames(NamedTuple):
    """Consecutive frames: their features side by side, and what tells them apart."""

    values: Array  # shape (T, d)
    # episodes, frames, tasks: shape (T,)
    episodes: NDArray[np.int64]
    frames: NDArray[np.int64]
    tasks: NDArray[np.int64]
    stamps: Array  # shape (T,); seconds since the beginning of the episode, as they are stored
    faults: dict[int, str]  # row -> what is wrong there


class _Shard(NamedTuple):
    """An open file or table of frames."""

    columns: Sequence[str]
    # Names of columns, the most rows of a batch, and numbers of episodes that grow, None for all, -> batches in order,
    # which may hold other episodes too.
    batches: Callable[[Sequence[str], int, Sequence[int] | None], Iterator[Any]]


@contextmanager
def _parquet(path: Path) -> Iterator[_Shard]:
    # Pages are read as they are needed: a group of rows may be larger than the memory.
    with parquet.ParquetFile(path, buffer_size=_READ, pre_buffer=False) as file:

        def batches(columns: Sequence[str], rows: int, numbers: Sequence[int] | None) -> Iterator[Any]:
            for group in range(file.num_row_groups):  # so that damage costs one group
                if numbers is None or _may_hold(file.metadata.row_group(group), numbers):
                    yield from file.iter_batches(rows, row_groups=[group], columns=list(columns), use_threads=False)

        yield _Shard(file.schema_arrow.names, batches)


def _may_hold(group: Any, numbers: Sequence[int]) -> bool:
    """Tell whether a group of rows may hold frames of episodes, whose numbers grow, as far as its metadata say."""
    for k in range(group.num_columns):
        column = group.column(k)
        bounds = column.statistics if column.path_in_schema == "episode_index" else None
        if bounds is not None and bounds.has_min_max and bounds.null_count == 0:
            return bool(bounds.min <= numbers[-1] and bounds.max >= numbers[0])
    return True


@contextmanager
def _lance(path: Path) -> Iterator[_Shard]:
    import lance

    def batches(columns: Sequence[str], rows: int, numbers: Sequence[int] | None) -> Iterator[Any]:
        where = None
        if isinstance(numbers, range):
            where = f"episode_index BETWEEN {numbers[0]} AND {numbers[-1]} OR episode_index IS NULL"
        elif numbers and len(numbers) <= _MOST_NUMBERS:
            where = f"episode_index IN ({', '.join(map(str, numbers))})"
        yield from table.to_batches(
            columns=list(columns), batch_size=rows, filter=where, scan_in_order=True, batch_readahead=1,
            fragment_readahead=1,
        )  # fmt: skip

    try:
        table = lance.dataset(str(path))
        yield _Shard(table.schema.names, batches)
    except BaseException as error:
        if type(error).__name__ != "PanicException":  # of Rust, on damaged bytes; no Exception of Python
            raise
        raise OSError(str(error)) from error


def check_storage(info: Info) -> None:
    """Raise a `DataError` that names the extra to install, where the package that reads the frames is not there."""
    if info.storage == "lance":
        with needs("pylance", "read a LeRobot data set in Lance", "lance"):
            import lance  # noqa: F401 - so that its absence is not taken for damage


class Storage(NamedTuple):
    """A format of the frames of a data set."""

    name: str  # in messages
    open: Callable[[Path], AbstractContextManager[_Shard]]
    column: Callable[[str], str]  # name of a feature -> that of its column


#: ``storage_format`` of meta/info.json -> the format.
STORAGES: dict[str, Storage] = {
    "parquet": Storage("a Parquet file", _parquet, str),
    "lance": Storage("a table of Lance", _lance, lambda feature: feature.replace(".", "_")),
}


def shard_frames(
    folder: Path, info: Info, shard: str, features: Mapping[str, int], numbers: Sequence[int] | None = None
) -> Iterator[Frames]:
    """Yield the frames of a shard in parts, with features by their widths; at least those of some episodes, or all.

    A `DataError` says that the shard is not there, is damaged, at its beginning or after some parts, or lacks a column.
    """
    path, storage = folder / shard, STORAGES[info.storage]
    if not path.exists():
        raise DataError(f"expected the shard {shard}, found none")
    columns = {name: storage.column(name) for name in (*features, *_COUNTERS)}
    rows = max(1, min(_ROWS, _BYTES // (8 * (sum(features.values()) + len(_COUNTERS)))))
    try:
        with storage.open(path) as table:
            names = set(table.columns)
            if missing := [name for name in columns if columns[name] not in names and name != "task_index"]:
                raise DataError(f"expected the column {columns[missing[0]]!r}, got none")
            wanted = [column for column in columns.values() if column in names]
            for batch in table.batches(wanted, rows, numbers):
                if batch.num_rows:
                    yield _frames(batch, features, columns)
    except DataError as error:
        raise DataError(f"the shard {shard}: {error}") from error
    except (pa.ArrowException, OSError, ValueError, RuntimeError) as error:
        reason = str(error).partition(", /")[0]  # Lance names places in its sources, too
        raise DataError(f"expected the shard {shard} to be {storage.name}, got a damaged one ({reason})") from error


def _frames(batch: Any, features: Mapping[str, int], columns: Mapping[str, str]) -> Frames:
    values: list[Array] = [np.empty((batch.num_rows, 0))]
    faults: dict[int, str] = {}
    for name, width in features.items():
        column = batch.column(columns[name])
        if is_list(column.type):
            rows, wrong = rows_of_lists(column, width, name)
            faults |= wrong
        else:
            rows = _numbers(column, name)[:, None]
        values.append(rows)
    has_tasks = columns["task_index"] in batch.schema.names
    tasks = _integers(batch.column(columns["task_index"])) if has_tasks else np.full(batch.num_rows, -1, np.int64)
    return Frames(
        np.concatenate(values, axis=1), _integers(batch.column("episode_index")),
        _integers(batch.column("frame_index")), tasks, _numbers(batch.column("timestamp"), "timestamp"), faults,
    )  # fmt: skip


def _numbers(column: Any, name: str) -> Array:
    """Return numbers, NaN where there is none; truth values are 0 and 1."""
    try:
        values = column.cast(pa.uint8()) if pa.types.is_boolean(column.type) else column
        with np.errstate(invalid="ignore"):  # of NaN that signal, as damaged bytes may be
            return np.asarray(values.to_numpy(zero_copy_only=False), dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DataError(f"expected numbers in {name!r}, got {column.type}") from error


def _integers(column: Any) -> NDArray[np.int64]:
    """Return whole numbers, -1 where there is none."""
    return np.asarray(column.fill_null(-1).to_numpy(zero_copy_only=False), dtype=np.int64)


def joined(parts: Sequence[Frames]) -> Frames:
    """Return consecutive frames as one."""
    if len(parts) == 1:
        return parts[0]
    starts = np.concatenate(([0], np.cumsum([len(part.values) for part in parts]))).tolist()
    faults = {
        start + row: reason for start, part in zip(starts, parts, strict=False) for row, reason in part.faults.items()
    }
    return Frames._make([*(np.concatenate([part[k] for part in parts]) for k in range(5)), faults])


def runs(parts: Iterator[Frames], problems: list[str]) -> Iterator[Frames]:
    """Yield frames that belong together, those in a row of one episode; what ends the parts too early is a problem."""
    run: list[Frames] = []
    n_rows = 0
    try:
        for part in parts:
            bounds = [0, *(np.flatnonzero(np.diff(part.episodes)) + 1).tolist(), len(part.episodes)]
            for first, end in pairwise(bounds):
                faults = {k - first: reason for k, reason in part.faults.items() if first <= k < end}
                piece = Frames._make([*(column[first:end] for column in part[:5]), faults])
                if run and run[-1].episodes[0] != piece.episodes[0]:
                    yield joined(run)
                    run, n_rows = [], 0
                run.append(piece)
                n_rows += end - first
                check_expanded(8 * n_rows * (piece.values.shape[1] + len(_COUNTERS)), "an episode")
    except DataError as error:
        problems.append(str(error))
    if run:
        yield joined(run)


def contradictions(frames: Frames, offsets: NDArray[np.intp], declared: Episodes) -> list[dict[int, str]]:
    """Return what is wrong with runs of frames that begin and end at `offsets`, number of the episode -> reason.

    Frames count from 0 in steps of 1; an episode is declared, with its length; its frames stand in one place.
    """
    numbers, lengths = frames.episodes[offsets[:-1]], np.diff(offsets)
    where = np.searchsorted(declared.numbers, numbers).clip(max=len(declared.numbers) - 1)
    is_declared = declared.numbers[where] == numbers
    miscounted = dict.fromkeys(numbers[~is_declared].tolist(), "expected an episode that the meta folder declares")
    for i in np.flatnonzero(is_declared & (declared.lengths[where] != lengths)).tolist():
        length = counted(int(declared.lengths[where[i]]), "frame")
        miscounted[int(numbers[i])] = f"expected {length} as declared, got {lengths[i]}"
    expected = np.arange(len(frames.frames)) - np.repeat(offsets[:-1], lengths)
    odd = np.flatnonzero(frames.frames != expected)
    places, firsts = np.unique(np.searchsorted(offsets, odd, side="right") - 1, return_index=True)
    disordered = {
        int(numbers[place]): f"expected frame {expected[k]} next, got frame {frames.frames[k]}"
        for place, k in zip(places.tolist(), odd[firsts].tolist(), strict=True)
    }
    episodes, counts = np.unique(numbers, return_counts=True)
    pairs = zip(episodes.tolist(), counts.tolist(), strict=True)
    divided = {k: f"expected its frames in one place, got them in {count} places" for k, count in pairs if count > 1}
    return [miscounted, disordered, divided]


def task_texts(frames: Frames, offsets: NDArray[np.intp], tasks: Mapping[int, str]) -> list[str | None]:
    """Return the task of each run of frames, the most frequent one where there are several."""
    first = frames.tasks[offsets[:-1]]
    for i in np.flatnonzero(of_several_tasks(frames, offsets)).tolist():
        numbers, counts = np.unique(frames.tasks[offsets[i] : offsets[i + 1]], return_counts=True)
        first[i] = numbers[counts.argmax()]
    return [tasks.get(k) or None for k in first.tolist()]


def of_several_tasks(frames: Frames, offsets: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Tell of each run of frames whether its task changes."""
    first = np.repeat(frames.tasks[offsets[:-1]], np.diff(offsets))
    return np.asarray(np.add.reduceat(frames.tasks != first, offsets[:-1]) > 0)


def episodes(
    folder: Path, features: Sequence[str] | None = None, numbers: Collection[int] | None = None
) -> Iterator[Episode]:
    """Yield the episodes of a data set, with all features of numbers, or those named, and all episodes, or some.

    Of a range of numbers, those that the data set declares are read, and frames of numbers that are not declared where
    they are, at the last declared number below, so that ranges side by side miss none; others must be declared.
    They come in the order of storage, a batch of rows is in memory at a time, and nothing is mended: frames that are
    missing or in another order, doubled episodes and other lengths than declared are `Episode.problems`. An episode
    whose frames cannot be read has none (T = 0). What could not be read of the meta folder comes first, as an episode
    of number -1 without frames; frames without a number belong to -1, too.

    Raises a `DataError` if meta/info.json or all of meta/episodes cannot be read, or a feature is not there.
    """
    folder = Path(folder)
    info = read_info(folder)
    check_storage(info)
    names = list(info.heads) if features is None else list(dict.fromkeys(features))
    if not names or (unknown := [name for name in names if name not in info.heads]):
        there, got = ", ".join(info.heads) or "there are none", repr(unknown[0]) if names else "none"
        raise DataError(f"expected features of numbers ({there}), got {got}")
    widths = {name: len(info.heads[name]) for name in names}
    declared, (tasks, unsaid) = read_episodes(folder, info), read_tasks(folder)
    wanted = None if numbers is None else {int(number) for number in numbers}
    if wanted is not None and not isinstance(numbers, range) and (absent := wanted - {*declared.numbers.tolist()}):
        raise DataError(f"expected numbers of episodes of the data set, got {min(absent)}")
    videos = read_videos(folder, info)
    entries = {name: info.heads[name] for name in names}

    def episode(frames: Frames, number: int, place: str, problems: Sequence[str], task: str | None = None) -> Episode:
        columns = np.split(frames.values, np.cumsum(list(widths.values()))[:-1], axis=1)
        signals = dict(zip(names, columns, strict=True))
        files = {camera: video.file for camera, video in videos.get(number, {}).items()}
        return Episode(number, frames.stamps, signals, entries, task, info.fps, tuple(problems), place, files)

    if wanted is None and (problems := (*declared.problems, *unsaid)):
        yield episode(_no_frames(sum(widths.values())), -1, "meta", problems)
    done: set[int] = set()
    places = dict(zip(declared.numbers.tolist(), declared.shards, strict=True))
    for shard, numbers_there in declared.by_shard().items():
        expected = [number for number in numbers_there if wanted is None or number in wanted]
        if not expected:
            continue
        broken: list[str] = []
        read = None if wanted is None else _around(expected, numbers_there, numbers)
        parts = shard_frames(folder, info, shard, widths, read)
        for frames in runs(parts, broken):
            number = int(frames.episodes[0])
            if read is not None and number not in read:
                continue
            offsets = np.array([0, len(frames.values)], dtype=np.intp)
            reasons = [reason for reasons in contradictions(frames, offsets, declared) for reason in reasons.values()]
            reasons += [f"frame {row}: {reason}" for row, reason in list(frames.faults.items())[:_SHOWN]]
            if isinstance(numbers, range) and number in places and places[number] != shard:
                reasons.append(f"expected its frames in {places[number]}, got some in {shard}")
            if number in done:
                reasons.append("expected its frames in one place, got more of them behind other episodes")
            (task,) = task_texts(frames, offsets, tasks)
            done.add(number)
            # Only an episode that was cut off is touched by the damage: those before it were read.
            reasons += broken if reasons else []
            place = place_of(number) if number >= 0 else "frames without an episode"
            yield episode(frames, number, place, reasons, task)
        for number in expected:
            if number not in done:
                reasons = broken or [f"expected frames in {shard}, got none"]
                yield episode(_no_frames(sum(widths.values())), number, place_of(number), reasons)
                done.add(number)


def _around(expected: Sequence[int], there: Sequence[int], numbers: Collection[int] | None) -> Sequence[int]:
    """Return the numbers to read of a shard: of a range, with those up to the next one that is declared there."""
    if not isinstance(numbers, range):
        return expected
    after = there.index(expected[-1]) + 1
    return range(expected[0] if expected[0] != there[0] else -_FAR, there[after] if after < len(there) else _FAR)


def _no_frames(width: int) -> Frames:
    integers = np.empty(0, dtype=np.int64)
    return Frames(np.empty((0, width)), integers, integers, integers, np.empty(0), {})
