"""Motions of a data set of LeRobot: rows that say on its frames what holds when, and a table with the details.

Version 3 has the column `language_persistent` for them, a list of rows. Programs for version 2 read texts but no lists:
there `annotation.motion` holds the same rows as JSON. Each frame holds all rows of its episode.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import parquet

from kineme.errors import DataError
from kineme.io.limits import check_expanded
from kineme.io.records import UNKNOWN, damaged_as
from kineme.validation import Array

#: Of a movement, in coordinates of the robot: not of a camera, which stays null.
ROLE, STYLE = "assistant", "motion"
#: With which a content began before `DETAILS` said which rows are ours.
OWN = '{"annotator": "kineme"'
REST = "rest"  # content where no movement holds

DETAILS = "meta/kineme/motions.parquet"
PENDING = "meta/kineme/motions.pending.parquet"  # details of rows that are about to be written in place

LANGUAGE = "language_persistent"
LANGUAGE_FEATURE = {"dtype": "language", "shape": [1], "names": None}  # as it stands in meta/info.json
MOTION_TEXTS = "annotation.motion"
TEXT_FEATURE = {"dtype": "string", "shape": [1], "names": None}

_CLOSEST = 0.2001  # s; LeRobot's `emitted_at` takes rows within 0.1 s of a frame, and refuses to choose between two
_AT_ONCE = 2**16  # lines of the table
_A_LINE = 200  # bytes that one takes once it is read


class Motion(NamedTuple):
    """A stretch of motion in an episode, and the symbol that it shows."""

    episode: int
    start: float  # seconds since the beginning of the episode, as its stamps count them
    end: float
    symbol: str | None  # None: motion that is like no symbol
    p_value: float = math.nan  # share of movements of known symbols that would be as novel or more
    confidence: float = math.nan  # probability that the symbol is right
    uncertainty: float = math.nan  # half of the 95 % interval of start and end, of the less certain one [s]
    annotator: str = "kineme"


Motions = Mapping[int, Sequence[Motion]]  # by the numbers of their episodes


class Row(NamedTuple):
    """A text that holds from a frame of an episode on, until that of the next row."""

    stamp: float  # stored stamp of the frame [s]
    content: str  # symbol, `UNKNOWN` or `REST`
    motion: Motion | None = None  # which begins there; None for a rest, and for a movement that goes on


Rows = Mapping[int, Sequence[Row]]  # by the numbers of their episodes


Details = tuple[int, Sequence[Motion], Sequence[Row]]  # an episode, its motions, and the rows that were written


_SCHEMA = pa.schema(
    {
        "episode_index": pa.int64(), "start": pa.float64(), "end": pa.float64(), "symbol": pa.string(),
        "p_value": pa.float64(), "confidence": pa.float64(), "uncertainty": pa.float64(), "annotator": pa.string(),
        "timestamp": pa.float32(), "content": pa.string(),
    }
)  # fmt: skip


def rows_of(stamps: Array, motions: Sequence[Motion], taken: Collection[float] = ()) -> list[Row]:
    """Return the rows of an episode whose frames have these stamps (T,), in their order, each at another stamp.

    A movement begins and ends at the nearest frame; of two that overlap, the later one holds. Where none holds is rest.
    What lasts 0.2 s or less gets no row, so that the row before holds on; nor does a stamp that is `taken`.
    """
    if not motions or not len(stamps):
        return []
    ordered = sorted(motions, key=lambda motion: motion.start)
    edges = np.array([(motion.start, motion.end) for motion in ordered])
    ascending = np.argsort(stamps, kind="stable")
    middles = (stamps[ascending][1:] + stamps[ascending][:-1]) / 2
    firsts, lasts = ascending[np.searchsorted(middles, edges)].T
    owner = np.full(len(stamps), -1)
    for k, (first, last) in enumerate(zip(firsts.tolist(), lasts.tolist(), strict=True)):
        owner[first : max(first, last) + 1] = k
    frames = np.concatenate(([0], np.flatnonzero(np.diff(owner)) + 1))
    lasting = np.diff(stamps[frames], append=stamps[-1]) > _CLOSEST
    rows: list[Row] = []
    occupied, before = {float(np.float32(stamp)) for stamp in taken}, None
    begun: set[int] = set()
    for frame in frames[lasting].tolist():
        k, stamp = int(owner[frame]), float(np.float32(stamps[frame]))
        if k == before or not math.isfinite(stamp):
            continue
        if stamp in occupied:
            before = None  # what another said holds now, so that the next row is needed in any case
            continue
        motion = ordered[k] if k >= 0 else None
        content = REST if motion is None else UNKNOWN if motion.symbol is None else motion.symbol
        rows.append(Row(stamp, content, None if k in begun else motion))
        occupied.add(stamp)
        begun.add(k)
        before = k
    return rows


def write_details(path: Path, details: Iterable[Details]) -> None:
    """Write a new file with a line for each motion, with its row if it has one, and for each other row."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = (line for episode, motions, rows in details for line in _lines(episode, motions, rows))
    with parquet.ParquetWriter(path, _SCHEMA) as writer:
        while batch := list(islice(lines, _AT_ONCE)):
            columns = zip(*batch, strict=True)
            arrays = [pa.array(column, kind) for column, kind in zip(columns, _SCHEMA.types, strict=True)]
            writer.write_table(pa.Table.from_arrays(arrays, schema=_SCHEMA))


