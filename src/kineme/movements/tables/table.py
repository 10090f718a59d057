"""A table of samples, or a data frame, and its movements: wide, one; or long, many that columns tell apart."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from decimal import Decimal
from itertools import pairwise
from math import isfinite
from numbers import Real
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.movements.tables.columns import (
    DISCRETE_WORDS,
    Roles,
    choose_roles,
    counts_samples,
    excluded_numbers,
    no_time,
)
from kineme.movements.tables.layout import Block, Detected, Layout, Parsed, distinct, listed, no_lines
from kineme.movements.tables.time_stamps import (
    PER_SECOND,
    in_seconds,
    nanoseconds,
    same_clock,
    same_rate,
    seconds_of_dates,
    unit_by_size,
    unit_in_head,
    words_of,
)
from kineme.validation import MIN_SAMPLES, ROUNDED, Array, too_long_integer

# Of NumPy -> of `choose_roles`.
_KINDS = {"b": "flag", "i": "number", "u": "number", "f": "number", "M": "date", "m": "date"}
_NUMBERS = (Real, Decimal)
#: Cell in lower case -> number.
FLAGS = {"true": 1.0, "false": 0.0, "": np.nan}
_BLOCKS = 3  # values of a column that may tell movements apart, at least
_THINGS = frozenset({"sensor", "hand", "marker", "joint"})  # that rows may be of in turns
_MOST_THINGS = (8, 64)  # in a column that tells them apart by numbers, by texts
_JUMP = 2.0  # times as far from the row before as from the last row of the same thing
_WHOLE = re.compile(r"([-+]?\d+)(\.0)?")  # also as pandas writes it beside cells that are empty


class Segments(NamedTuple):
    """Movements that a file itself tells apart, one after the other: groups, episodes, keys."""

    offsets: NDArray[np.intp]  # shape (n + 1,); rows of the table at which the movements begin and end
    places: list[str]  # which movement of the file
    labels: list[str | None]


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of numbers and of texts."""

    heads: tuple[str, ...]
    # shape (rows,); columns of numbers as float64, NaN for missing ones; other columns as objects.
    columns: Sequence[Any]
    n_rows: int
    line_of: Callable[[int], int | None]  # row -> its line in the file, counted from 1, or None
    faults: dict[int, str] = field(default_factory=dict)  # row -> what is wrong there
    dates_in: str | None = None  # unit of the time stamps where they are dates or durations, whatever the head says
    measured_in: Sequence[str] = ()  # unit of each column where the file says it, else empty; or nothing at all
    segments: Segments | None = None
    maker: str = ""  # whose layout the file has, such as ``"Vicon"``; empty for a plain table


