"""Copy a data set of LeRobot whose frames name the motions of their episodes."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow as pa
from pyarrow import parquet

from kineme.errors import DataError
from kineme.io.lerobot.frames import STORAGES, runs, shard_frames
from kineme.io.lerobot.info import MARKER, Info, read_episodes, read_info, read_json
from kineme.io.lerobot.language import COLUMNS, Column
from kineme.io.lerobot.motions import (
    DETAILS,
    PENDING,
    Motion,
    OwnRows,
    Record,
    Row,
    own_rows,
    records_of,
    rows_of,
    write_details,
)
from kineme.io.records import damaged_as
from kineme.reporting.atomic import write_atomically

_OWN = ("meta", "data")  # folders whose files other programs write over; other ones hold videos
_FRAMES = 2**12  # whose rows of others are in memory at a time

Motions = Mapping[int, Sequence[Motion]]  # by the numbers of their episodes


def copy_with_motions(source: Path, target: Path, motions: Motions) -> None:
    """Copy a data set in Parquet into an empty folder, with rows that name the motions of its episodes.

    They stand on each of the frames, in the column that `COLUMNS` has for the version and meta/info.json names. Shards
    are written anew. All else is copied; videos and pictures are hard links where the file system has them. Rows of
    earlier runs are replaced, those of others stay. `motions.DETAILS` says all that is known of the motions.
    """
    info = checked_info(source, motions)
    shards = [shard for shard in dict.fromkeys(read_episodes(source, info).shards) if (source / shard).is_file()]
    own = own_rows(source)
    copy_others(source, target, {source / file for file in (*shards, DETAILS, PENDING)})
    write_details(
        target / DETAILS,
        (record for shard in shards for record in _write_shard(source, target, info, shard, motions, own)),
    )
    declare(target, COLUMNS[info.version])


def checked_info(folder: Path, motions: Motions) -> Info:
    """Read meta/info.json; a `DataError` if the meta folder is damaged, or a motion is of an episode it lacks."""
    info = read_info(folder)
    declared = read_episodes(folder, info)
    if declared.problems:
        raise DataError(f"expected a whole data set to name motions in: {declared.problems[0]}")
    if unknown := {*motions} - {*declared.numbers.tolist()}:
        raise DataError(f"expected an episode of the data set, got {min(unknown)}")
    return info


def copy_others(source: Path, target: Path, changed: set[Path]) -> None:
    """Copy a folder but for some files; files that no program writes over are hard links."""

    def take(old: str, new: str) -> None:
        path = Path(old)
        if path in changed:
            return
        if path.relative_to(source).parts[0] not in _OWN:
            with suppress(OSError):
                os.link(path.resolve(), new)
                return
        shutil.copy2(old, new)

    shutil.copytree(source, target, dirs_exist_ok=True, copy_function=take)


def declare(folder: Path, column: Column) -> None:
    """Name the column in meta/info.json, unless it is there."""
    declaration = read_json(folder / MARKER, MARKER)
    if column.name not in declaration["features"]:
        declaration["features"][column.name] = column.feature
        write_atomically(folder / MARKER, json.dumps(declaration, indent=4, ensure_ascii=False).encode())


def new_rows(folder: Path, info: Info, shard: str, motions: Motions, own: OwnRows) -> dict[int, list[Row]]:
    """Return number of an episode of a shard -> the rows to write; a stamp where others name a motion is theirs."""
    column, taken = COLUMNS[info.version], dict[int, set[float]]()
    with STORAGES[info.storage].open(folder / shard) as table:
        if column.name in table.columns:
            for batch in table.batches(["episode_index", column.name], _FRAMES, None):
                episodes = batch.column("episode_index").to_numpy(zero_copy_only=False)
                for episode, stamp in column.others(batch.column(column.name), episodes, own):
                    taken.setdefault(episode, set()).add(stamp)
    rows: dict[int, list[Row]] = {}
    problems: list[str] = []
    for frames in runs(shard_frames(folder, info, shard, {}), problems):
        number = int(frames.episodes[0])
        if number in motions and number not in rows:
            rows[number] = rows_of(frames.stamps, motions[number], taken.get(number, ()))
    if problems:
        raise DataError(problems[0])
    return rows


def _write_shard(
    source: Path, target: Path, info: Info, shard: str, motions: Motions, own: OwnRows
) -> Iterator[Record]:
    """Copy a shard with the new rows of its episodes on each of their frames, behind those of others; yield these."""
    # What is wrong with the disk when writing stays an error of the system.
    reading = partial(damaged_as, "expected a Parquet file, got a damaged one", OSError)
    column = COLUMNS[info.version]
    try:
        with reading():
            file = parquet.ParquetFile(source / shard)
        with file:
            schema = file.schema_arrow
            kind = column.type_in(schema)
            with reading():
                rows = new_rows(source, info, shard, motions, own)
            if column.name not in schema.names:
                schema = schema.append(pa.field(column.name, kind))
            packed = _compression(file.metadata, column.leaves(kind))
            with parquet.ParquetWriter(target / shard, schema, compression=packed) as writer:
                for k in range(file.num_row_groups):
                    with reading():
                        table = file.read_row_group(k, use_threads=False)
                    columns = {name: table.column(name) for name in table.column_names}
                    episodes = columns["episode_index"].to_numpy()
                    old = columns.get(column.name)
                    if old is not None:
                        old = pa.concat_arrays(old.chunks) if old.num_chunks else pa.nulls(0, kind)
                    columns[column.name] = column.extended(old, episodes, own, rows, kind)
                    table = pa.Table.from_arrays([columns[name] for name in schema.names], schema=schema)
                    writer.write_table(table, row_group_size=max(table.num_rows, 1))
    except DataError as error:
        raise DataError(f"{Path(shard).name}: {error}") from error
    except (pa.ArrowException, ValueError, KeyError) as error:
        raise DataError(
            f"expected the shard {Path(shard).name} to take the column {column.name}, got: {error}"
        ) from error
    for episode, of_episode in rows.items():
        yield from records_of(episode, motions[episode], of_episode)


def _compression(metadata: Any, leaves: Sequence[str]) -> str | dict[str, str]:
    """Return leaf of a column -> how the source compresses it; the new column as the first one."""
    if not metadata.num_row_groups or not metadata.num_columns:
        return "snappy"
    group = metadata.row_group(0)
    columns = [group.column(k) for k in range(group.num_columns)]
    compressions = {column.path_in_schema: str(column.compression) for column in columns}
    compressions = dict.fromkeys(leaves, str(columns[0].compression)) | compressions
    return {path: "NONE" if name == "UNCOMPRESSED" else name for path, name in compressions.items()}