def _lines(episode: int, motions: Sequence[Motion], rows: Sequence[Row]) -> Iterator[tuple[Any, ...]]:
    begins = {id(row.motion): row[:2] for row in rows}
    for motion in motions:
        cells = (None if isinstance(cell, float) and math.isnan(cell) else cell for cell in motion[1:])
        yield episode, *cells, *begins.get(id(motion), (None, None))
    yield from ((episode, *[None] * 7, *row[:2]) for row in rows if row.motion is None)


def read_motions(folder: Path | str) -> list[Motion]:
    """Return the motions that were written into a data set of LeRobot, in order of episodes and starts; [] if none.

    Raises a `DataError` if their table is damaged.
    """
    table = _read_details(Path(folder) / DETAILS)
    table = table.filter(pc.is_valid(table.column("start")))
    table = table.sort_by([("episode_index", "ascending"), ("start", "ascending")])
    numbers = [table.column(name).fill_null(math.nan).to_pylist() for name in ("p_value", "confidence", "uncertainty")]
    plain = [table.column(name).to_pylist() for name in ("episode_index", "start", "end", "symbol")]
    return [Motion(*cells) for cells in zip(*plain, *numbers, table.column("annotator").to_pylist(), strict=True)]


def _read_details(path: Path) -> Any:
    """Return the lines as a table of Arrow, empty if there is no such file."""
    if not path.is_file():
        return _SCHEMA.empty_table()
    said = f"expected {path.name} as kineme writes it in meta/kineme, got another file; remove it"
    with damaged_as(said, pa.ArrowException, OSError, ValueError, KeyError), parquet.ParquetFile(path) as file:
        check_expanded(_A_LINE * file.metadata.num_rows, path.name)
        return file.read(columns=_SCHEMA.names, use_threads=False).select(_SCHEMA.names).cast(_SCHEMA)


class OwnRows(NamedTuple):
    """Rows of earlier runs, which a later run replaces."""

    texts: Any  # column of the texts that occur
    stamps: NDArray[np.float32]  # those that occur, ascending
    keys: NDArray[np.int64]  # see `_keys`; ascending


