"""States of the world before and after the movements of a library: from their recordings, and a table beside them."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError, SpecificationError
from kineme.io.limits import check_expanded, read_limited
from kineme.io.tables.dialect import COMMA_NUMBER, as_float, is_number, marks_within
from kineme.library.library import ActionLibrary
from kineme.library.storage import read
from kineme.movements.tables.columns import is_time
from kineme.movements.tables.time_stamps import in_seconds, unit_in_head
from kineme.planning.skill import is_gripper, place_columns
from kineme.reporting.text import counted, first_names, text_in
from kineme.units import converted, split_head, unit_named
from kineme.validation import Array

HAND = "hand"
_HANDS = ("tip", "hand", "tcp", "ee", "end_effector", "tool")  # names of a hand's own columns in a table
_MOVEMENTS, _MOMENTS = ("movement", "id", "file", "recording", "name"), ("moment", "when", "state")
_BEFORE, _AFTER = ("before", "start", "begin"), ("after", "end", "stop")
_MISSING = frozenset({"", "-", "?", "na", "n/a", "nan", "none", "null", "unknown"})
_WITHIN = 0.2  # of the movement: a state so long after its start counts as before it, where there is none earlier
_NEAR = 0.05  # of the movement: so much later than its start, or earlier than its end, is at it; cuts are not exact
_CELL = 200  # bytes that a character of a table may take in Python, at most

#: A state at one moment: column -> number or word; what is missing or None is not known.
State = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class States:
    """States before and after n movements, in c columns.

    - `movements` (n,): ids in the library. `symbols`: the symbol of each.
    - `axes`: k coordinates of places, ``x`` where the recordings have ``tip_x [mm]``; the columns ``hand_x`` ... are
      where the hand is.
    - `before`, `after` (n, c): NaN is not known; a word is its number in `words` of its column.
    - `units`: of the columns of which the recordings or the table say one, as ``mm``.
    - `missing`: ids of movements before or after which the table has no row.
    """

    movements: NDArray[np.int64]
    symbols: tuple[str, ...]
    axes: tuple[str, ...]
    columns: tuple[str, ...]
    before: Array
    after: Array
    words: Mapping[str, tuple[str, ...]]
    units: Mapping[str, str] = field(default_factory=dict)
    missing: frozenset[int] = frozenset()

    def __len__(self) -> int:
        return len(self.movements)


def states_of(library: ActionLibrary, table: str | Path | Mapping[str, Sequence[Any]] | None = None) -> States:
    """Return the states before and after each movement of a symbol.

    Where the hand is, and discrete channels as of a gripper, come from the recordings. The table adds what else is
    known: positions of objects (``cup_x, cup_y, cup_z``, in the frame of the recordings, and in their unit or in one
    that the head says), flags and words.

    It is a file in CSV, or a folder of such files, also in folders of it, as the recordings themselves, or a mapping of
    column to n values, as a data frame; with a row for each moment. Either it has the columns ``movement`` (id, or
    file) and ``moment`` (before or after); or ``time``, in the clock of the recordings, and ``file`` where there are
    several: the state before is the last row up to a movement's start, the one after the first row from its end on,
    each within a twentieth of its duration. Empty cells are not known.

    Raises `DataError`: a file that is no table, or rows that belong to no movement. Raises `SpecificationError`: no
    symbol has movements.
    """
    ids = np.concatenate([symbol.members for symbol in library.symbols()] or [np.empty(0, np.int64)])
    if not len(ids):
        raise SpecificationError("expected a library with symbols that have movements; learn recordings with labels")
    ids = np.sort(ids)
    primitives = library.primitives(ids=ids)
    places, names, units = place_columns(library.channels, primitives.n_dims)
    axes = _axes(names)
    columns = [f"{HAND}_{axis}" for axis in axes]
    said = dict(zip(columns, units, strict=True))
    before, after = primitives.starts[:, places], primitives.goals[:, places]
    discrete = [
        channel.columns[0] for channel in library.channels or ()
        if channel.kind == "discrete" or (len(channel.columns) == 1 and is_gripper(channel.name)
                                          and channel.name not in names)
    ]  # fmt: skip
    if discrete:
        recorded = library.movements(ids=ids)
        heads = [column for channel in library.channels or () for column in channel.columns]
        chosen = [heads.index(column) for column in discrete]
        before, after = (
            np.column_stack((moment, [movement.recorded[row, chosen] for movement in recorded]))
            for moment, row in ((before, 0), (after, -1))
        )
        columns += map(_column, discrete)
        unit_in = {channel.columns[0]: channel.unit for channel in library.channels or ()}
        said |= {_column(column): unit_in[column] for column in discrete}
    unit_of = {column: unit.symbol for column, text in said.items() if (unit := unit_named(text or ""))}
    words: dict[str, tuple[str, ...]] = {}
    missing = np.zeros(len(ids), bool)
    if table is not None:
        cells, source = (_tables(Path(table)), str(table)) if isinstance(table, str | Path) else (table, "the table")
        heads, extra_before, extra_after, words, missing = _matched(library, ids, texts := _texts(cells), source)
        for k, head in enumerate(heads):
            column = _column(head)
            own = (axis for axis in axes if column.endswith(f"_{axis}"))
            like = f"{HAND}_{axis}" if (axis := max(own, key=len, default="")) else column
            if unit := unit_named(unit_of.get(like) or split_head(head)[1] or ""):
                unit_of[like] = unit_of[column] = unit.symbol
            stem = column.removesuffix(f"_{axis}")
            if axis and column in words and {f"{stem}_{each}" for each in axes} <= {*columns, *map(_column, heads)}:
                for value in map(value_of, texts[head]):
                    check_number_in(head, value)
            for values in (extra_before, extra_after) if column not in words else ():
                values[:, k] = in_unit(values[:, k], head, unit_of.get(column))
        more = [*map(_column, heads)]
        columns, before, after = _merged(columns, more, (before, after), (extra_before, extra_after))
    symbols = tuple(name or "" for name in read.names_of(library.store, ids))
    return States(ids, symbols, axes, tuple(columns), before, after, words, unit_of, frozenset(ids[missing].tolist()))


def read_state(source: str | Path | Mapping[str, Any]) -> dict[str, Any]:
    """Return one state: the latest row of a table, without times the last one, or a mapping of column to value.

    Empty cells are not known, whatever earlier rows say. A column whose head says a unit keeps it, ``cup_x [mm]``;
    `problem_of` converts it to that of the domain.
    """
    cells = _texts(_read(Path(source))) if isinstance(source, str | Path) else {k: [str(v)] for k, v in source.items()}
    time, row = next(filter(is_time, cells), None), -1
    if time is not None and len(cells[time]) > 1:
        row = int(np.argsort(_seconds(cells[time], time), kind="stable")[-1])
    state: dict[str, Any] = {}
    for head, texts in cells.items():
        value, unit = value_of(texts[row]), unit_named(split_head(head)[1] or "")
        if value is not None and not is_time(head):
            state[f"{_column(head)} [{unit.symbol}]" if unit else _column(head)] = value
    return state


def in_unit(values: Any, head: str, wanted: str | None) -> Any:
    """Return numbers in a wanted unit, from that which their head says; as they are where either says none."""
    here, there = unit_named(split_head(head)[1] or ""), unit_named(wanted or "")
    if here is None or there is None or here == there:
        return values
    if here.quantity != there.quantity:
        raise DataError(f"expected {head} in [{there.symbol}], as it was recorded, or in another {there.quantity}")
    return converted(values, here, there)


def _tables(path: Path) -> dict[str, list[str]]:
    """Read a table, or those of a folder one below the other: the column ``file`` then says which, if none does."""
    if not path.is_dir():
        return _read(path)
    tables = [(each, _read(each)) for each in sorted(path.rglob("*.csv"))]
    if not tables:
        raise DataError(f"expected tables of states, .csv files, in {path}, got none")
    heads = dict.fromkeys(head for _, cells in tables for head in cells)
    if not any(head.lower() in _MOVEMENTS for head in heads):
        tables = [
            (each, cells | {"file": [str(each.relative_to(path))] * len(next(iter(cells.values())))})
            for each, cells in tables
        ]
        heads["file"] = None
    return {
        head: [text for _, cells in tables for text in cells.get(head, [""] * len(next(iter(cells.values()))))]
        for head in heads
    }


def _read(path: Path) -> dict[str, list[str]]:
    """Read a table of texts, column -> cells."""
    with path.open("rb") as file:
        data = read_limited(file)
    try:
        check_expanded(_CELL * len(data), "a table of states")
        text = data.decode("utf-8-sig")
        first = next((line for line in text.splitlines() if line.strip()), "")
        separator = max("\t;,", key=first.count)
        rows = [
            [text_in(cell.strip()) for cell in row]
            for row in csv.reader(io.StringIO(text, newline=""), delimiter=separator)
            if any(row)
        ]
    except (ValueError, csv.Error) as error:
        raise DataError(f"expected a table of states in CSV, {path}: {error}") from error
    heads = rows[0] if rows else []
    if len(rows) < 2 or len({*heads}) < len(heads) or "" in heads:
        raise DataError(f"expected a table of states with a name above each column and rows below, {path} is none")
    if wrong := next((k for k, row in enumerate(rows, 1) if len(row) != len(heads)), None):
        raise DataError(f"expected {len(heads)} cells in each row of {path}, row {wrong} has {len(rows[wrong - 1])}")
    cells = [cell for row in rows[1:] for cell in row]
    commas = [cell for cell in cells if separator != "," and COMMA_NUMBER.fullmatch(cell)]
    if commas and (point := next((cell for cell in cells if "." in cell and is_number(cell, comma=False)), "")):
        raise DataError(f"expected one decimal mark in {path}, got {commas[0]!r} and {point!r}; write all alike")
    decimal = {cell: cell.replace(",", ".") for cell in commas}
    return {head: [decimal.get(row[k], row[k]) for row in rows[1:]] for k, head in enumerate(heads)}


def _texts(cells: Mapping[str, Sequence[Any]]) -> dict[str, list[str]]:
    if len({0 if isinstance(column, str) else np.size(column) for _, column in cells.items()}) > 1:
        raise DataError("expected columns of states that are equally long, a value in each for every moment")
    return {
        str(head): ["" if value is None else str(value).strip() for value in np.atleast_1d(np.asarray(column, object))]
        for head, column in cells.items()
    }


def value_of(text: str) -> float | str | None:
    """Return a cell as a number or a word; None where it says nothing."""
    if text.lower() in _MISSING:
        return None
    if not is_number(text, comma=False):
        return text
    number = as_float(text)
    return number if math.isfinite(number) else None


def check_number_in(head: str, value: float | str | None) -> float | None:
    """Refuse a word as a coordinate of a position."""
    if isinstance(value, str):
        raise DataError(f"expected numbers{marks_within(value)} in the position {head}, got {value!r}")
    return value


def _axes(names: Sequence[str]) -> tuple[str, ...]:
    """Return the axes of the columns of places, ``x`` of ``tip_x [mm]``, so that a table has ``cup_x``."""
    words = [re.split(r"[_.\s]", _column(name))[-1] for name in names]
    is_one_point = len({*words}) == len(words) and {*words} <= {"x", "y", "z"}
    return tuple(words if is_one_point else map(_column, names))


def _column(head: str) -> str:
    """Return the name of a column: a hand's own columns are those of the recordings, units in brackets are left out."""
    name = split_head(head)[0].strip().replace(" ", "_").replace(".", "_")
    stem, _, axis = name.rpartition("_")
    axis = axis.lower() if axis in ("X", "Y", "Z") else axis
    return f"{HAND}_{axis}" if stem.lower() in _HANDS else f"{stem}_{axis}" if stem else axis


