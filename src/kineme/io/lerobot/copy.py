"""Name the motions of the episodes of a data set of LeRobot on its frames: in a copy, and in Lance also in place."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow as pa
from pyarrow import parquet

from kineme.errors import DataError
from kineme.io.lerobot import motions as language
from kineme.io.lerobot.episodes import STORAGES, runs, shard_frames
from kineme.io.lerobot.info import MARKER, Episodes, Info, read_episodes, read_info, read_json
from kineme.io.records import damaged_as, needs
from kineme.reporting.atomic import bring_to_disk, write_atomically

_OWN = ("meta", "data")  # folders whose files other programs write over; other ones hold videos
_FRAMES = 2**12  # whose rows of others are in memory at a time

_WRITTEN = 2**10  # frames whose new rows are in memory at a time
_ATTEMPTS = 3
_CONFLICT = "commit conflict"  # in what Lance says where another program was faster
_META = "meta.lance"  # the files of meta/ a second time, for programs that open the data set from afar
_NEW = "kineme_language_persistent"  # name of the column until it takes the place of another


def copy_with_motions(source: Path, target: Path, motions: language.Motions) -> None:
    """Copy a data set in Parquet into an empty folder, with rows that name the motions of its episodes.

    They stand on each of the frames, in the column that `motions.COLUMNS` has for the version and meta/info.json names.
    Shards are written anew. All else is copied; videos and pictures are hard links where the file system has them. Rows
    of earlier runs are replaced, those of others stay. `motions.DETAILS` says all that is known of the motions.
    """
    info, declared = _checked(source, motions)
    shards = [shard for shard in declared.by_shard() if (source / shard).is_file()]
    own = language.own_rows(source)
    copy_others(source, target, {source / file for file in (*shards, language.DETAILS, language.PENDING)})
    language.write_details(
        target / language.DETAILS,
        (named for shard in shards for named in _write_shard(source, target, info, shard, motions, own)),
    )
    declare(target, info)


def _checked(folder: Path, motions: language.Motions) -> tuple[Info, Episodes]:
    """Read the meta folder; a `DataError` if it is damaged, or a motion is of an episode it lacks."""
    info = read_info(folder)
    declared = read_episodes(folder, info)
    if declared.problems:
        raise DataError(f"expected a whole data set to name motions in: {declared.problems[0]}")
    if unknown := {*motions} - {*declared.numbers.tolist()}:
        raise DataError(f"expected an episode of the data set, got {min(unknown)}")
    return info, declared


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


def declare(folder: Path, info: Info) -> None:
    """Name the column in meta/info.json, unless it is there."""
    column = language.COLUMNS[info.version]
    declaration = read_json(folder / MARKER, MARKER)
    if column.name not in declaration["features"]:
        declaration["features"][column.name] = column.feature
        write_atomically(folder / MARKER, json.dumps(declaration, indent=4, ensure_ascii=False).encode())


def new_rows(folder: Path, info: Info, shard: str, motions: language.Motions, own: language.OwnRows) -> language.Rows:
    """Return number of an episode of a shard -> the rows to write; a stamp where others name a motion is theirs."""
    column, taken = language.COLUMNS[info.version], dict[int, set[float]]()
    with STORAGES[info.storage].open(folder / shard) as table:
        if column.name in table.columns:
            for batch in table.batches(["episode_index", column.name], _FRAMES, None):
                episodes = batch.column("episode_index").to_numpy(zero_copy_only=False)
                for episode, stamp in column.others(batch.column(column.name), episodes, own):
                    taken.setdefault(episode, set()).add(stamp)
    rows: dict[int, Sequence[language.Row]] = {}
    problems: list[str] = []
    for frames in runs(shard_frames(folder, info, shard, {}), problems):
        number = int(frames.episodes[0])
        if number in motions and number not in rows:
            rows[number] = language.rows_of(frames.stamps, motions[number], taken.get(number, ()))
    if problems:
        raise DataError(problems[0])
    return rows


def _write_shard(
    source: Path, target: Path, info: Info, shard: str, motions: language.Motions, own: language.OwnRows
) -> Iterator[language.Details]:
    """Copy a shard with the new rows of its episodes on each of their frames, behind those of others; yield these."""
    # What is wrong with the disk when writing stays an error of the system.
    reading = partial(damaged_as, "expected a Parquet file, got a damaged one", OSError)
    column = language.COLUMNS[info.version]
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
    yield from ((episode, motions[episode], rows[episode]) for episode in rows)


def _compression(metadata: Any, leaves: Sequence[str]) -> str | dict[str, str]:
    """Return leaf of a column -> how the source compresses it; the new column as the first one."""
    if not metadata.num_row_groups or not metadata.num_columns:
        return "snappy"
    group = metadata.row_group(0)
    columns = [group.column(k) for k in range(group.num_columns)]
    compressions = {column.path_in_schema: str(column.compression) for column in columns}
    compressions = dict.fromkeys(leaves, str(columns[0].compression)) | compressions
    return {path: "NONE" if name == "UNCOMPRESSED" else name for path, name in compressions.items()}


def copy_in_lance(source: Path, target: Path, motions: language.Motions) -> None:
    """Copy a data set into an empty folder, its tables as hard links, and name the motions of its episodes there."""
    _checked(source, motions)
    copy_others(source, target, set())
    name_in_place(target, motions)


def name_in_place(folder: Path, motions: language.Motions) -> int:
    """Write the column `language_persistent` of all frames, as one new version, whose number is returned.

    Earlier versions stay as they are, and readers see the old column or the new one. Rows of earlier runs are replaced,
    those of others stay; meta/info.json, its twin in meta.lance and `motions.DETAILS` follow when the version is there.

    Raises a `DataError` if another program names motions here, or changes the frames again and again meanwhile; nothing
    is changed then.
    """
    with needs("pylance", "write a LeRobot data set in Lance", "lance"):
        import lance
    info, _ = _checked(folder, motions)
    if info.storage != "lance":
        raise DataError(f"expected a data set in Lance to name motions in place, got {folder}; name a new folder")
    with _alone(folder):
        version = _name_frames(folder, info, motions, lance)
        declare(folder, info)
        os.replace(folder / language.PENDING, folder / language.DETAILS)
        if (folder / _META).is_dir():
            paths = [Path(name).relative_to("meta").as_posix() for name in (MARKER, language.DETAILS)]
            files = {"path": paths, "data": [(folder / "meta" / path).read_bytes() for path in paths]}
            table = lance.dataset(str(folder / _META))
            new = pa.table(files, schema=pa.schema([table.schema.field(name) for name in files]))
            table.merge_insert("path").when_matched_update_all().when_not_matched_insert_all().execute(new)
    return version


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Context manager: a lock on the data set, which ends with this process; a `DataError` where another has it."""
    (folder / language.DETAILS).parent.mkdir(parents=True, exist_ok=True)
    with (folder / language.DETAILS).with_name(".lock").open("ab") as handle:
        if os.name == "posix":
            import fcntl

            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                raise DataError(
                    f"expected no other program that names motions in {folder}, one is at work; run it again later"
                ) from error
        yield


