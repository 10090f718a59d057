"""Copy a data set of LeRobot with texts about the movements of its episodes.

Version 3 has a column for them, `language_persistent`, of rows that hold from a time of an episode on. Programs for
version 2 read texts but no lists: in `annotation.motion` each frame holds the same rows of its episode as JSON.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import parquet

from kineme.errors import DataError
from kineme.io.lerobot.info import MARKER, read_episodes, read_info, read_json
from kineme.io.records import damaged_as

#: Of a movement, in coordinates of the robot: not of a camera, which stays null.
ROLE, STYLE = "assistant", "motion"
#: With which a content of this package begins: rows that do are replaced, those of others stay.
OWN = '{"annotator": "kineme"'

_OWN = ("meta", "data")  # folders whose files other programs write over; other ones hold videos

LANGUAGE = "language_persistent"
LANGUAGE_FEATURE = {"dtype": "language", "shape": [1], "names": None}  # as it stands in meta/info.json
MOTION_TEXTS = "annotation.motion"
TEXT_FEATURE = {"dtype": "string", "shape": [1], "names": None}


class Motion(NamedTuple):
    """A text about a movement of an episode."""

    start: float  # seconds since the beginning of the episode; the stored stamp of the nearest frame is written
    content: str  # JSON that begins with `OWN`, so that a later copy can replace it


class Column(NamedTuple):
    """The column of a version that carries texts."""

    name: str
    feature: dict[str, Any]  # its entry in meta/info.json
    type_in: Callable[[Any], Any]  # schema of a shard -> type of the column, whether the shard has it or not
    leaves: Callable[[Any], list[str]]  # type -> paths of its parts in a Parquet file
    extended: Callable[[Any, Any, Any, Any], Any]  # see `with_language`


def copy_with_motions(source: Path, target: Path, motions: Mapping[int, Sequence[Motion]]) -> None:
    """Copy a data set into an empty folder, with texts about the movements of its episodes, by their numbers.

    They stand on each of the frames, in the column that `COLUMNS` has for the version and meta/info.json names. Shards
    are written anew. All else is copied; videos and pictures are hard links where the file system has them.
    """
    info = read_info(source)
    column = COLUMNS[info.version]
    declared = read_episodes(source, info)
    if declared.problems:
        raise DataError(f"expected a whole data set to copy: {declared.problems[0]}")
    if unknown := set(motions) - set(declared.numbers.tolist()):
        raise DataError(f"expected an episode of the data set, got {min(unknown)}")
    shards = [shard for shard in dict.fromkeys(declared.shards) if (source / shard).is_file()]
    changed = {(source / file) for file in (*shards, MARKER)}
    shutil.copytree(
        source, target, dirs_exist_ok=True, copy_function=lambda old, new: _take(source, Path(old), Path(new), changed)
    )
    for shard in shards:
        write_shard(source / shard, target / shard, motions, column)
    declaration = read_json(source / MARKER, MARKER)
    if column.name in declaration["features"]:
        shutil.copy2(source / MARKER, target / MARKER)
        return
    declaration["features"][column.name] = column.feature
    (target / MARKER).write_text(json.dumps(declaration, indent=4, ensure_ascii=False), encoding="utf-8")


def _take(source: Path, old: Path, new: Path, changed: set[Path]) -> None:
    if old in changed:
        return
    if old.relative_to(source).parts[0] not in _OWN:
        with suppress(OSError):
            os.link(old.resolve(), new)
            return
    shutil.copy2(old, new)


def write_shard(source: Path, target: Path, motions: Mapping[int, Sequence[Motion]], column: Column) -> None:
    """Copy a shard with the texts of its episodes on each of their frames, behind those of others."""
    # What is wrong with the disk when writing stays an error of the system.
    reading = partial(damaged_as, "expected a Parquet file, got a damaged one", OSError)
    try:
        with reading():
            file = parquet.ParquetFile(source)
        with file:
            schema = file.schema_arrow
            kind = column.type_in(schema)
            with reading():
                # The texts of the episodes of a shard, each at the stamp of a frame, in the order of time.
                columns = file.read(columns=["episode_index", "timestamp"], use_threads=False)
                episodes, stamps = (columns.column(name).to_numpy() for name in ("episode_index", "timestamp"))
                rows: dict[int, list[Motion]] = {}
                for episode in {*np.unique(episodes).tolist()} & {*motions}:
                    own = stamps[episodes == episode]
                    rows[episode] = sorted(
                        motion._replace(start=float(own[np.abs(own - motion.start).argmin()]))
                        for motion in motions[episode]
                    )
            if column.name not in schema.names:
                schema = schema.append(pa.field(column.name, kind))
            packed = _compression(file.metadata, column.leaves(kind))
            with parquet.ParquetWriter(target, schema, compression=packed) as writer:
                for k in range(file.num_row_groups):
                    with reading():
                        table = file.read_row_group(k, use_threads=False)
                    table = _extended(table, rows, column, kind, schema)
                    writer.write_table(table, row_group_size=max(table.num_rows, 1))
    except DataError as error:
        raise DataError(f"{source.name}: {error}") from error
    except (pa.ArrowException, ValueError, KeyError) as error:
        raise DataError(f"expected the shard {source.name} to take the column {column.name}, got: {error}") from error


def _compression(metadata: Any, leaves: Sequence[str]) -> str | dict[str, str]:
    """Return leaf of a column -> how the source compresses it; the new column as the first one."""
    if not metadata.num_row_groups or not metadata.num_columns:
        return "snappy"
    group = metadata.row_group(0)
    columns = [group.column(k) for k in range(group.num_columns)]
    compressions = {column.path_in_schema: str(column.compression) for column in columns}
    compressions = dict.fromkeys(leaves, str(columns[0].compression)) | compressions
    return {path: "NONE" if name == "UNCOMPRESSED" else name for path, name in compressions.items()}


def _extended(table: Any, motions: Mapping[int, list[Motion]], column: Column, kind: Any, schema: Any) -> Any:
    numbers, episode_of = np.unique(table.column("episode_index").to_numpy(), return_inverse=True)
    old = table.column(column.name) if column.name in table.column_names else None
    if old is not None:
        old = pa.concat_arrays(old.chunks) if old.num_chunks else pa.nulls(0, kind)
    new = column.extended(old, [motions.get(int(k), []) for k in numbers], episode_of, kind)
    columns = [new if name == column.name else table.column(name) for name in schema.names]
    return pa.Table.from_arrays(columns, schema=schema)


def language_type(schema: Any) -> Any:
    """Return the type of the column: that which the shard has, else LeRobot's, with calls of tools as texts in JSON."""
    if LANGUAGE in schema.names:
        kind = schema.field(LANGUAGE).type
        is_list_of_rows = pa.types.is_list(kind) and pa.types.is_struct(kind.value_type)
        names = {field.name for field in kind.value_type} if is_list_of_rows else set()
        if not {"role", "content", "style", "timestamp"} <= names:
            raise DataError(f"expected rows with role, content, style, timestamp in {LANGUAGE}, got {kind}")
        return kind
    text = pa.string()
    role, stamp = pa.field("role", text, nullable=False), pa.field("timestamp", pa.float32(), nullable=False)
    others = [("camera", text), ("tool_calls", pa.list_(text))]
    return pa.list_(pa.struct([role, ("content", text), ("style", text), stamp, *others]))