def table_movements(table: Table, roles: Roles, layout: Layout, kind: str) -> Parsed:
    """The movements of a table.

    Movements that the file itself tells apart stay apart. With columns that tell movements apart, all rows with equal
    texts in them, and with equal labels, are one movement, in any order. With a column of labels or of people alone, a
    new movement begins where they change or the time decreases. Otherwise the table is one movement.
    """
    positions = np.column_stack([table.columns[k] for k in roles.positions])
    names = {*roles.movement, roles.label}
    columns = [_names(column) if k in names else column for k, column in enumerate(table.columns)]
    table = replace(table, columns=columns)
    if layout.keys is None:
        roles = _without_counted(table, roles)
    times, units, units_from = _times(table, roles, layout)
    _check_clocks(table, roles, times)
    codes, keys, labels = _split(table, roles, times)
    n = len(keys)
    told_by = [table.heads[k] for k in (*roles.movement, roles.label) if k is not None]
    if told_by and (layout.keys or layout.label) is None and len(codes) >= MIN_SAMPLES > np.bincount(codes).max():
        raise DataError(
            f"expected movements of at least {MIN_SAMPLES} samples, got fewer in each, told apart by {listed(told_by)}"
            "; if it tells none apart, leave it aside with exclude=, in the shell --exclude"
        )
    people: list[str | None] | None = None
    if roles.person is not None:  # who showed the first sample of each movement
        shown = table.columns[roles.person][np.unique(codes, return_index=True)[1]]
        people = [name or None for name in shown.tolist()]
    rows = None if n == 1 or (np.diff(codes) >= 0).all() else np.argsort(codes, kind="stable")
    if rows is not None:
        positions, times, codes = positions[rows], times[rows], codes[rows]
    offsets = np.searchsorted(codes, np.arange(n + 1))
    if roles.time is None:
        times = _samples_so_far(table, roles, offsets, rows) * float(units)
    heads = table.heads
    detected = Detected(
        f"{table.maker} {kind}".strip(),
        "long" if roles.movement or roles.label is not None or table.segments is not None else "wide",
        distinct([heads[k] for k in roles.positions]),
        None if roles.time is None else " + ".join(heads[k] for k in (roles.time, roles.nanoseconds) if k is not None),
        units,
        units_from,
        tuple(heads[k] for k in roles.movement),
        () if roles.label is None else (heads[roles.label],),
        tuple(heads[k] for k in sorted((*roles.ignored, *roles.clocks, *roles.apart))),
        tuple(table.measured_in[k] for k in roles.positions) if any(table.measured_in) else (),
        () if roles.person is None else (heads[roles.person],),
        in_blocks=_in_blocks(table, roles, codes, rows),
        notes=_note_on_turns(table, roles, positions, codes, rows),
    )
    places = [""] * n if n == 1 and _in_turns(roles) and table.segments is None else keys
    block = Block(positions, times, offsets, labels, places, rows, table.line_of, table.faults, people)
    excluded = excluded_numbers(heads, layout.excluded)
    return Parsed(detected, block, without_excluded=bool(excluded) and excluded.isdisjoint(roles.positions))


def _check_clocks(table: Table, roles: Roles, times: Array) -> None:
    """Refuse several columns of times that do not show the same clock, and such of other sensors at another rate."""
    for same, clocks in ((same_clock, roles.clocks), (same_rate, roles.apart)):
        for k in clocks:
            units = [named] if (named := _unit_of_times(table, k)) else PER_SECOND
            if any(same(times, in_seconds(table.columns[k], unit)) for unit in units):
                continue
            if same is same_clock:
                raise no_time(table.heads, [column for column in (roles.time, *roles.clocks) if column is not None])
            head = table.heads[k]
            own = head if table.heads.count(head) == 1 else k
            raise DataError(
                f"expected samples at the times of one clock, got {head!r} in column {k}, which runs at another rate: "
                "beside it are values of other moments; say which are of one clock with columns=, in the shell "
                "--columns, or save each sensor in a file of its own and say join_files=True, in the shell "
                f"--join-files; if all of a row is of one moment, exclude={own!r}, in the shell --exclude"
            )


def _without_counted(table: Table, roles: Roles) -> Roles:
    """Leave a column aside that is named as one of movements, and counts samples: its value is new in each."""
    for k in roles.movement:
        values = table.columns[k]
        alone = words_of(table.heads[k]) == ("id",) or len(roles.movement) == 1
        if k == roles.person or not alone or len(values) < 2 or (values[1:] == values[:-1]).any():
            continue
        told_by = [table.columns[i].tolist() for i in (*roles.movement, roles.label) if i is not None]
        lengths = [len(values)] if table.segments is None else np.diff(table.segments.offsets)
        told_by.append(np.repeat(np.arange(len(lengths)), lengths).tolist())
        if len({*zip(*told_by, strict=True)}) == len(values):
            movement = tuple(i for i in roles.movement if i != k)
            return roles._replace(movement=movement, ignored=(*roles.ignored, k))
    return roles


