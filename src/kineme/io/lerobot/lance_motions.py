"""Name the motions of the episodes of a data set of LeRobot in Lance: in place, as one new version of its frames."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any

import pyarrow as pa

from kineme.errors import DataError
from kineme.io.lerobot.copy import Motions, checked_info, copy_others, declare, new_rows
from kineme.io.lerobot.info import MARKER, Info
from kineme.io.lerobot.language import COLUMNS
from kineme.io.lerobot.motions import (
    DETAILS,
    PENDING,
    OwnRows,
    Row,
    own_rows,
    pending_records,
    records_of,
    write_details,
)
from kineme.io.records import needs
from kineme.reporting.atomic import bring_to_disk

_FRAMES = 2**10  # of which the rows are in memory at a time
_ATTEMPTS = 3
_CONFLICT = "commit conflict"  # in what Lance says where another program was faster
_META = "meta.lance"  # the files of meta/ a second time, for programs that open the data set from afar
_NEW = "kineme_language_persistent"  # name of the column until it takes the place of another


def copy_in_lance(source: Path, target: Path, motions: Motions) -> None:
    """Copy a data set into an empty folder, its tables as hard links, and name the motions of its episodes there."""
    checked_info(source, motions)
    copy_others(source, target, set())
    name_in_place(target, motions)


def name_in_place(folder: Path, motions: Motions) -> int:
    """Write the column `language_persistent` of all frames, as one new version, whose number is returned.

    Earlier versions stay as they are, and readers see the old column or the new one. Rows of earlier runs are replaced,
    those of others stay; meta/info.json, its twin in meta.lance and `motions.DETAILS` follow when the version is there.

    Raises a `DataError` if another program names motions here, or changes the frames again and again meanwhile; nothing
    is changed then.
    """
    with needs("pylance", "write a LeRobot data set in Lance", "lance"):
        import lance
    info = checked_info(folder, motions)
    if info.storage != "lance":
        raise DataError(f"expected a data set in Lance to name motions in place, got {folder}; name a new folder")
    with _alone(folder):
        version = _name_frames(folder, info, motions, lance)
        declare(folder, COLUMNS[info.version])
        bring_to_disk(folder / PENDING)
        os.replace(folder / PENDING, folder / DETAILS)
        if (folder / _META).is_dir():
            paths = [Path(name).relative_to("meta").as_posix() for name in (MARKER, DETAILS)]
            files = {"path": paths, "data": [(folder / "meta" / path).read_bytes() for path in paths]}
            table = lance.dataset(str(folder / _META))
            new = pa.table(files, schema=pa.schema([table.schema.field(name) for name in files]))
            table.merge_insert("path").when_matched_update_all().when_not_matched_insert_all().execute(new)
    return version


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Context manager: a lock on the data set, which ends with this process; a `DataError` where another has it."""
    (folder / DETAILS).parent.mkdir(parents=True, exist_ok=True)
    with (folder / DETAILS).with_name(".lock").open("ab") as handle:
        if os.name == "posix":
            import fcntl

            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                raise DataError(
                    f"expected no other program that names motions in {folder}, one is at work; run it again later"
                ) from error
        yield


def _name_frames(folder: Path, info: Info, motions: Motions, lance: Any) -> int:
    """Commit the new column, again from the newest version where another program was faster, and return its version."""
    # Should this process die between the new version and its details, the next run still knows whose rows they are.
    leftover = pending_records(folder)
    for _ in range(_ATTEMPTS):
        own = own_rows(folder)
        rows = new_rows(folder, info, info.data_path, motions, own)
        records = (record for k in rows for record in records_of(k, motions[k], rows[k]))
        beside = folder / f"{PENDING}.new"
        write_details(beside, chain(records, leftover))
        os.replace(beside, folder / PENDING)
        try:
            return _commit(folder / info.data_path, rows, own, lance)
        except OSError as error:
            if not leftover:
                (folder / PENDING).unlink()
            if _CONFLICT not in str(error).lower():
                raise
    raise DataError(
        f"expected frames that no other program changes meanwhile, {folder} was changed {_ATTEMPTS} times; nothing was "
        "written, run it again"
    )


def _commit(path: Path, rows: dict[int, list[Row]], own: OwnRows, lance: Any) -> int:
    """Write the column of each fragment, and make all of them one new version; frames stay in their order.

    An update of rows would move them, and the frame of an episode is found by its place.
    """
    table, column = lance.dataset(str(path)), COLUMNS[3]
    kind, is_there = column.type_in(table.schema), column.name in table.schema.names
    new = pa.schema([(_NEW if is_there else column.name, kind)])

    def extended(batch: Any) -> Any:
        old = batch.column(column.name) if is_there else None
        episodes = batch.column("episode_index").to_numpy(zero_copy_only=False)
        return pa.record_batch([column.extended(old, episodes, own, rows, kind)], schema=new)

    columns = ["episode_index", *([column.name] if is_there else [])]
    merged = [
        fragment.merge_columns(lance.batch_udf(output_schema=new)(extended), columns=columns, batch_size=_FRAMES)
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
        empty.drop_columns([COLUMNS[3].name])
        empty.alter_columns({"path": _NEW, "name": COLUMNS[3].name})
        renamed = empty.lance_schema
    expected = [field.id() for field in schema.fields() if field.name() != COLUMNS[3].name]
    if (got := [field.id() for field in renamed.fields()]) != expected:
        raise DataError(f"expected fields {expected} of the frames from Lance {lance.__version__}, got {got}")
    return renamed


def _numbers(fields: Iterable[Any]) -> Iterator[int]:
    """Yield the numbers of fields and of those within them."""
    for field in fields:
        yield field.id()
        yield from _numbers(field.children())
