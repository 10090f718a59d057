"""Columns of a data set of LeRobot for texts that hold from a frame on, and rows of motions in them.

Version 3 has `language_persistent`, a list of rows. Programs for version 2 read texts but no lists: there
`annotation.motion` holds the same rows as JSON. Each frame holds all rows of its episode.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.lerobot.motions import ROLE, STYLE, OwnRows, Row, are_own

LANGUAGE = "language_persistent"
LANGUAGE_FEATURE = {"dtype": "language", "shape": [1], "names": None}  # as it stands in meta/info.json
MOTION_TEXTS = "annotation.motion"
TEXT_FEATURE = {"dtype": "string", "shape": [1], "names": None}

Integers = NDArray[np.int64]


class Column(NamedTuple):
    """The column of a version that carries texts."""

    name: str
    feature: dict[str, Any]  # its entry in meta/info.json
    type_in: Callable[[Any], Any]  # schema of a shard -> type of the column, whether the shard has it or not
    leaves: Callable[[Any], list[str]]  # type -> paths of its parts in a Parquet file
    # The column so far, the episode of each frame (T,), our rows of earlier runs -> episode and stamp of each row of
    # others that names a motion.
    others: Callable[[Any, Integers, OwnRows], Iterator[tuple[int, float]]]
    # The column so far or None, the same two, number of an episode -> its new rows, type -> the new column.
    extended: Callable[[Any, Integers, OwnRows, dict[int, list[Row]], Any], Any]


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


def others_in_language(old: Any, episodes: Integers, own: OwnRows) -> Iterator[tuple[int, float]]:
    """Yield episode and stamp of the rows of others that name motions."""
    flat, lengths = _lists_of_others(old, episodes, own)
    is_motion = np.ones(len(flat), dtype=bool)
    for name, value in (("style", STYLE), ("role", ROLE)):
        equal = pc.equal(pc.cast(pc.struct_field(flat, name), pa.string()), value)
        is_motion &= pc.fill_null(equal, False).to_numpy(zero_copy_only=False)
    stamps = pc.struct_field(flat, "timestamp").to_numpy(zero_copy_only=False)
    pairs = np.column_stack((np.repeat(episodes, lengths), stamps))[is_motion]
    yield from ((int(episode), stamp) for episode, stamp in np.unique(pairs, axis=0).tolist())


def with_language(old: Any, episodes: Integers, own: OwnRows, rows: dict[int, list[Row]], kind: Any) -> Any:
    """Return the column of some frames: the rows of others that are there, behind them the new ones of each episode."""
    numbers, episode_of = np.unique(episodes, return_inverse=True)
    new = [rows.get(number, []) for number in numbers.tolist()]
    added = _language_rows([row for of_episode in new for row in of_episode], kind.value_type)
    counts = np.array([len(of_episode) for of_episode in new], dtype=np.int64)
    flat, before = _lists_of_others(pa.nulls(len(episodes), kind) if old is None else old, episodes, own)
    after = counts[episode_of]
    lengths = before + after
    offsets = np.concatenate(([0], np.cumsum(lengths)))
    within = np.arange(offsets[-1]) - np.repeat(offsets[:-1], lengths)
    first_old = np.cumsum(before) - before
    first_added = len(flat) + (np.cumsum(counts) - counts)[episode_of] - before
    is_old = within < np.repeat(before, lengths)
    where = within + np.where(is_old, np.repeat(first_old, lengths), np.repeat(first_added, lengths))
    values = pa.concat_arrays([flat, added]).take(pa.array(where))
    absent = None if old is None else pa.array(np.asarray(old.is_null()) & (after == 0))
    return pa.ListArray.from_arrays(pa.array(offsets, pa.int32()), values, type=kind, mask=absent)


def _lists_of_others(old: Any, episodes: Integers, own: OwnRows) -> tuple[Any, Integers]:
    """Return the rows in all lists that are not ours, and how many each list has."""
    flat = old.flatten()
    counts = pc.fill_null(pc.list_value_length(old), 0).to_numpy(zero_copy_only=False).astype(np.int64)
    style, content = (pc.cast(pc.struct_field(flat, name), pa.string()) for name in ("style", "content"))
    stamps = pc.struct_field(flat, "timestamp").to_numpy(zero_copy_only=False)
    are_others = ~are_own(own, np.repeat(episodes, counts), stamps, style, content)
    until = np.concatenate(([0], np.cumsum(are_others)))[np.concatenate(([0], np.cumsum(counts)))]
    return flat.take(np.flatnonzero(are_others)), np.diff(until).astype(np.int64)


def _language_rows(rows: Sequence[Row], kind: Any) -> Any:
    values: dict[str, list[Any]] = {
        "role": [ROLE] * len(rows),
        "content": [row.content for row in rows],
        "style": [STYLE] * len(rows),
        "timestamp": [row.stamp for row in rows],
    }
    arrays = [
        pa.array(values[field.name], type=field.type) if field.name in values else pa.nulls(len(rows), field.type)
        for field in kind
    ]
    return pa.StructArray.from_arrays(arrays, fields=list(kind))


def text_type(schema: Any) -> Any:
    """Return the type of the column; a `DataError` if the shard has another of that name."""
    kind = schema.field(MOTION_TEXTS).type if MOTION_TEXTS in schema.names else pa.string()
    if kind not in (pa.string(), pa.large_string()):
        raise DataError(f"expected texts in {MOTION_TEXTS}, got {kind}")
    return kind


def others_in_texts(old: Any, episodes: Integers, own: OwnRows) -> Iterator[tuple[int, float]]:
    """Yield episode and stamp of the rows of others that name motions."""
    texts, _, pairs, _ = _coded(old, episodes)
    for text, episode in pairs.tolist():
        for row in _texts_of_others(texts[text], episode, own):
            if isinstance(row, dict) and (row.get("style"), row.get("role")) == (STYLE, ROLE):
                yield episode, _stamp(row)


def with_texts(old: Any, episodes: Integers, own: OwnRows, rows: dict[int, list[Row]], kind: Any) -> Any:
    """Return the column of some frames, see `with_language`."""
    plain = {"role": ROLE, "style": STYLE, "camera": None, "tool_calls": None}
    texts, _, pairs, which = _coded(old, episodes)
    contents = [
        _texts_of_others(texts[text], episode, own)
        + [{**plain, "content": row.content, "timestamp": row.stamp} for row in rows.get(episode, [])]
        for text, episode in pairs.tolist()
    ]
    return pa.array([json.dumps(content, ensure_ascii=False) for content in contents], kind).take(pa.array(which))


def _coded(old: Any, episodes: Integers) -> tuple[list[str], Integers, Integers, Integers]:
    """Return the texts that occur, which one each frame has, pairs of text and episode (n, 2), and those of frames."""
    texts, text_of = [""], np.zeros(len(episodes), dtype=np.int64)
    if old is not None:
        coded = old.dictionary_encode()
        texts = [text or "" for text in coded.dictionary.to_pylist()] + [""]
        text_of = coded.indices.fill_null(len(texts) - 1).to_numpy(zero_copy_only=False).astype(np.int64)
    pairs, which = np.unique(np.column_stack((text_of, episodes)), axis=0, return_inverse=True)
    return texts, text_of, pairs, which.ravel()


def _stamp(row: dict[str, Any]) -> float:
    stamp = row.get("timestamp")
    return float(stamp) if isinstance(stamp, (int, float)) else float("nan")


def _texts_of_others(text: str, episode: int, own: OwnRows) -> list[Any]:
    rows = None
    with suppress(ValueError, RecursionError):
        rows = json.loads(text or "[]")
    if not isinstance(rows, list):
        raise DataError(f"expected lists in JSON in {MOTION_TEXTS}, got {text[:40]!r}")
    plain = [row if isinstance(row, dict) else {} for row in rows]
    styles, contents = (
        pa.array([row[key] if isinstance(row.get(key), str) else None for row in plain], pa.string())
        for key in ("style", "content")
    )
    stamps = np.array([_stamp(row) for row in plain], dtype=np.float64)
    ours = are_own(own, np.full(len(rows), episode, dtype=np.int64), stamps, styles, contents)
    return [row for row, is_ours in zip(rows, ours.tolist(), strict=True) if not is_ours]


#: Version -> its column.
COLUMNS = {
    2: Column(MOTION_TEXTS, TEXT_FEATURE, text_type, lambda kind: [MOTION_TEXTS], others_in_texts, with_texts),
    3: Column(LANGUAGE, LANGUAGE_FEATURE, language_type, language_leaves, others_in_language, with_language),
}
