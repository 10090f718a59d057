"""Parquet tables; the roles of the columns are found as in text tables, and cells may hold lists of numbers."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import accumulate
from operator import le
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from pyarrow import compute, parquet

from kineme.errors import DataError
from kineme.io.limits import check_expanded
from kineme.io.records import damaged_as
from kineme.movements.episodes import STATE
from kineme.movements.tables.columns import LABEL_WORDS, Roles, choose_roles, counts_samples, excluded_numbers, is_time
from kineme.movements.tables.layout import Layout, no_lines
from kineme.movements.tables.table import Segments, Table, as_name
from kineme.movements.tables.time_stamps import nanoseconds, words_of
from kineme.validation import ROUNDED, Array, too_long_integer

_SHOWN = 1000  # faults that are told apart; more rows than that are left to their missing numbers

_DAMAGED = "expected a Parquet file, got something foreign, truncated or damaged"
_ROWS = 2**18  # rows that are decompressed at a time
_WIDEST = 1000  # numbers in a list; images have more
_INDEX = "__index_level_0__"
_COMMANDS = frozenset({"action"})  # of LeRobot's episodes

_LARGE, _EXPANDED = 2**26, 1000  # bytes from which on packing is looked at; times as many as repeated rows alone give


class RowGroups(NamedTuple):
    """The groups of rows of a file in which movements stand one after the other, as its metadata say.

    A movement that begins in one group and goes on in others is of the group in which it begins. All rows of a group
    whose numbers or names of movements are at most `highs` of the group before belong to groups before.
    """

    column: str  # it tells movements apart, and never decreases from group to group
    lows: list[Any]  # the least value in each group
    highs: list[Any]  # the greatest value in each group and all before it
    sizes: list[int]  # bytes of each


def row_groups(data: Any, layout: Layout) -> RowGroups | None:
    """Return the groups of rows of a file between which it can be divided; None if it is one part.

    It is one part unless a column of whole numbers or texts tells movements apart, of which the metadata say that it
    has a value in each row and never decreases from a group to the next one.
    """
    with damaged_as(_DAMAGED, pa.ArrowException, OSError), _open(data) as file:
        names = file.schema_arrow.names
        _, _, owners, roles = _columns(file, layout)
        groups = [file.metadata.row_group(g) for g in range(file.num_row_groups)]
        if roles.movement == (roles.person,) or not groups:  # a movement begins where the person changes
            return None
        for k in [owners[k] for k in roles.movement]:
            at = {groups[0].column(i).path_in_schema: i for i in range(groups[0].num_columns)}.get(names[k])
            bounds = [None if at is None else group.column(at).statistics for group in groups]
            if any(each is None or not each.has_min_max or each.null_count != 0 for each in bounds):
                continue
            lows, highs = ([getattr(each, name) for each in bounds] for name in ("min", "max"))
            greatest = list(accumulate(highs, max))
            if {*map(type, lows + highs)} in ({int}, {str}) and all(map(le, greatest, lows[1:])):
                sizes = [sum(each.column(i).total_compressed_size for i in range(each.num_columns)) for each in groups]
                return RowGroups(names[k], lows, greatest, sizes)
    return None


def _batches(file: Any, columns: Sequence[str], groups: RowGroups | None, part: range | None) -> Iterator[Any]:
    """Yield the rows of a file, or of the movements that begin in some groups, which follow each other."""
    if groups is None or part is None:
        yield from file.iter_batches(_ROWS, columns=columns)
        return
    last = groups.highs[part.stop - 1]
    more = [group for group in range(part.stop, len(groups.lows)) if groups.lows[group] <= last]
    for batch in file.iter_batches(_ROWS, row_groups=[*part, *more], columns=columns):
        values = batch.column(groups.column)
        values = values.cast(values.type.value_type) if pa.types.is_dictionary(values.type) else values
        own = compute.less_equal(values, last)
        if part.start:
            own = compute.and_(own, compute.greater(values, groups.highs[part.start - 1]))
        yield batch.filter(own)


def _extent(file: Any, data: bytes | Path, groups: RowGroups | None, part: range | None) -> tuple[int, int]:
    """Return how many rows are read, and in how many bytes they are."""
    if groups is not None and part is not None:
        return sum(file.metadata.row_group(g).num_rows for g in part), sum(groups.sizes[g] for g in part)
    if isinstance(data, Path):
        raise DataError("expected a column by which movements stand one after the other, got none; take larger pieces")
    return max(file.metadata.num_rows, 0), len(data)


def _open(data: Any, **options: Any) -> Any:
    return parquet.ParquetFile(io.BytesIO(data) if isinstance(data, bytes) else data, **options)


def _columns(file: Any, layout: Layout) -> tuple[tuple[str, ...], tuple[str, ...], list[int], Roles]:
    """Return heads and kinds of the columns of an open file, of each the column of the file, and their roles."""
    names, types = tuple(file.schema_arrow.names), file.schema_arrow.types
    heads, kinds, owners = _expanded(names, types, _lists_to_read(file, layout), file)
    if not any(map(is_time, heads)):  # as pandas writes an index of dates that has no name
        heads = tuple(
            "time" if head == _INDEX and kind == "date" else head for head, kind in zip(heads, kinds, strict=True)
        )
    shown = _without_commands(heads, kinds, [types[k] for k in owners], layout)

    def values(k: int) -> Any:  # in the first rows
        is_nested = pa.types.is_nested(types[owners[k]])
        batch = None if is_nested else next(file.iter_batches(_ROWS, columns=[names[owners[k]]]), None)
        return None if batch is None else batch.column(0).to_numpy(zero_copy_only=False)

    return heads, kinds, owners, choose_roles(shown, kinds, layout, values=values)


def read_parquet_table(data: bytes | Path, layout: Layout, part: range | None = None) -> tuple[Table, Roles]:
    """Read the columns that have a role. Dates and durations are nanoseconds; missing values are NaN.

    A column of lists counts as one column for each number in them, ``state.0``, ``state.1``. Without a choice such
    columns are coordinates only where no plain ones are, and ``observation.state`` always is. Where the times are such
    a column, each row is a movement. A struct counts as one column for each field, ``pose.x``. Of a path, the movements
    that begin in some groups of rows can be read alone, see `RowGroups`.
    """
    with damaged_as(_DAMAGED, pa.ArrowException, OSError):
        file = _open(data)
        names, types = tuple(file.schema_arrow.names), file.schema_arrow.types
        of_lists = [name for name, kind in zip(names, types, strict=True) if is_list(kind)]
        if part is None and (times := [name for name in of_lists if name == layout.time or is_time(name)]):
            return _read_rows_of_movements(file, times[0], of_lists, layout)
        heads, kinds, owners, roles = _columns(file, layout)
        counters = {
            k for k in roles.ignored if roles.time is None and counts_samples(heads[k]) and kinds[k] == "number"
        }
        needed = sorted({owners[k] for k in range(len(heads)) if k in counters or k not in roles.ignored})
        groups = None if part is None else row_groups(data, layout)
        n_rows, size = _extent(file, data, groups, part)
        check_expanded(n_bytes := 8 * n_rows * (len(heads) - len(roles.ignored)))
        if n_bytes > _LARGE and n_bytes > _EXPANDED * size:
            raise DataError(
                f"expected samples that move, got {n_rows:,} rows in {size:,} bytes, which cannot "
                "differ; write the rows that were recorded"
            )
        counts = Counter(names)
        if twins := [names[k] for k in needed if counts[names[k]] > 1]:
            raise DataError(f"expected columns of different names, got {twins[0]!r} {counts[twins[0]]} times")
        texts = {owners[k] for k in (*roles.movement, roles.label) if k is not None}
        if nested := [k for k in needed if k in texts and pa.types.is_nested(types[k])]:
            raise DataError(f"expected names in {names[nested[0]]!r}, got {types[nested[0]]}")
        named = [names[k] for k in needed if k in texts]  # kept as dictionaries: few different texts in many rows
        file = _open(data, read_dictionary=named)
        # Some rows at a time, refused once they take more memory than the limit. The metadata about the pages of
        # columns are not used: pyarrow ends the process if they are damaged.
        table = _within_memory(_batches(file, [names[k] for k in needed], groups, part))
        faults, read = dict[int, str](), dict[int, Any]()
        for k in needed:
            column = table.column(names[k])
            if _is_struct(column):
                leaves = zip(_leaves(types[k], names[k]), _parts(column), strict=True)
                read[k] = np.column_stack(
                    [
                        np.full(len(values), np.nan) if _kind(kind) == "text" else _numbers(values, head)
                        for (head, kind), values in leaves
                    ]
                )
            elif k in texts or not is_list(column.type):
                read[k] = _texts(column, names[k]) if k in texts else _numbers(column, names[k])
            else:
                read[k], wrong = rows_of_lists(column, owners.count(k), names[k])
                faults |= wrong
    for k in {owners[k] for k in roles.positions if not pa.types.is_nested(types[owners[k]])}:
        if (integer := too_long_integer(table.column(names[k]).to_numpy())) is not None:
            raise DataError(f"expected numbers in {names[k]!r} that floats can hold, got {integer}{ROUNDED}")
    parts = {owner: iter(read[owner].T if read[owner].ndim > 1 else (read[owner],)) for owner in read}
    columns = [next(parts[owner]) if owner in parts else None for owner in owners]
    dated = roles.time is not None and kinds[roles.time] == "date"
    return Table(heads, columns, table.num_rows, no_lines, faults, "ns" if dated else None), roles


def _within_memory(batches: Iterable[Any]) -> Any:
    taken, n_bytes = [], 0
    for batch in batches:
        n_bytes += batch.nbytes
        check_expanded(n_bytes)
        taken.append(batch)
    if not any(batch.num_rows for batch in taken):
        raise DataError("expected samples, got a table without rows")
    return pa.Table.from_batches(taken)


def _read_rows_of_movements(file: Any, time: str, of_lists: Sequence[str], layout: Layout) -> tuple[Table, Roles]:
    """Read a table of which each row is a movement, its samples in lists of one length."""
    table = _within_memory(_batches(file, file.schema_arrow.names, None, None)).combine_chunks()
    table.validate(full=True)  # pyarrow itself trusts the offsets of damaged files
    excluded = {table.column_names[k] for k in excluded_numbers(table.column_names, layout.excluded)}
    counted = [name for name in of_lists if name not in excluded]
    lengths = {name: compute.list_value_length(table.column(name)).fill_null(0).to_numpy() for name in counted}
    if other := [name for name in lengths if (lengths[name] != lengths[time]).any()]:
        raise DataError(
            f"expected as many values in {other[0]!r} as in {time!r}, row by row, got {lengths[other[0]][0]} and "
            f"{lengths[time][0]} in the first; leave it aside with exclude=, in the shell --exclude"
        )
    rows = np.repeat(np.arange(table.num_rows), lengths[time])
    columns: dict[str, Any] = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        if name in lengths:
            columns[name] = compute.list_flatten(column)
        elif name in excluded or pa.types.is_nested(column.type):
            columns[name] = pa.nulls(len(rows))
        else:  # a long text is kept once
            of_text = pa.types.is_string(column.type) or pa.types.is_large_string(column.type)
            columns[name] = (column.dictionary_encode() if of_text else column).take(rows)
    sink = io.BytesIO()
    parquet.write_table(pa.table(columns), sink)
    read, roles = read_parquet_table(sink.getvalue(), layout)
    filled = np.flatnonzero(lengths[time])
    offsets = np.append(0, np.cumsum(lengths[time][filled])).astype(np.intp)
    return replace(read, segments=Segments(offsets, [*map(str, filled.tolist())], [None] * len(filled))), roles


def _leaves(kind: Any, name: str) -> list[tuple[str, Any]]:
    """Names and types of the fields of a struct, and of structs in it, as ``pose.position.x``."""
    if not pa.types.is_struct(kind):
        return [(name, kind)]
    fields = [kind.field(i) for i in range(kind.num_fields)]
    return [leaf for field in fields for leaf in _leaves(field.type, f"{name}.{field.name}")]


def _parts(column: Any) -> list[Any]:
    """The columns of these fields."""
    return [part for field in column.flatten() for part in _parts(field)] if _is_struct(column) else [column]


def _is_struct(column: Any) -> bool:
    return bool(pa.types.is_struct(column.type))


def _lists_to_read(file: Any, layout: Layout) -> set[str]:
    """Return the columns of lists that count: all if the caller chooses, else one, and only where it is meant."""
    names, types = file.schema_arrow.names, file.schema_arrow.types
    lists = {name for name, kind in zip(names, types, strict=True) if is_list(kind) and names.count(name) == 1}
    if layout.coordinates is not None or not lists:
        return lists
    if STATE in lists:
        return {STATE}
    try:
        kinds = [_kind(kind) for kind in types]
        choose_roles(_without_commands(names, kinds, types, layout), kinds, layout)
    except DataError:
        if len(lists) > 1:
            got = ", ".join(sorted(lists))
            raise DataError(
                f"expected one column of lists, or plain columns, got {got}; say which with columns=, "
                "in the shell --columns"
            ) from None
        return lists
    return set()


def _without_commands(heads: Sequence[str], kinds: Sequence[str], types: Sequence[Any], layout: Layout) -> list[str]:
    """Return heads without that of a vector of commands, ``action``, which is no label, unless it is chosen."""
    chosen = {layout.label, *(layout.keys or ()), *(layout.coordinates or ())}
    columns = zip(heads, kinds, types, strict=True)
    lost = _COMMANDS - chosen
    return ["" if head in lost and kind == "text" and is_list(t) else head for head, kind, t in columns]


def _expanded(
    names: Sequence[str], types: Sequence[Any], lists: set[str], file: Any
) -> tuple[tuple[str, ...], tuple[str, ...], list[int]]:
    """Give heads and kinds of the columns, those of lists once for each number, and the column of the file of each."""
    heads, kinds, owners = [], [], []
    for k, (name, kind) in enumerate(zip(names, types, strict=True)):
        width = width_of(kind, file, name) if name in lists else 0
        if pa.types.is_struct(kind) and not {*words_of(name)} & LABEL_WORDS - _COMMANDS:
            leaves = _leaves(kind, name)
            heads += [head for head, _ in leaves]
            kinds += [_kind(of) for _, of in leaves]
            width = len(leaves)
        elif 0 < width <= _WIDEST:
            heads += [f"{name}.{i}" for i in range(width)]
            kinds += ["number"] * width
        else:
            heads.append(name)
            kinds.append(_kind(kind))
        owners += [k] * max(1, width if width <= _WIDEST else 1)
    return tuple(heads), tuple(kinds), owners


def _kind(kind: Any) -> str:
    of = pa.types
    if of.is_timestamp(kind) or of.is_date(kind) or of.is_duration(kind) or of.is_time(kind):
        return "date"
    if of.is_boolean(kind):
        return "flag"
    return "number" if of.is_integer(kind) or of.is_floating(kind) or of.is_decimal(kind) else "text"


def _texts(column: Any, head: str) -> Any:
    if not pa.types.is_dictionary(column.type):
        column = column.dictionary_encode()
    parts = [np.empty(0, dtype=object)]
    for chunk in column.chunks:
        texts = np.array([*(_text(value, head) for value in chunk.dictionary.to_pylist()), ""], dtype=object)
        which = chunk.indices.cast(pa.int64()).fill_null(len(texts) - 1).to_numpy()
        if len(which) and not 0 <= which.min() <= which.max() < len(texts):  # pyarrow does not check the indices
            raise DataError(f"expected names in {head!r}, got numbers of names that are not there: damaged bytes")
        parts.append(texts[which])
    return np.concatenate(parts)


def _text(value: Any, head: str) -> str:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if value != value:  # noqa: PLR0124 - only NaN differs from itself
        raise DataError(f"expected names in {head!r}, got {value!r}")
    return as_name(value)


def _numbers(column: Any, head: str) -> Any:
    if pa.types.is_time(column.type):
        column = column.cast(pa.time64("ns")).cast(pa.int64())
    values = (column.cast(pa.uint8()) if pa.types.is_boolean(column.type) else column).to_numpy()
    if values.dtype.kind in "Mm":
        return nanoseconds(values)
    try:
        return values.astype(np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise DataError(f"expected numbers in the column {head!r}, got {column.type}") from error


def is_list(kind: Any) -> bool:
    """Tell whether a type of Arrow is a list of numbers, or of lists of them."""
    of = pa.types
    if not (of.is_list(kind) or of.is_large_list(kind) or of.is_fixed_size_list(kind)):
        return False
    inner = kind.value_type
    return is_list(inner) or of.is_integer(inner) or of.is_floating(inner) or of.is_boolean(inner)


def width_of(kind: Any, file: Any, name: str) -> int:
    """Count the numbers in each row of a list column: by its type, else by its first row."""
    width, inner = 1, kind
    while pa.types.is_fixed_size_list(inner):
        width, inner = width * inner.list_size, inner.value_type
    if not is_list(inner):
        return width
    for batch in file.iter_batches(64, columns=[name]):
        for row in batch.column(0):
            if (cells := row.as_py()) is not None:
                return int(np.size(np.array(cells, dtype=np.float64)))
    return 0


def rows_of_lists(column: Any, width: int, head: str) -> tuple[Array, dict[int, str]]:
    """Return a list column as numbers (T, width), NaN where a row has none, and row -> what is wrong there."""
    parts, n_rows = [np.empty((0, width))], 0
    faults: dict[int, str] = {}
    for chunk in getattr(column, "chunks", [column]):
        part, wrong = _rows(chunk, width, head)
        faults |= {n_rows + row: reason for row, reason in wrong.items()}
        parts.append(part)
        n_rows += len(part)
    return np.concatenate(parts), faults


def _rows(array: Any, width: int, head: str) -> tuple[Array, dict[int, str]]:
    with damaged_as(f"expected lists of numbers in {head!r}, got damaged bytes", pa.ArrowException):
        array.validate(full=True)  # pyarrow itself trusts the offsets of damaged files
    lengths = compute.list_value_length(array).fill_null(0).to_numpy(zero_copy_only=False)
    valid = array.is_valid().to_numpy(zero_copy_only=False)
    flat = array
    while is_list(flat.type):
        flat = compute.list_flatten(flat)
    with np.errstate(invalid="ignore"):  # NaN that signal, as damaged bytes may be, stay NaN
        values = flat.to_numpy(zero_copy_only=False).astype(np.float64)
    inner = len(values) // max(int(lengths[valid].sum()), 1)  # numbers in each entry of the outer list
    good = valid & (lengths * inner == width)
    numbers = values if good.all() else values[np.repeat(good, np.where(valid, lengths, 0) * inner)[: len(values)]]
    rows = np.full((len(array), width), np.nan)
    if numbers.size != int(good.sum()) * width:
        raise DataError(f"expected lists of {width} numbers in {head!r}, got lists within lists that differ in length")
    rows[good] = numbers.reshape(-1, width)
    return rows, {
        row: f"expected {width} numbers in {head!r}, got {int(lengths[row]) * inner if valid[row] else 'nothing'}"
        for row in np.flatnonzero(~good)[:_SHOWN].tolist()
    }