def _in_blocks(table: Table, roles: Roles, codes: NDArray[np.intp], rows: NDArray[np.intp] | None) -> tuple[str, ...]:
    """Heads of columns that may tell movements apart: within one they stay for some samples, then take a new value.

    Three values or more, whole numbers that count on or texts that do not come back, each for as many samples as a
    movement has at least; `codes` are the movements of the rows in the order of `rows`.
    """
    heads, new_movement = [], np.diff(codes) > 0
    for k in (*roles.positions, *roles.ignored):
        values = table.columns[k]
        if values is None or DISCRETE_WORDS & {*words_of(table.heads[k])}:
            continue
        values = values if rows is None else values[rows]
        changed = values[1:] != values[:-1]
        inside, ends = np.flatnonzero(changed & ~new_movement), np.flatnonzero(changed | new_movement)
        if len(inside) < _BLOCKS - 1 or np.diff([-1, *ends, len(values) - 1]).min() < MIN_SAMPLES:
            continue
        starts = [0, *(ends + 1)]
        if values.dtype.kind == "O":
            counts = len({*zip(codes[starts].tolist(), values[starts].tolist(), strict=True)}) == len(starts)
        else:
            counts = bool(np.all(values == np.rint(values)) and np.all(values[inside + 1] - values[inside] == 1))
        if counts:
            heads.append(table.heads[k])
    return tuple(heads)


def _samples_so_far(
    table: Table, roles: Roles, offsets: NDArray[np.intp], rows: NDArray[np.intp] | None
) -> NDArray[np.float64]:
    """Count the samples before each one of its movement, with those that a counter of samples skips."""
    for k in roles.ignored:
        if counts_samples(table.heads[k], table.heads) and (values := table.columns[k]) is not None:
            counted = skipping(values if rows is None else values[rows], offsets)
            if counted is not None:
                return counted
    return np.arange(float(offsets[-1])) - np.repeat(offsets[:-1], np.diff(offsets))


