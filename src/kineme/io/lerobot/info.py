"""The description of a data set of LeRobot: its rate, features, shards and episodes with their tasks."""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.limits import check_expanded
from kineme.io.records import damaged_as

_V2 = "meta/episodes.jsonl"
_V3 = "meta/episodes/*/*.parquet"
_TASKS = ("meta/tasks.parquet", "meta/tasks.jsonl")
_SHARD = ("data/chunk_index", "data/file_index")
_OF_FILE = ("chunk_index", "file_index")  # which a data_path of version 3 names
_FRAMES = "frames.lance"  # the only shard of a data set in Lance
_LARGEST = 2**62
_AN_EPISODE, _A_TASK = 200, 100  # bytes that one takes once it is read
_AT_ONCE = 2**16  # rows
_DAMAGED = "expected {} in the meta folder of a LeRobot data set, got a damaged file"

_EXAMPLES = {
    "data_path": "data/chunk-000/file-000.parquet", "video_path": "videos/top/chunk-000/file-000.mp4",
}  # fmt: skip

MARKER = "meta/info.json"
COUNTERS = ("timestamp", "frame_index", "episode_index", "index", "task_index")  # features of every data set
_NUMBERS = ("float", "int", "uint", "bool")
_WIDEST = 1000  # numbers in a frame; images have more
_MOST_BYTES = 100_000_000
_LONGEST_PATH = 1000  # characters
#: In a path: {chunk_index:300000000} would be a text of 300 MB, and {chunk_index:c} any character, also of ../
_FIELD = re.compile(r"\{\w*(:0?\d{0,2}d?)?\}")


class Info(NamedTuple):
    """A data set of LeRobot."""

    version: int  # 2: a file for each episode. 3: many episodes in a file.
    fps: float
    # Feature of numbers -> the names of its entries; one empty name where the feature is a single number.
    heads: dict[str, tuple[str, ...]]
    others: tuple[str, ...]  # features that cannot be coordinates: images, texts
    data_path: str  # where the shards are, in the syntax of `str.format`
    video_path: str | None  # where the videos are, likewise; None where there are no files of videos
    cameras: dict[str, str | None]  # feature that is a video -> its codec, None where none is declared
    storage: str  # "parquet" or "lance"
    episodes: int | None  # how many it says that there are
    chunk: int  # episodes in a chunk, for version 2


def read_json(path: Path, what: str) -> Any:
    """Read the content of a JSON file of a data set; a `DataError` that names it if that is damaged or not there."""
    said = f"expected {what} of a LeRobot data set, got none that can be read"
    with damaged_as(said, OSError, ValueError, RecursionError):
        check_expanded(min(path.stat().st_size, _MOST_BYTES) * 10)
        return json.loads(path.read_bytes())


def read_info(folder: Path) -> Info:
    """Read meta/info.json."""
    info = read_json(folder / MARKER, MARKER)
    description = info if isinstance(info, Mapping) else {}
    said, features = str(description.get("codebase_version", "")), description.get("features")
    if not said or not isinstance(features, Mapping):
        raise DataError(f"expected {MARKER} of a LeRobot data set with codebase_version and features, got another one")
    major = said.lstrip("v").partition(".")[0]
    if major not in ("2", "3"):
        raise DataError(f"expected a LeRobot data set of version 2 or 3, got {said}; convert it with LeRobot")
    storage = description.get("storage_format", "parquet")
    if storage not in ("parquet", "lance") or (storage, major) == ("lance", "2"):
        raise DataError(f"expected a LeRobot data set in Parquet, or of version 3 in Lance, got {said} in {storage!r}")
    fps = description.get("fps")
    path = _FRAMES if storage == "lance" else description.get("data_path")
    if isinstance(fps, bool) or not isinstance(fps, (int, float)) or not 0 < fps <= sys.float_info.max:
        raise DataError(f"expected fps above 0 in {MARKER}, got {fps!r:.80}")
    _check_path(path, "data_path")
    videos = None if storage == "lance" else description.get("video_path")
    if videos is not None:
        _check_path(videos, "video_path")
    total, chunk = description.get("total_episodes"), description.get("chunks_size")
    heads = {name: entries for name, feature in features.items() if (entries := _entries(name, feature))}
    others = tuple(name for name in features if name not in heads and name not in COUNTERS)
    cameras = {name: _codec(features[name]) for name in others if _dtype(features[name]) == "video"}
    return Info(
        int(major), float(fps), heads, others, str(path), videos, cameras, storage,
        total if isinstance(total, int) else None, chunk if isinstance(chunk, int) and 0 < chunk < _LARGEST else 1000,
    )  # fmt: skip