def language_leaves(kind: Any) -> list[str]:
    """Return paths of the parts of the column in a Parquet file."""
    leaves = [f"{LANGUAGE}.list.element.{field.name}" for field in kind.value_type]
    return [*leaves, *(f"{leaf}.list.element" for leaf in leaves)]


def with_language(old: Any, motions: Sequence[Sequence[Motion]], episode_of: NDArray[np.intp], kind: Any) -> Any:
    """Return the column of some rows: those of others that are there, behind them the texts of each row's episode.

    `old` is the column so far or None; `episode_of` (T,) says which of the `motions` a row belongs to.
    """
    added = _language_rows([motion for some in motions for motion in some], kind.value_type)
    counts = np.array([len(some) for some in motions], dtype=np.int64)
    flat, before = _lists_of_others(pa.nulls(len(episode_of), kind) if old is None else old)
    own = counts[episode_of]
    lengths = before + own
    offsets = np.concatenate(([0], np.cumsum(lengths)))
    within = np.arange(offsets[-1]) - np.repeat(offsets[:-1], lengths)
    first_old = np.cumsum(before) - before
    first_added = len(flat) + (np.cumsum(counts) - counts)[episode_of] - before
    is_old = within < np.repeat(before, lengths)
    where = within + np.where(is_old, np.repeat(first_old, lengths), np.repeat(first_added, lengths))
    values = pa.concat_arrays([flat, added]).take(pa.array(where))
    absent = None if old is None else pa.array(np.asarray(old.is_null()) & (own == 0))
    return pa.ListArray.from_arrays(pa.array(offsets, pa.int32()), values, type=kind, mask=absent)