def _matched(
    library: ActionLibrary, ids: NDArray[np.int64], cells: Mapping[str, list[str]], source: str
) -> tuple[list[str], Array, Array, dict[str, tuple[str, ...]], NDArray[np.bool_]]:
    """Return heads, states before and after (n, c) by the rows of each movement, words, and which lack a row (n,)."""
    lower = {head.lower(): head for head in cells}
    who = next((lower[name] for name in _MOVEMENTS if name in lower), None)
    moment = next((lower[name] for name in _MOMENTS if name in lower), None)
    time = next((head for head in cells if is_time(head)), None)
    if time is None and (who is None or moment is None):
        raise DataError(
            f"expected columns movement and moment, or time, that say which state is which, {source} has "
            f"{first_names(list(cells), 12)}"
        )
    heads = [head for head in cells if head not in (who, moment, time)]
    words: dict[str, tuple[str, ...]] = {}
    values = np.full((len(next(iter(cells.values()))), len(heads)), np.nan)
    for k, head in enumerate(heads):
        column = [value_of(text) for text in cells[head]]
        if any(isinstance(value, str) for value in column):
            column = [value if value is None or isinstance(value, str) else f"{value:g}" for value in column]
            words[_column(head)] = tuple(sorted({str(value) for value in column if value is not None}))
            column = [None if value is None else words[_column(head)].index(str(value)) for value in column]
        values[:, k] = [np.nan if value is None else value for value in column]
    rows = _rows_by_moment if time is None else _rows_by_time
    before, after = rows(library, ids, cells, (who, moment, time))
    if (before < 0).all() and (after < 0).all():
        raise DataError(
            f"expected rows of movements in the library, none of {source} fits; it has "
            f"{first_names([record['name'] or str(record['id']) for record in read.records(library.store, ids)], 5)}"
        )
    padded = np.vstack((values, np.full(len(heads), np.nan)))  # row -1: nothing is known
    return heads, padded[before], padded[after], words, (before < 0) | (after < 0)