def _check_path(path: Any, key: str) -> None:
    if not isinstance(path, str) or len(path) > _LONGEST_PATH:
        raise DataError(f"expected a {key} of at most {_LONGEST_PATH} characters in {MARKER}, got {path!r:.80}")
    if Path(path).is_absolute() or ".." in Path(path).parts or {*"{}"} & {*_FIELD.sub("", path)}:
        raise DataError(f"expected a {key} within the data set in {MARKER}, got {path!r}")


def _dtype(feature: Any) -> str:
    return str(feature.get("dtype")) if isinstance(feature, Mapping) else ""


def _codec(feature: Mapping[str, Any]) -> str | None:
    declared = feature.get("info", feature.get("video_info"))
    codec = declared.get("video.codec") if isinstance(declared, Mapping) else None
    return codec if isinstance(codec, str) else None


def _entries(name: str, feature: Any) -> tuple[str, ...]:
    """Name a feature's entries, with their units where it says them; none for images, texts and counters."""
    if name in COUNTERS or not _dtype(feature).startswith(_NUMBERS):
        return ()
    shape = feature.get("shape")
    if not isinstance(shape, list) or not all(isinstance(size, int) and size > 0 for size in shape):
        return ()
    if (width := math.prod(shape)) > _WIDEST:
        return ()
    names, units = _names(feature.get("names")), feature.get("units")
    if len(names) == width and len(set(names)) == width and (width > 1 or isinstance(units, list)):
        if isinstance(units, list) and len(units) == width:
            return tuple(
                f"{name} [{unit}]" if isinstance(unit, str) else name for name, unit in zip(names, units, strict=True)
            )
        return tuple(names)
    return tuple(map(str, range(width))) if width > 1 else ("",)


def _names(names: Any) -> list[str]:
    """Return names as a flat list; they stand in a list or below words such as motors or axes."""
    if isinstance(names, Mapping):
        return [name for group in names.values() for name in _names(group)]
    return [str(name) for name in names] if isinstance(names, list) else []


class Episodes(NamedTuple):
    """The declarations of the episodes, in their order."""

    numbers: NDArray[np.int64]  # shape (n,)
    lengths: NDArray[np.int64]  # shape (n,)
    shards: list[str]  # the file or table that holds each, relative to the data set
    problems: list[str]  # what of meta/episodes could not be read
    several: frozenset[int] = frozenset()  # numbers of episodes of which version 2 declares several tasks

    def by_shard(self) -> dict[str, list[int]]:
        """Return shard -> the numbers of its episodes, both in the order of the episodes."""
        numbers: dict[str, list[int]] = {}
        for number, shard in zip(self.numbers.tolist(), self.shards, strict=True):
            numbers.setdefault(shard, []).append(number)
        return numbers