def _lists_of_others(old: Any) -> tuple[Any, NDArray[np.int64]]:
    """Return the rows in all lists that are not of this package, and how many each list has."""
    flat = old.flatten()
    counts = pc.fill_null(pc.list_value_length(old), 0).to_numpy(zero_copy_only=False).astype(np.int64)
    style, content = (pc.cast(pc.struct_field(flat, name), pa.string()) for name in ("style", "content"))
    ours = pc.and_(pc.equal(style, STYLE), pc.starts_with(content, OWN))
    are_others = ~pc.fill_null(ours, False).to_numpy(zero_copy_only=False)
    until = np.concatenate(([0], np.cumsum(are_others)))[np.concatenate(([0], np.cumsum(counts)))]
    return flat.take(np.flatnonzero(are_others)), np.diff(until).astype(np.int64)


def _language_rows(motions: Sequence[Motion], kind: Any) -> Any:
    values: dict[str, list[Any]] = {
        "role": [ROLE] * len(motions),
        "content": [motion.content for motion in motions],
        "style": [STYLE] * len(motions),
        "timestamp": [motion.start for motion in motions],
    }
    arrays = [
        pa.array(values[field.name], type=field.type) if field.name in values else pa.nulls(len(motions), field.type)
        for field in kind
    ]
    return pa.StructArray.from_arrays(arrays, fields=list(kind))


def text_type(schema: Any) -> Any:
    """Return the type of the column; a `DataError` if the shard has another of that name."""
    kind = schema.field(MOTION_TEXTS).type if MOTION_TEXTS in schema.names else pa.string()
    if kind not in (pa.string(), pa.large_string()):
        raise DataError(f"expected texts in {MOTION_TEXTS}, got {kind}")
    return kind


def with_texts(old: Any, motions: Sequence[Sequence[Motion]], episode_of: NDArray[np.intp], kind: Any) -> Any:
    """Return the column of some rows, see `with_language`."""
    plain = {"role": ROLE, "style": STYLE, "camera": None, "tool_calls": None}
    added = [[{**plain, "content": motion.content, "timestamp": motion.start} for motion in some] for some in motions]
    contents, text_of = [""], np.zeros(len(episode_of), dtype=np.intp)
    if old is not None:
        coded = old.dictionary_encode()
        contents = [text or "" for text in coded.dictionary.to_pylist()] + [""]
        text_of = coded.indices.fill_null(len(contents) - 1).to_numpy(zero_copy_only=False).astype(np.intp)
    both, which = np.unique(np.column_stack((text_of, episode_of)), axis=0, return_inverse=True)
    texts = [json.dumps(_texts_of_others(contents[t]) + added[e], ensure_ascii=False) for t, e in both.tolist()]
    return pa.array(texts, kind).take(pa.array(which.ravel()))


def _texts_of_others(text: str) -> list[Any]:
    rows = None
    with suppress(ValueError, RecursionError):
        rows = json.loads(text or "[]")
    if not isinstance(rows, list):
        raise DataError(f"expected lists in JSON in {MOTION_TEXTS}, got {text[:40]!r}")
    return [row for row in rows if not (isinstance(row, dict) and str(row.get("content")).startswith(OWN))]


#: Version -> its column.
COLUMNS = {
    2: Column(MOTION_TEXTS, TEXT_FEATURE, text_type, lambda kind: [MOTION_TEXTS], with_texts),
    3: Column(LANGUAGE, LANGUAGE_FEATURE, language_type, language_leaves, with_language),
}
