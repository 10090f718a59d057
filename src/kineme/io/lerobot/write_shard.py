"""Copy a shard of a data set of LeRobot with texts about the movements of its episodes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import DataError
from kineme.io.lerobot import language, text_column
from kineme.io.lerobot.motions import Motion


class Column(NamedTuple):
    """The column of a version that carries texts.

    Attributes
    ----------
    name : str
    feature : dict
        Its entry in meta/info.json.
    type_in : callable
        Schema of a shard -> type of the column, whether the shard has it or not.
    leaves : callable
        Type -> paths of its parts in a Parquet file.
    extended : callable
        See `kineme.io.lerobot.language.with_language`.
    """

    name: str
    feature: dict[str, Any]
    type_in: Callable[[Any], Any]
    leaves: Callable[[Any], list[str]]
    extended: Callable[[Any, Any, Any, Any], Any]


#: Version -> its column.
COLUMNS = {
    2: Column(
        text_column.COLUMN, text_column.FEATURE, text_column.text_type, text_column.text_leaves, text_column.with_texts
    ),
    3: Column(
        language.COLUMN, language.FEATURE, language.language_type, language.language_leaves, language.with_language
    ),
}


def write_shard(source: Path, target: Path, motions: Mapping[int, Sequence[Motion]], column: Column) -> None:
    """Copy a shard, group of rows after group of rows, with the texts of its episodes on each of their frames.

    Texts of others stay, before those that are added; those of this package are replaced. All other columns, what the
    file says of itself, its groups of rows and its compression are those of the source.

    Raises
    ------
    DataError
        A column of that name which is none of LeRobot's, or a damaged file.
    """
    import pyarrow as pa
    from pyarrow import parquet

    try:
        with _opened(source) as file:
            schema = file.schema_arrow
            kind = column.type_in(schema)
            with _reading():
                rows = _snapped(file, motions)
            if column.name not in schema.names:
                schema = schema.append(pa.field(column.name, kind))
            packed = _compression(file.metadata, column.leaves(kind))
            with parquet.ParquetWriter(target, schema, compression=packed) as writer:
                for k in range(file.num_row_groups):
                    with _reading():
                        table = file.read_row_group(k, use_threads=False)
                    writer.write_table(
                        _extended(table, rows, column, kind, schema), row_group_size=max(table.num_rows, 1)
                    )
    except DataError as error:
        raise DataError(f"{source.name}: {error}") from error
    except (pa.ArrowException, ValueError, KeyError) as error:
        raise DataError(f"expected the shard {source.name} to take the column {column.name}, got: {error}") from error


def _opened(source: Path) -> Any:
    from pyarrow import parquet

    with _reading():
        return parquet.ParquetFile(source)


@contextmanager
def _reading() -> Iterator[None]:
    """Damage is an error of the data; what is wrong with the disk when writing stays one of the system."""
    try:
        yield
    except OSError as error:
        raise DataError(f"expected a Parquet file, got a damaged one ({error})") from error


def _compression(metadata: Any, leaves: Sequence[str]) -> str | dict[str, str]:
    """Leaf of a column -> how the source compresses it; the new column as the first one."""
    if not metadata.num_row_groups or not metadata.num_columns:
        return "snappy"
    group = metadata.row_group(0)
    columns = [group.column(k) for k in range(group.num_columns)]
    known = {one.path_in_schema: str(one.compression) for one in columns}
    known = dict.fromkeys(leaves, str(columns[0].compression)) | known
    return {path: "NONE" if name == "UNCOMPRESSED" else name for path, name in known.items()}


def _snapped(file: Any, motions: Mapping[int, Sequence[Motion]]) -> dict[int, list[Motion]]:
    """The texts of the episodes of a shard, each at the stamp of a frame, in the order of time."""
    known = file.read(columns=["episode_index", "timestamp"], use_threads=False)
    episodes, stamps = (known.column(name).to_numpy() for name in ("episode_index", "timestamp"))
    found: dict[int, list[Motion]] = {}
    for episode in np.unique(episodes).tolist():
        own = stamps[episodes == episode] if episode in motions else stamps[:0]
        nearest = [float(own[np.abs(own - one.start).argmin()]) for one in motions.get(episode, ())]
        some = zip(nearest, motions.get(episode, ()), strict=True)
        found[episode] = sorted(one._replace(start=stamp) for stamp, one in some)
    return found


def _extended(table: Any, motions: Mapping[int, list[Motion]], column: Column, kind: Any, schema: Any) -> Any:
    """Rows of a shard with the column, new or longer."""
    import pyarrow as pa

    known, episode_of = np.unique(table.column("episode_index").to_numpy(), return_inverse=True)
    old = table.column(column.name) if column.name in table.column_names else None
    if old is not None:
        old = pa.concat_arrays(old.chunks) if old.num_chunks else pa.nulls(0, kind)
    new = column.extended(old, [motions.get(int(k), []) for k in known], episode_of, kind)
    columns = [new if name == column.name else table.column(name) for name in schema.names]
    return pa.Table.from_arrays(columns, schema=schema)