def _name_frames(folder: Path, info: Info, motions: language.Motions, lance: Any) -> int:
    """Commit the new column, again from the newest version where another program was faster, and return its version."""
    # Should this process die between the new version and its details, the next run still knows whose rows they are.
    leftover = language.pending_details(folder)
    for _ in range(_ATTEMPTS):
        own = language.own_rows(folder)
        rows = new_rows(folder, info, info.data_path, motions, own)
        beside = folder / f"{language.PENDING}.new"
        beside.unlink(missing_ok=True)  # that of a run which was killed, or a link to a file elsewhere
        language.write_details(beside, [*((k, motions[k], rows[k]) for k in rows), *leftover])
        bring_to_disk(beside)
        os.replace(beside, folder / language.PENDING)
        try:
            return _commit(folder / info.data_path, rows, own, lance)
        except OSError as error:
            if not leftover:
                (folder / language.PENDING).unlink()
            if _CONFLICT not in str(error).lower():
                raise
    raise DataError(
        f"expected frames that no other program changes meanwhile, {folder} was changed {_ATTEMPTS} times; nothing was "
        "written, run it again"
    )


def _commit(path: Path, rows: language.Rows, own: language.OwnRows, lance: Any) -> int:
    """Write the column of each fragment, and make all of them one new version; frames stay in their order.

    An update of rows would move them, and the frame of an episode is found by its place.
    """
    table, column = lance.dataset(str(path)), language.COLUMNS[3]
    kind, is_there = column.type_in(table.schema), column.name in table.schema.names
    new = pa.schema([(_NEW if is_there else column.name, kind)])

    def extended(batch: Any) -> Any:
        old = batch.column(column.name) if is_there else None
        episodes = batch.column("episode_index").to_numpy(zero_copy_only=False)
        return pa.record_batch([column.extended(old, episodes, own, rows, kind)], schema=new)

    columns = ["episode_index", *([column.name] if is_there else [])]
    merged = [
        fragment.merge_columns(lance.batch_udf(output_schema=new)(extended), columns=columns, batch_size=_WRITTEN)
        for fragment in table.get_fragments()
    ]
    if not merged:
        raise DataError(f"expected frames in {path.name}, got none")
    fragments, schemas = map(list, zip(*merged, strict=True))
    schema = schemas[-1]
    if is_there:
        schema = _in_place_of_old(schema, lance)
        living = {*_numbers(schema.fields())}
        for fragment in fragments:  # files of replaced columns belong to earlier versions alone
            fragment.files = [file for file in fragment.files if living & {*file.fields}]
    operation = lance.LanceOperation.Merge(fragments, schema)
    return int(lance.LanceDataset.commit(str(path), operation, read_version=table.version).version)


def _in_place_of_old(schema: Any, lance: Any) -> Any:
    """Return the schema in which the new column has the name of the old one, which is gone.

    Lance changes schemas of tables only: this is a table without rows. The first commit numbers the fields anew, the
    second one takes them as they are; by these numbers they are found in the files.
    """
    with tempfile.TemporaryDirectory() as folder:
        path, operations = f"{folder}/empty.lance", lance.LanceOperation
        lance.LanceDataset.commit(path, operations.Overwrite(pa.schema([]), []))
        empty = lance.LanceDataset.commit(path, operations.Merge([], schema), read_version=1)
        empty.drop_columns([language.COLUMNS[3].name])
        empty.alter_columns({"path": _NEW, "name": language.COLUMNS[3].name})
        renamed = empty.lance_schema
    expected = [field.id() for field in schema.fields() if field.name() != language.COLUMNS[3].name]
    if (got := [field.id() for field in renamed.fields()]) != expected:
        raise DataError(f"expected fields {expected} of the frames from Lance {lance.__version__}, got {got}")
    return renamed


def _numbers(fields: Iterable[Any]) -> Iterator[int]:
    """Yield the numbers of fields and of those within them."""
    for field in fields:
        yield field.id()
        yield from _numbers(field.children())