def _rows_by_moment(
    library: ActionLibrary, ids: NDArray[np.int64], cells: Mapping[str, list[str]], heads: tuple[Any, ...]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    who, moment, _ = heads
    index = {str(key): row for row, key in enumerate(ids.tolist())}
    for row, record in enumerate(read.records(library.store, ids)):
        path = PurePath(record["name"] or "")
        for name in {record["name"] or "", path.name, path.stem} - {""}:
            index[name] = -2 if name in index and index[name] != row else row
    before, after = np.full((2, len(ids)), -1)
    for k, (name, when) in enumerate(zip(cells[who], cells[moment], strict=True)):
        row, word = index.get(name, -1), when.lower()
        if row == -2:
            raise DataError(f"expected a movement by its id, since several are called {name!r}")
        if word not in (*_BEFORE, *_AFTER):
            raise DataError(f"expected before or after as the moment of a state, got {when!r}")
        if row >= 0:
            (before if word in _BEFORE else after)[row] = k
    return before, after


def _rows_by_time(
    library: ActionLibrary, ids: NDArray[np.int64], cells: Mapping[str, list[str]], heads: tuple[Any, ...]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    who, _, time = heads
    clock = _seconds(cells[time], time)
    rows_of: dict[PurePath, list[int]] = {}
    for row, text in enumerate(cells[who] if who else [""] * len(clock)):
        rows_of.setdefault(PurePath(text.removesuffix(PurePath(text).suffix)), []).append(row)
    files: dict[str, list[PurePath]] = {}
    for file in rows_of:
        files.setdefault(file.name, []).append(file)
    before, after = np.full((2, len(ids)), -1)
    for i, record in enumerate(read.records(library.store, ids)):
        own = PurePath(record["name"] or "")
        # Pieces of a recording are called by its name, a mark and a number: monday-003 is of monday, m10 not of m1.
        starts = (own.stem[:n] for n in range(len(own.stem), -1, -1) if not (n and own.stem[n : n + 1].isalnum()))
        name = next((start for start in starts if start in files), None)
        if name is None:
            continue
        several = [file for file in files[name] if file.parent.name == own.parent.name] or files[name]
        if len(several) > 1:
            raise DataError(
                f"expected one recording called {name} in the table of states, got {first_names(several, 3)}"
            )
        rows = np.array(rows_of[several[0]])
        rows = rows[np.argsort(clock[rows], kind="stable")]
        times, start, end = clock[rows], record["t0"], record["t0"] + record["duration"]
        slack = 1e-6 * max(1.0, abs(end)) + _NEAR * record["duration"]
        first = int(np.searchsorted(times, start + slack)) - 1
        last = int(np.searchsorted(times, end - slack))
        if first < 0 and times[0] <= start + _WITHIN * record["duration"]:
            first = 0
        if last == len(times) and times[-1] >= end - _WITHIN * record["duration"]:
            last -= 1
        if first >= 0:
            before[i] = rows[first]
        if last < len(times):
            after[i] = rows[last]
    return before, after


def _seconds(texts: Sequence[str], head: str) -> Array:
    """Return times [s] in the unit that their head ends in, as of recordings, by default seconds."""
    values, unit = list(map(value_of, texts)), unit_in_head(head) or "s"
    if (wrong := next((k for k, value in enumerate(values) if not isinstance(value, float)), None)) is not None:
        raise DataError(f"expected numbers [{unit}] in the column {head}, got {texts[wrong]!r}")
    return in_seconds(np.array(values, dtype=np.float64), unit)


def _merged(
    columns: list[str], more: list[str], moments: tuple[Array, Array], extra: tuple[Array, Array]
) -> tuple[list[str], Array, Array]:
    """Join columns of the recordings and of the table; where both have one, the table counts if it knows it."""
    if repeated := [name for name in more if more.count(name) > 1]:
        raise DataError(f"expected {counted(1, 'column')} called {repeated[0]} in the table of states, got several")
    names = [*columns, *(name for name in more if name not in columns)]
    results = []
    for moment, values in zip(moments, extra, strict=True):
        result = np.full((len(moment), len(names)), np.nan)
        result[:, : len(columns)] = moment
        for k, name in enumerate(more):
            column = result[:, names.index(name)]
            column[:] = np.where(np.isnan(values[:, k]), column, values[:, k])
        results.append(result)
    return names, results[0], results[1]
