"""The column `language_persistent` of a data set of LeRobot: texts that hold from a time of an episode on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError

COLUMN = "language_persistent"
FEATURE = {"dtype": "language", "shape": [1], "names": None}  # as it stands in meta/info.json

#: Of a movement, in coordinates of the robot: not of a camera, which stays null.
_ROLE, _STYLE = "assistant", "motion"


class Motion(NamedTuple):
    """A text about a movement of an episode.

    Attributes
    ----------
    start : float
        Seconds since the beginning of the episode; the stored stamp of the nearest frame is written.
    content : str
    """

    start: float
    content: str


def write_shard(source: Path, target: Path, motions: Mapping[int, Sequence[Motion]]) -> None:
    """Copy a shard, group of rows after group of rows, with the texts of its episodes on each of their frames.

    Texts that are there already stay, before those that are added. All other columns, what the file says of itself,
    its groups of rows and its compression are those of the source.

    Raises
    ------
    DataError
        A column of that name which is none of LeRobot's, or a damaged file.
    """
    import pyarrow as pa
    from pyarrow import parquet

    try:
        with parquet.ParquetFile(source) as file:
            schema = file.schema_arrow
            kind = _kind(schema, source.name)
            rows = _snapped(file, motions)
            if COLUMN not in schema.names:
                schema = schema.append(pa.field(COLUMN, kind))
            with parquet.ParquetWriter(target, schema, compression=_compression(file.metadata, kind)) as writer:
                for k in range(file.num_row_groups):
                    table = file.read_row_group(k, use_threads=False)
                    writer.write_table(_extended(table, rows, kind, schema), row_group_size=max(table.num_rows, 1))
    except (pa.ArrowException, ValueError, KeyError) as error:
        raise DataError(f"expected the shard {source.name} to take the column {COLUMN}, got: {error}") from error


def _kind(schema: Any, name: str) -> Any:
    """The type of the column: that which the shard has, else LeRobot's, with calls of tools as texts in JSON."""
    import pyarrow as pa

    if COLUMN in schema.names:
        kind = schema.field(COLUMN).type
        known = {one.name for one in kind.value_type} if _is_list_of_rows(kind) else set()
        if not {"role", "content", "style", "timestamp"} <= known:
            raise DataError(f"{name}: expected rows with role, content, style, timestamp in {COLUMN}, got {kind}")
        return kind
    fields = [
        pa.field("role", pa.string(), nullable=False),
        pa.field("content", pa.string()),
        pa.field("style", pa.string()),
        pa.field("timestamp", pa.float32(), nullable=False),
        pa.field("camera", pa.string()),
        pa.field("tool_calls", pa.list_(pa.string())),
    ]
    return pa.list_(pa.struct(fields))


def _is_list_of_rows(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_list(kind) and pa.types.is_struct(kind.value_type))


def _compression(metadata: Any, kind: Any) -> str | dict[str, str]:
    """Leaf of a column -> how the source compresses it; the new column as the first one."""
    if not metadata.num_row_groups or not metadata.num_columns:
        return "snappy"
    group = metadata.row_group(0)
    columns = [group.column(k) for k in range(group.num_columns)]
    known = {one.path_in_schema: str(one.compression) for one in columns}
    leaves = [f"{COLUMN}.list.element.{one.name}" for one in kind.value_type]
    leaves += [f"{leaf}.list.element" for leaf in leaves]
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


def _extended(table: Any, motions: Mapping[int, list[Motion]], kind: Any, schema: Any) -> Any:
    """Rows of a shard with the column, new or longer."""
    import pyarrow as pa

    episodes = table.column("episode_index").to_numpy()
    known, episode_of = np.unique(episodes, return_inverse=True)
    texts = [motions.get(int(k), []) for k in known]
    added = _rows([one for some in texts for one in some], kind.value_type)
    counts = np.array([len(some) for some in texts], dtype=np.int64)
    old = table.column(COLUMN).combine_chunks() if COLUMN in table.column_names else pa.nulls(len(table), kind)
    if isinstance(old, pa.ChunkedArray):
        old = pa.concat_arrays(old.chunks) if old.num_chunks else pa.nulls(0, kind)
    column = _lengthened(old, added, counts, episode_of, kind, COLUMN in table.column_names)
    columns = [column if name == COLUMN else table.column(name) for name in schema.names]
    return pa.Table.from_arrays(columns, schema=schema)


def _lengthened(
    old: Any, added: Any, counts: NDArray[np.int64], episode_of: NDArray[np.intp], kind: Any, keep_nulls: bool
) -> Any:
    """Lists with those of the episode behind: what is added stands episode after episode, `counts` of each."""
    import pyarrow as pa
    import pyarrow.compute as pc

    flat = old.flatten()
    before = pc.fill_null(pc.list_value_length(old), 0).to_numpy(zero_copy_only=False).astype(np.int64)
    own = counts[episode_of]
    lengths = before + own
    offsets = np.concatenate(([0], np.cumsum(lengths)))
    within = np.arange(offsets[-1]) - np.repeat(offsets[:-1], lengths)
    first_old = np.cumsum(before) - before
    first_added = len(flat) + (np.cumsum(counts) - counts)[episode_of] - before
    is_old = within < np.repeat(before, lengths)
    where = within + np.where(is_old, np.repeat(first_old, lengths), np.repeat(first_added, lengths))
    values = pa.concat_arrays([flat, added]).take(pa.array(where))
    absent = pa.array(np.asarray(old.is_null()) & (own == 0)) if keep_nulls else None
    return pa.ListArray.from_arrays(pa.array(offsets, pa.int32()), values, type=kind, mask=absent)


def _rows(motions: Sequence[Motion], kind: Any) -> Any:
    import pyarrow as pa

    known: dict[str, list[Any]] = {
        "role": [_ROLE] * len(motions),
        "content": [one.content for one in motions],
        "style": [_STYLE] * len(motions),
        "timestamp": [one.start for one in motions],
    }
    fields = list(kind)
    arrays = [
        pa.array(known[one.name], type=one.type) if one.name in known else pa.nulls(len(motions), one.type)
        for one in fields
    ]
    return pa.StructArray.from_arrays(arrays, fields=fields)
