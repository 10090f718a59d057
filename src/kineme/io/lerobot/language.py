"""The column `language_persistent` of version 3 of LeRobot: texts that hold from a time of an episode on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.lerobot.motions import OWN, ROLE, STYLE, Motion

COLUMN = "language_persistent"
FEATURE = {"dtype": "language", "shape": [1], "names": None}  # as it stands in meta/info.json


def language_type(schema: Any) -> Any:
    """The type of the column: that which the shard has, else LeRobot's, with calls of tools as texts in JSON."""
    import pyarrow as pa

    if COLUMN in schema.names:
        kind = schema.field(COLUMN).type
        known = {one.name for one in kind.value_type} if _is_list_of_rows(kind) else set()
        if not {"role", "content", "style", "timestamp"} <= known:
            raise DataError(f"expected rows with role, content, style, timestamp in {COLUMN}, got {kind}")
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


def language_leaves(kind: Any) -> list[str]:
    """Paths of the parts of the column in a Parquet file."""
    leaves = [f"{COLUMN}.list.element.{one.name}" for one in kind.value_type]
    return [*leaves, *(f"{leaf}.list.element" for leaf in leaves)]


def with_language(old: Any, motions: Sequence[Sequence[Motion]], episode_of: NDArray[np.intp], kind: Any) -> Any:
    """The column of some rows: those of others that are there, behind them the texts of each row's episode.

    Parameters
    ----------
    old : pyarrow array or None
        The column so far.
    motions : sequence of sequences of Motion
        For each of some episodes.
    episode_of : ndarray of shape (T,)
        Which of them a row belongs to.
    kind : pyarrow type
        See `language_type`.
    """
    import pyarrow as pa

    added = _rows([one for some in motions for one in some], kind.value_type)
    counts = np.array([len(some) for some in motions], dtype=np.int64)
    if old is None:
        return _lengthened(pa.nulls(len(episode_of), kind), added, counts, episode_of, kind, False)
    return _lengthened(old, added, counts, episode_of, kind, True)


def _lengthened(
    old: Any, added: Any, counts: NDArray[np.int64], episode_of: NDArray[np.intp], kind: Any, keep_nulls: bool
) -> Any:
    """Lists with those of the episode behind: what is added stands episode after episode, `counts` of each."""
    import pyarrow as pa

    flat, before = _of_others(old)
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


def _of_others(old: Any) -> tuple[Any, NDArray[np.int64]]:
    """The rows in all lists that are not of this package, and how many each list has."""
    import pyarrow as pa
    import pyarrow.compute as pc

    flat = old.flatten()
    counts = pc.fill_null(pc.list_value_length(old), 0).to_numpy(zero_copy_only=False).astype(np.int64)
    style, content = (pc.cast(pc.struct_field(flat, name), pa.string()) for name in ("style", "content"))
    ours = pc.and_(pc.equal(style, STYLE), pc.starts_with(content, OWN))
    kept = ~pc.fill_null(ours, False).to_numpy(zero_copy_only=False)
    until = np.concatenate(([0], np.cumsum(kept)))[np.concatenate(([0], np.cumsum(counts)))]
    return flat.take(np.flatnonzero(kept)), np.diff(until).astype(np.int64)


def _rows(motions: Sequence[Motion], kind: Any) -> Any:
    import pyarrow as pa

    known: dict[str, list[Any]] = {
        "role": [ROLE] * len(motions),
        "content": [one.content for one in motions],
        "style": [STYLE] * len(motions),
        "timestamp": [one.start for one in motions],
    }
    fields = list(kind)
    arrays = [
        pa.array(known[one.name], type=one.type) if one.name in known else pa.nulls(len(motions), one.type)
        for one in fields
    ]
    return pa.StructArray.from_arrays(arrays, fields=fields)