def skipping(counter: Any, offsets: NDArray[np.intp]) -> NDArray[np.float64] | None:
    """Count the samples since each movement began, by a counter that goes on by 1 but for some that it skips; or None.

    One that goes on by 2 says nothing of the time between two samples, and one that goes back is none.
    """
    try:
        numbers = np.asarray(counter, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    inner = np.ones(max(len(numbers) - 1, 0), dtype=bool)
    inner[offsets[1:-1] - 1] = False
    steps = np.diff(numbers)[inner]
    if not len(steps) or not (steps >= 1).all() or np.median(steps) != 1 or steps.max() == 1:
        return None
    if not np.all(steps == np.rint(steps)):
        return None
    return numbers - np.repeat(numbers[offsets[:-1]], np.diff(offsets))


def _note_on_turns(
    table: Table, roles: Roles, positions: Array, codes: NDArray[np.intp], rows: NDArray[np.intp] | None
) -> tuple[str, ...]:
    """Say which column tells rows of several things apart, in turns, that are read as one movement."""
    for k in (*roles.ignored, *roles.positions):
        values = table.columns[k]
        if values is None or DISCRETE_WORDS & {*words_of(table.heads[k])}:
            continue
        others = positions[:, [i for i, place in enumerate(roles.positions) if place != k]]
        if _are_in_turns(table.heads[k], values if rows is None else values[rows], others, codes):
            return (
                f"rows of several things may be mixed in one movement, which {table.heads[k]} names in turns; if so, "
                "say movement=, in the shell --movement",
            )
    return ()


def _are_in_turns(head: str, values: NDArray[Any], x: Array, codes: NDArray[np.intp]) -> bool:
    """Tell whether values name things of which rows are in turns: each goes on where it was, not where others are.

    `x` are the other coordinates (T, d), `codes` the movements. Texts or whole numbers, few, that come back.
    """
    changed = np.flatnonzero((values[1:] != values[:-1]) & (codes[1:] == codes[:-1])) + 1
    are_texts = values.dtype.kind == "O"
    if len(changed) < MIN_SAMPLES or not (are_texts or np.all(values == np.rint(values))):
        return False
    several = {*values.tolist()}
    if len(several) > _MOST_THINGS[are_texts]:
        return False
    if _THINGS & {*words_of(head)} and 2 * len(changed) >= len(values):
        return True
    number_of = {value: number for number, value in enumerate(several)}
    things = np.array([number_of[value] for value in values.tolist()]) + len(several) * codes
    order = np.argsort(things, kind="stable")
    before = np.full(len(values), -1)
    before[order[1:]] = np.where(np.diff(things[order]) == 0, order[:-1], -1)
    back = changed[before[changed] >= 0]
    if len(back) < MIN_SAMPLES or not x.shape[1]:
        return False
    extent = np.fmax.reduce(x) - np.fmin.reduce(x)
    far, near = (
        float(np.median(np.nansum(np.abs(x[back] - x[rows]) / np.where(extent > 0, extent, 1.0), axis=1)))
        for rows in (back - 1, before[back])
    )
    return far > _JUMP * near


def _times(table: Table, roles: Roles, layout: Layout) -> tuple[Any, str | float, str]:
    """Times [s], their unit in the file, and the source of the unit."""
    if roles.time is None:
        return np.zeros(table.n_rows), layout.units or 1.0, "given"
    stamps, head = table.columns[roles.time], table.heads[roles.time]
    if roles.nanoseconds is not None:
        return stamps + table.columns[roles.nanoseconds] / PER_SECOND["ns"], "s", "head"
    if table.dates_in is not None:
        return in_seconds(stamps, table.dates_in), table.dates_in, "dates"
    if layout.units is not None:
        return in_seconds(stamps, layout.units), layout.units, "given"
    named = _unit_of_times(table, roles.time)
    units, said_by = (named, "head") if named else _unit_by_clocks(table, roles) or unit_by_size(stamps, head)
    return in_seconds(stamps, units), units, said_by


def _unit_of_times(table: Table, k: int) -> str | None:
    """The unit of a column of times as its head, or a row of units, says it."""
    return unit_in_head(table.heads[k]) or (unit_in_head(table.measured_in[k]) if table.measured_in else None)


def _unit_by_clocks(table: Table, roles: Roles) -> tuple[str, str] | None:
    """The unit in which stamps run as another column does that says its unit, and the head of that."""
    assert roles.time is not None
    for k in roles.clocks:
        named = _unit_of_times(table, k)
        for units in (*PER_SECOND, "100ns") if named else ():
            if same_clock(in_seconds(table.columns[roles.time], units), in_seconds(table.columns[k], named or "s")):
                return units, f"as {table.heads[k]!r}"
    return None


def _in_turns(roles: Roles) -> bool:
    """Tell whether no column tells movements apart but labels and people, which change from time to time."""
    return not roles.movement or roles.movement == (roles.person,)


def _split(table: Table, roles: Roles, times: Array) -> tuple[NDArray[np.intp], list[str], list[str | None]]:
    """Per row the number of its movement; per movement its place and its label."""
    n_rows, label = table.n_rows, roles.label
    if table.segments is not None:
        return _split_segments(table, table.segments, roles)
    if label is None and not roles.movement:
        return np.zeros(n_rows, np.intp), [""], [None]
    labels = [None] * n_rows if label is None else table.columns[label].tolist()
    columns: Sequence[list[str]] = [table.columns[k].tolist() for k in roles.movement]
    if _in_turns(roles):
        rows = list(zip(labels, *columns, strict=True))
        changes = np.array([before != row for before, row in pairwise(rows)], dtype=bool)
        codes = np.append(0, np.cumsum(changes | (times[1:] < times[:-1])))
        firsts = np.flatnonzero(np.diff(codes, prepend=-1))
        return codes, [str(k) for k in range(len(firsts))], [labels[k] or None for k in firsts]
    number_of: dict[Any, int] = {}
    keys = zip(labels, *columns, strict=True) if label is not None else zip(*columns, strict=True)
    codes = np.fromiter((number_of.setdefault(key, len(number_of)) for key in keys), np.intp, n_rows)
    names: list[str | None] = [key[0] or None if label is not None else None for key in number_of]
    return codes, _places(list(number_of), label is not None), names


def _split_segments(
    table: Table, segments: Segments, roles: Roles
) -> tuple[NDArray[np.intp], list[str], list[str | None]]:
    """The movements of the file, each divided where columns tell movements or labels apart."""
    codes = np.repeat(np.arange(len(segments.places)), np.diff(segments.offsets))
    chosen = [*roles.movement, *(() if roles.label is None else (roles.label,))]
    if not chosen:
        return codes, segments.places, segments.labels
    number_of: dict[Any, int] = {}
    keys = zip(codes.tolist(), *(table.columns[k].tolist() for k in chosen), strict=True)
    codes = np.fromiter((number_of.setdefault(key, len(number_of)) for key in keys), np.intp, table.n_rows)
    labels = [segments.labels[key[0]] if roles.label is None else key[-1] or None for key in number_of]
    divided = len(number_of) > len({key[0] for key in number_of})
    named = [(segments.places[key[0]], *(key[1:] if divided else ())) for key in number_of]
    return codes, _places(named, False), labels


def _places(keys: list[tuple[Any, ...]], labeled: bool) -> list[str]:
    """A unique text for each movement from what tells them apart; with the label if all labels count from 1."""
    for some in ([key[labeled:] for key in keys], keys):
        places = ["/".join(map(str, key)) for key in some]
        if len(set(places)) == len(places):
            return places
    return ["/".join(str(part).replace("\\", "\\\\").replace("/", "\\/") for part in key) for key in keys]


def parse_data_frame(frame: Any, layout: Layout) -> Parsed:
    """The movements of a data frame; named or dated levels of a pandas index are columns, but no coordinates."""
    read = [(head, _values(series), inside) for head, series, inside in _columns(frame)]
    heads = tuple(head for head, _, _ in read)
    arrays = [values for _, values, _ in read]
    kinds = [_kind(values) if inside else "text" for _, values, inside in read]
    if not heads or not len(arrays[0]):
        raise DataError("expected samples, got a data frame without rows")
    roles = choose_roles(heads, kinds, layout, values=arrays.__getitem__)
    # Columns as `table_movements` takes them, and the unit of times that are dates.
    columns: list[Any] = list(arrays)
    for k in (*roles.movement, *(() if roles.label is None else (roles.label,))):
        columns[k] = _texts(arrays[k].tolist())
    for k in (
        *roles.positions,
        *roles.clocks,
        *roles.apart,
        *(() if roles.nanoseconds is None else (roles.nanoseconds,)),
    ):
        columns[k] = _numbers(heads[k], arrays[k])
        if k in roles.positions and (integer := too_long_integer(arrays[k])) is not None:
            raise DataError(f"expected numbers in the column {heads[k]!r} that floats can hold, got {integer}{ROUNDED}")
    dates_in, k = None, roles.time
    if k is not None and arrays[k].dtype.kind in "Mm":
        columns[k], dates_in = nanoseconds(arrays[k]), "ns"
    elif k is not None and arrays[k].dtype.kind == "O":
        columns[k], others = seconds_of_dates(_texts(arrays[k].tolist()).tolist())
        if others:
            raise DataError(
                f"expected numbers or dates in the column of times {heads[k]!r}, got the text "
                f"{next(iter(others.values()))!r}; if it is a number, write frame.astype({{{heads[k]!r}: float}})"
            )
        dates_in = "s"
    elif k is not None:
        columns[k] = _numbers(heads[k], arrays[k])
    parsed = table_movements(Table(heads, columns, len(arrays[0]), no_lines, dates_in=dates_in), roles, layout, "frame")
    if roles.label is not None and (kind := arrays[roles.label].dtype.kind) in "iuf":  # numbers stay numbers
        number = float if kind == "f" else int
        numbers = [None if label is None else number(label) for label in parsed.block.labels]
        parsed.block.labels[:] = numbers  # type: ignore[assignment]
    return parsed


def _columns(frame: Any) -> Iterator[tuple[str, Any, bool]]:
    """Head and values of each column, and whether it is one of the frame rather than of its index."""
    at = getattr(frame, "iloc", None)
    for k, name in enumerate(frame.columns):
        head = "_".join(map(str, name)) if isinstance(name, tuple) else str(name)
        yield head, frame[name] if at is None else at[:, k], True
    for level, name in enumerate(getattr(getattr(frame, "index", None), "names", ())):
        values = frame.index.get_level_values(level)
        if name is not None or getattr(values.dtype, "kind", "") in "Mm":
            yield "time" if name is None else str(name), values, False


def _values(series: Any) -> NDArray[Any]:
    """Numbers, dates, or texts as objects, numbers among them as they are; missing numbers are NaN, texts empty."""
    values: NDArray[Any] = np.asarray(series.to_numpy())
    if values.dtype.kind != "O":
        return values if values.dtype.kind in _KINDS or values.dtype.kind == "c" else _texts(values.tolist())
    present = [value for value in values.tolist() if not _is_missing(value)]
    if present and all(isinstance(value, datetime) for value in present):
        return np.asarray(series.to_numpy(dtype="datetime64[ns]"))
    if present and all(isinstance(value, timedelta) for value in present):
        return np.asarray(series.to_numpy(dtype="timedelta64[ns]"))
    if present and all(map(_is_number, present)):
        return np.array([np.nan if _is_missing(value) else float(value) for value in values.tolist()])
    texts = _texts(values.tolist())
    texts[:] = [value if _is_number(value) else text for value, text in zip(values.tolist(), texts, strict=True)]
    return texts


def _kind(values: NDArray[Any]) -> str:
    """Find the kind of a column; one with a number among texts has numbers, and is refused where it is a coordinate."""
    mixed = values.dtype.kind == "O" and (any(map(_is_number, values.tolist())) or _are_decimals(values.tolist()))
    are_flags = values.dtype.kind == "O" and flags_in(values.tolist()) is not None
    if are_flags:
        return "flag"
    return "number" if mixed or values.dtype.kind == "c" else _KINDS.get(values.dtype.kind, "text")


def _are_decimals(texts: list[str]) -> bool:
    """Tell whether texts are measured numbers, such as "0.25", and not codes, such as "07"."""
    filled = [text for text in texts if text]
    try:
        return any("." in text for text in filled) and all(map(isfinite, map(float, filled)))
    except ValueError:
        return False


def _is_number(value: Any) -> bool:
    return isinstance(value, _NUMBERS) and not isinstance(value, bool) and not _is_missing(value)


def _texts(values: list[Any]) -> NDArray[Any]:
    texts = np.empty(len(values), dtype=object)
    texts[:] = ["" if _is_missing(value) else str(value) for value in values]
    return texts


def as_name(value: Any) -> str:
    """The text that names a movement, a label or a person; of a whole number without a fraction, empty for none."""
    if _is_missing(value):
        return ""
    is_fraction = isinstance(value, (float, np.floating, Decimal)) and isfinite(value)
    return str(int(value)) if is_fraction and value == int(value) else str(value)


def _names(values: NDArray[Any]) -> NDArray[Any]:
    """The names in a column; texts lose the fraction of whole numbers if all are such: "1.0" and "2.0", not "1.5"."""
    several = values.tolist()
    texts = {value: as_name(value) for value in {*several}}
    if all(map(_WHOLE.fullmatch, filter(None, texts.values()))):
        texts = {value: text.partition(".")[0] for value, text in texts.items()}
    names = np.empty(len(several), dtype=object)
    names[:] = [texts[value] for value in several]
    return names


def _is_missing(value: Any) -> bool:
    is_nan = isinstance(value, float) and value != value  # noqa: PLR0124
    return value is None or type(value).__name__ in ("NAType", "NaTType") or is_nan


def flags_in(cells: Sequence[Any]) -> NDArray[np.float64] | None:
    """Numbers for true and false in any case, NaN for empty cells; None if there are other cells, or none of these."""
    values = {cell: FLAGS.get(str(cell).lower()) for cell in {*cells}}
    if None in values.values() or not any(map(str, values)):
        return None
    return np.array([values[cell] for cell in cells], dtype=np.float64)


def _numbers(head: str, values: NDArray[Any]) -> NDArray[np.float64]:
    if values.dtype.kind == "O" and (flags := flags_in(values.tolist())) is not None:
        return flags
    if _KINDS.get(values.dtype.kind) not in ("number", "flag"):
        i, got = next(((i, value) for i, value in enumerate(values.tolist()) if not _is_number(value)), (0, values[0]))
        raise DataError(
            f"expected numbers in the column {head!r}, got {got!r} in row {i}; repair it, as by "
            f"frame.astype({{{head!r}: float}}), or say columns="
        )
    return values.astype(np.float64)
