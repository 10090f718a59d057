"""Motions of a data set of LeRobot: the rows that say on its frames what holds when, and a table with the details."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import parquet

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

_CLOSEST = 0.2  # s; LeRobot's `emitted_at` takes rows within 0.1 s of a frame, and refuses to choose between two
_AT_ONCE = 2**16  # records
_A_ROW = 200  # bytes that a record takes once it is read


class Motion(NamedTuple):
    """A stretch of motion in an episode, and the symbol that it shows."""

    episode: int
    start: float  # seconds since the beginning of the episode, as its stamps count them
    end: float
    symbol: str | None  # None: motion that is like no symbol
    p_value: float = math.nan  # share of movements of known symbols that would be as novel or more
    confidence: float = math.nan  # probability that the symbol is right
    uncertainty: float = math.nan  # of the boundaries [s]
    annotator: str = "kineme"


class Row(NamedTuple):
    """A text that holds from a frame of an episode on, until that of the next row."""

    stamp: float  # stored stamp of the frame [s]
    content: str  # symbol, `UNKNOWN` or `REST`
    motion: Motion | None = None  # which begins there; None for a rest, and for a movement that goes on


class Record(NamedTuple):
    """A line of `DETAILS`: a motion and its row, or either alone."""

    episode: int
    motion: Motion | None
    row: Row | None


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
    seen, before = {float(np.float32(stamp)) for stamp in taken}, None
    begun: set[int] = set()
    for frame in frames[lasting].tolist():
        k, stamp = int(owner[frame]), float(np.float32(stamps[frame]))
        if k == before or stamp in seen or not math.isfinite(stamp):
            continue
        motion = ordered[k] if k >= 0 else None
        content = REST if motion is None else UNKNOWN if motion.symbol is None else motion.symbol
        rows.append(Row(stamp, content, None if k in begun else motion))
        seen.add(stamp)
        begun.add(k)
        before = k
    return rows


def records_of(episode: int, motions: Sequence[Motion], rows: Sequence[Row]) -> Iterator[Record]:
    """Yield the records of an episode."""
    begins = {id(row.motion): row for row in rows if row.motion is not None}
    yield from (Record(episode, motion, begins.get(id(motion))) for motion in motions)
    yield from (Record(episode, None, row) for row in rows if row.motion is None)


def write_details(path: Path, records: Iterable[Record]) -> None:
    """Write the records to a new file, some at a time."""
    path.parent.mkdir(parents=True, exist_ok=True)
    remaining = iter(records)
    with parquet.ParquetWriter(path, _SCHEMA) as writer:
        while batch := list(islice(remaining, _AT_ONCE)):
            columns = zip(*map(_as_cells, batch), strict=True)
            arrays = [pa.array(column, kind) for column, kind in zip(columns, _SCHEMA.types, strict=True)]
            writer.write_table(pa.Table.from_arrays(arrays, schema=_SCHEMA))


def _as_cells(record: Record) -> tuple[Any, ...]:
    motion, row = record.motion, record.row
    details = (None,) * 7 if motion is None else motion[1:]
    cells = (None if isinstance(cell, float) and math.isnan(cell) else cell for cell in details)
    return record.episode, *cells, *((None, None) if row is None else row[:2])


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
    """Return the records as a table of Arrow, empty if there is no such file."""
    if not path.is_file():
        return _SCHEMA.empty_table()
    said = f"expected {path.name} as kineme writes it in meta/kineme, got another file; remove it"
    with damaged_as(said, pa.ArrowException, OSError, ValueError, KeyError), parquet.ParquetFile(path) as file:
        check_expanded(_A_ROW * file.metadata.num_rows, path.name)
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


def pending_records(folder: Path) -> list[Record]:
    """Return the rows that a run which was killed may have written."""
    cells = _read_details(folder / PENDING).select(["episode_index", "timestamp", "content"]).to_pydict().values()
    return [Record(k, None, Row(stamp, text)) for k, stamp, text in zip(*cells, strict=True) if stamp is not None]