def own_rows(folder: Path) -> OwnRows:
    """Read the rows of earlier runs, also of one that was killed."""
    table = pa.concat_tables([_read_details(folder / name) for name in (DETAILS, PENDING)])
    table = table.filter(pc.is_valid(table.column("timestamp"))).combine_chunks()
    contents, stamps = table.column("content"), table.column("timestamp").to_numpy()
    own = OwnRows(pc.unique(contents), np.unique(stamps), np.empty(0, dtype=np.int64))
    keys = np.unique(_keys(own, table.column("episode_index").to_numpy(), stamps, contents))
    return own._replace(keys=keys[keys >= 0])


def _keys(own: OwnRows, episodes: NDArray[np.int64], stamps: NDArray[Any], contents: Any) -> NDArray[np.int64]:
    """Return a number for each row (n,), the same for equal rows only; -1 for a row that cannot be ours."""
    if not len(own.stamps):
        return np.full(len(episodes), -1, dtype=np.int64)
    text = pc.fill_null(pc.index_in(contents, value_set=own.texts), -1).to_numpy(zero_copy_only=False)
    at = np.searchsorted(own.stamps, stamps).clip(max=len(own.stamps) - 1)
    keys = (episodes * len(own.texts) + text) * len(own.stamps) + at
    return np.where((text >= 0) & (own.stamps[at] == stamps) & (episodes >= 0), keys, -1)


def are_own(
    own: OwnRows, episodes: NDArray[np.int64], stamps: NDArray[Any], styles: Any, contents: Any
) -> NDArray[np.bool_]:
    """Tell of rows (n,) whether they are ours: those of the table of details, and those that begin with `OWN`."""
    listed = np.isin(_keys(own, episodes, stamps.astype(np.float32), contents), own.keys)
    begins = pc.fill_null(pc.starts_with(contents, OWN), False).to_numpy(zero_copy_only=False)
    return (listed | begins) & pc.fill_null(pc.equal(styles, STYLE), False).to_numpy(zero_copy_only=False)


def pending_details(folder: Path) -> list[Details]:
    """Return the rows that a run which was killed may have written."""
    cells = _read_details(folder / PENDING).select(["episode_index", "timestamp", "content"]).to_pydict().values()
    return [(k, (), [Row(stamp, text)]) for k, stamp, text in zip(*cells, strict=True) if stamp is not None]


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
    extended: Callable[[Any, Integers, OwnRows, Rows, Any], Any]


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


def with_language(old: Any, episodes: Integers, own: OwnRows, rows: Rows, kind: Any) -> Any:
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
    texts, pairs, _ = _coded(old, episodes)
    for text, episode in pairs.tolist():
        for row in _texts_of_others(texts[text], episode, own):
            if isinstance(row, dict) and (row.get("style"), row.get("role")) == (STYLE, ROLE):
                yield episode, _stamp(row)


def with_texts(old: Any, episodes: Integers, own: OwnRows, rows: Rows, kind: Any) -> Any:
    """Return the column of some frames, see `with_language`."""
    plain = {"role": ROLE, "style": STYLE, "camera": None, "tool_calls": None}
    texts, pairs, which = _coded(old, episodes)
    contents = [
        _texts_of_others(texts[text], episode, own)
        + [{**plain, "content": row.content, "timestamp": row.stamp} for row in rows.get(episode, [])]
        for text, episode in pairs.tolist()
    ]
    return pa.array([json.dumps(content, ensure_ascii=False) for content in contents], kind).take(pa.array(which))


def _coded(old: Any, episodes: Integers) -> tuple[list[str], Integers, Integers]:
    """Return the texts that occur, pairs of text and episode (n, 2), and which pair each frame has."""
    texts, text_of = [""], np.zeros(len(episodes), dtype=np.int64)
    if old is not None:
        coded = old.dictionary_encode()
        texts = [text or "" for text in coded.dictionary.to_pylist()] + [""]
        text_of = coded.indices.fill_null(len(texts) - 1).to_numpy(zero_copy_only=False).astype(np.int64)
    pairs, which = np.unique(np.column_stack((text_of, episodes)), axis=0, return_inverse=True)
    return texts, pairs, which.ravel()


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