def read_episodes(folder: Path, info: Info) -> Episodes:
    """Read the episodes as meta/episodes says."""
    problems: list[str] = []
    places: tuple[NDArray[np.int64], ...]
    several: frozenset[int] = frozenset()
    if info.version == 2:
        rows = list(_lines(folder / _V2, ("episode_index", "length"), problems))
        numbers, lengths = (np.array([row[name] for row in rows], np.int64) for name in ("episode_index", "length"))
        names, places = ("episode_chunk", "episode_index"), (numbers // info.chunk, numbers)
        tasks = ((row["episode_index"], row.get("tasks")) for row in rows)
        several = frozenset(k for k, texts in tasks if isinstance(texts, list) and len({*map(str, texts)}) > 1)
    else:
        in_files = _SHARD if info.storage == "parquet" else ()
        numbers, lengths, *chunks_and_files = _table(folder, ("episode_index", "length", *in_files), problems)
        names, places = _OF_FILE, tuple(chunks_and_files)
    if not len(numbers):
        first = f"; the first problem: {problems[0]}" if problems else ""
        raise DataError(f"expected episodes in a LeRobot data set, got none in its meta folder{first}")
    order = np.argsort(numbers, kind="stable")
    if info.storage == "lance":
        return Episodes(numbers[order], lengths[order], [info.data_path] * len(numbers), problems)
    fields = dict(zip(names, (place[order] for place in places), strict=True))
    return Episodes(numbers[order], lengths[order], _paths(info.data_path, fields, "data_path"), problems, several)


def _paths(template: str, fields: Mapping[str, NDArray[np.int64]], key: str) -> list[str]:
    """Return the file of each episode from the numbers that a template names; episodes of one file share its text."""
    paths: dict[tuple[int, ...], str] = {}
    n_bytes = 0
    files = []
    for place in zip(*(column.tolist() for column in fields.values()), strict=True):
        if place not in paths:
            try:
                paths[place] = template.format(**dict(zip(fields, place, strict=True)))
            except (KeyError, IndexError, ValueError, AttributeError) as error:
                raise DataError(f"expected a {key} such as {_EXAMPLES[key]}, got {template!r}") from error
            n_bytes += len(paths[place])
            check_expanded(n_bytes, "a set of names of shards")
        files.append(paths[place])
    return files


class Video(NamedTuple):
    """The part of a file of video that shows an episode."""

    file: str  # relative to the data set, whether it is there or not
    start: float  # of the episode within it [s]


def read_videos(folder: Path, info: Info) -> dict[int, dict[str, Video]]:
    """Return number of an episode -> camera -> its video; empty where a data set has no files of videos."""
    videos: dict[int, dict[str, Video]] = {}
    for camera in info.cameras if info.video_path else ():
        # The name of the camera goes in first: its braces, if it has any, must not count as fields.
        template = str(info.video_path).replace("{video_key}", camera.replace("{", "{{").replace("}", "}}"))
        with suppress(DataError):
            if info.version == 2:
                rows = _lines(folder / _V2, ("episode_index",), [])
                numbers = np.array([row["episode_index"] for row in rows], dtype=np.int64)
                fields = {"episode_chunk": numbers // info.chunk, "episode_index": numbers}
                starts = np.zeros(len(numbers))
            else:
                columns = [f"videos/{camera}/{name}" for name in (*_OF_FILE, "from_timestamp")]
                numbers, *places, starts = _table(folder, ("episode_index", *columns), [], columns[-1:])
                fields = dict(zip(_OF_FILE, places, strict=True))
            files = _paths(template, fields, "video_path")
            for number, file, start in zip(numbers.tolist(), files, starts.tolist(), strict=True):
                if ".." not in Path(file).parts and not Path(file).is_absolute():
                    videos.setdefault(number, {})[camera] = Video(file, start)
    return videos


def read_tasks(folder: Path) -> tuple[dict[int, str], list[str]]:
    """Read task number -> its text; what of the tasks could not be read, or that no file says them."""
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


def _lines(path: Path, integers: Sequence[str], problems: list[str], text: str = "") -> Iterator[dict[str, Any]]:
    """Yield objects that have whole numbers, and the text if one is named; other lines are problems."""
    said = f"expected meta/{path.name} of a LeRobot data set, got none that can be read"
    with damaged_as(said, OSError, ValueError):
        check_expanded(10 * path.stat().st_size)
        lines = path.read_text(encoding="utf-8").splitlines()
    for k, line in enumerate(lines, 1):
        if not line.strip():
            continue
        row: Any = None
        with suppress(ValueError, RecursionError):
            row = json.loads(line)
        numbers = [row.get(name) for name in integers] if isinstance(row, dict) else [None]
        if all(type(number) is int and abs(number) < _LARGEST for number in numbers) and (not text or row.get(text)):
            yield row
        else:
            wanted = ", ".join([*integers, *([text] if text else [])])
            problems.append(f"meta/{path.name}, line {k}: expected an object with {wanted}, got {line[:40]!r}")


def _table(folder: Path, names: Sequence[str], problems: list[str], floats: Collection[str] = ()) -> list[NDArray[Any]]:
    """Return columns of all files of meta/episodes, whole numbers but for some; files that lack them are problems."""
    import pyarrow as pa

    files = sorted(folder.glob(_V3))
    if not files:
        raise DataError(f"expected {_V3} of a LeRobot data set of version 3, found none")
    kinds = [np.float64 if name in floats else np.int64 for name in names]
    parts = [[np.empty(0, kind)] for kind in kinds]
    n_rows = 0
    for file in files:
        try:
            table = _rows(file, names, _AN_EPISODE, n_rows)
            for name in names:
                column = table.column(name)
                is_number = pa.types.is_floating if name in floats else pa.types.is_integer
                if not is_number(column.type) or column.null_count:
                    said = "numbers" if name in floats else "whole numbers"
                    raise DataError(f"expected {said} as {name} in {file.name}, got {column.type}")
        except DataError as error:
            problems.append(str(error))
            continue
        n_rows += table.num_rows
        for part, name, kind in zip(parts, names, kinds, strict=True):
            part.append(table.column(name).to_numpy().astype(kind))
    return [np.concatenate(part) for part in parts]


def _texts_of_tasks(path: Path) -> dict[int, str]:
    """Read the tasks from the first column of texts, by preference from that of LeRobot or of an unnamed index."""
    import pyarrow as pa
    from pyarrow import parquet

    with damaged_as(_DAMAGED.format(path.name), pa.ArrowException, OSError, ValueError):
        schema = parquet.read_schema(path)
    values = [
        (field.name, field.type.value_type if pa.types.is_dictionary(field.type) else field.type) for field in schema
    ]
    texts = [name for name, kind in values if pa.types.is_string(kind) or pa.types.is_large_string(kind)]
    name = next((column for column in ("task", "__index_level_0__", *texts) if column in texts), None)
    table = _rows(path, ("task_index", *([name] if name else [])), _A_TASK, texts=texts)
    if name is None or not pa.types.is_integer(table.column("task_index").type):
        return {}
    tasks: dict[int, str] = {}
    for numbers, codes in zip(table.column("task_index").chunks, table.column(name).chunks, strict=True):
        dictionary = codes.dictionary.to_pylist()  # each text once, in however many rows it stands
        rows = zip(numbers.to_pylist(), codes.indices.to_pylist(), strict=True)
        tasks |= {k: dictionary[code] for k, code in rows if k is not None and code is not None}
    return tasks


def _rows(path: Path, names: Sequence[str], a_row: int, before: int = 0, texts: Sequence[str] = ()) -> Any:
    """Return columns of a Parquet file as a table of Arrow; a row takes so many bytes, and there are others before."""
    import pyarrow as pa
    from pyarrow import parquet

    damaged = damaged_as(_DAMAGED.format(path.name), pa.ArrowException, OSError, ValueError)
    with damaged, parquet.ParquetFile(path, read_dictionary=list(texts)) as file:
        missing = {*names} - {*file.schema_arrow.names}
        if missing:
            raise DataError(f"expected the columns {sorted(names)} in {path.name}, got no {sorted(missing)[0]!r}")
        batches, n_rows, n_bytes = [], before, 0
        for batch in file.iter_batches(_AT_ONCE, columns=list(names), use_threads=False):
            n_rows, n_bytes = n_rows + batch.num_rows, n_bytes + batch.nbytes
            check_expanded(max(a_row * n_rows, n_bytes), path.name)
            batches.append(batch)
        return pa.Table.from_batches(batches) if batches else file.read(columns=list(names))
