"""Text of which each line is a movement: tables with a label first, and the ``.ts`` files of time-series archives."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import DataError
from kineme.io.arrays.arrays import ROWS, Named, parsed_arrays
from kineme.io.limits import check_expanded
from kineme.io.tables.dialect import as_float, is_number, is_skipped, separator_of, split
from kineme.io.tables.text_table import lines_of
from kineme.movements.tables.columns import LABEL_WORDS, column_numbers
from kineme.movements.tables.layout import Layout, Parsed, listed
from kineme.movements.tables.time_stamps import is_date, seconds_of_dates, words_of
from kineme.movements.trajectories.movements import axis_names
from kineme.validation import Array

_CELL = 100  # bytes of a cell in Python
_COUNTED = re.compile(r"(.*?)[\W_]*(\d+)")  # x0, wrist.x_12
_COLON = re.compile(r":(?![^()]*\))")  # between columns, not within a date
_PAIR = re.compile(r"\(([^,()]*),([^,()]*)\)")  # a time and a value
_WHOLE = re.compile(r"[-+]?\d+(?:\.0*)?(?:[eE][-+]?0+)?")  # also as programs write classes as floats, 1.0000000e+00
_FRACTION = re.compile(r"[.eE].*")  # of a whole number
_PEEK = 20  # lines by which labels are known


class _Line(NamedTuple):
    """A line, its number counted from 1, and its cells."""

    number: int
    cells: list[str]


class _Row(NamedTuple):
    label: str | None
    positions: Array
    times: Array


def row_movements(data: bytes, layout: Layout) -> Parsed:
    """Return the movements of a table, one in each line: its label, then the coordinates of sample after sample.

    They are named by `layout.columns`, or by heads such as x0, y0, x1, y1. Cells that are empty or NaN at the end pad.
    """
    lines, heads = _table(data)
    names = _names(layout, heads)
    label = _label_column(lines, heads, len(names), layout)

    def read(given: Sequence[str]) -> _Row:
        cells = list(given)
        text = cells.pop(label) if label is not None and label < len(cells) else None
        try:
            values = np.array([as_float(cell or "nan") for cell in cells], dtype=np.float64)
        except ValueError:
            odd = next(cell for cell in cells if not is_number(cell or "nan", False))
            raise ValueError(f"expected numbers, got {odd!r:.40}") from None
        values = values[: np.flatnonzero(np.append(True, ~np.isnan(values)))[-1]]
        if len(values) % len(names):
            raise ValueError(f"expected samples of {len(names)} coordinates, got {len(values)} numbers")
        text = _FRACTION.sub("", text) if text and _WHOLE.fullmatch(text) else text
        return _Row(text or None, values.reshape(-1, len(names)), values[:0])

    parsed = _parsed(lines, read, layout, "CSV", names)
    head = () if label is None else (heads[label] if heads else f"column {label}",)
    return parsed._replace(detected=parsed.detected._replace(label=head))


def _table(data: bytes) -> tuple[list[_Line], list[str]]:
    """Return the lines, split into cells, and the heads, if there are any."""
    check_expanded(len(data) + _CELL * sum(map(data.count, (b",", b";", b"\t", b" "))))
    texts = [(number, line) for number, line in enumerate(lines_of(data), 1) if not is_skipped(line)]
    if not texts:
        raise DataError("expected a movement in each line, got an empty file")
    separator = separator_of([line for _, line in texts[:2]])
    lines = [_Line(number, split(line, separator)) for number, line in texts]
    numbers = [sum(is_number(cell, False) for cell in line.cells) for line in lines[:2]]
    if len(lines) > 1 and not numbers[0] and numbers[1]:
        return lines[1:], lines[0].cells
    return lines, []


def _names(layout: Layout, heads: Sequence[str]) -> list[str]:
    if layout.coordinates is not None:
        return [str(name) for name in layout.coordinates]
    stems = [match[1] for head in heads if (match := _COUNTED.fullmatch(head))]
    names = list(dict.fromkeys(stems))
    if names and all(names) and stems == names * (len(stems) // len(names)):
        return names
    raise DataError(
        "expected the coordinates of a sample, got no heads that name them as x0, y0, x1, y1; say columns=('x', 'y') "
        "where a line is x, y, x, y, ..., in the shell --columns x,y"
    )


def _label_column(lines: Sequence[_Line], heads: Sequence[str], width: int, layout: Layout) -> int | None:
    first = lines[0].cells
    if layout.label is not None:
        return column_numbers(heads or [f"column {k}" for k in range(len(first))], [layout.label])[0]
    if named := [k for k, head in enumerate(heads) if {*words_of(head)} & LABEL_WORDS]:
        return named[0]
    for k in (0, len(first) - 1):
        if not all(is_number(line.cells[k] if k < len(line.cells) else "0", False) for line in lines[:_PEEK]):
            return k
    return _class_column(lines, width)


def _class_column(lines: Sequence[_Line], width: int) -> int | None:
    """Return the column of classes that are whole numbers beside samples of `width` coordinates, or None."""
    peeked, n_cells = lines[:_PEEK], len(lines[0].cells)
    last = n_cells - 1 if all(len(line.cells) == n_cells for line in lines) else 0
    ends = [k for k in (0, last) if all(_WHOLE.fullmatch(line.cells[k]) for line in peeked)]
    if width > 1:
        if any(len(line.cells) % width != 1 for line in peeked):
            return None
        if not ends:
            raise DataError(
                f"expected a label in the first or the last of {n_cells} cells, since one is left beside samples of "
                f"{width} coordinates, got fractions in both; say which with label=, in the shell --label-column"
            )
        return ends[0]
    if 0 not in ends or all(_WHOLE.fullmatch(cell) for line in peeked for cell in line.cells if cell):
        return None
    classes = {line.cells[0].lstrip("+-") for line in peeked}
    return 0 if len(classes) > 1 or all(map(str.isdecimal, classes)) else None


def series_movements(data: bytes, layout: Layout) -> Parsed:
    """Return the movements of a ``.ts`` file, as sktime and aeon write them: one in each line below ``@data``.

    The columns of a movement are separated by colons, its values by commas, each alone or as ``(time,value)``.
    """
    check_expanded(len(data) + _CELL * data.count(b","))
    flags, body = _head(data)
    timed, labeled = _says(flags, "timestamps"), _says(flags, "classlabel")
    targeted = _says(flags, "targetlabel")

    def read(text: str) -> _Row:
        parts = _COLON.split(text)
        label = parts.pop().strip() if labeled or targeted else None
        times, x = _side_by_side([_timed(part) if timed else _values(part) for part in parts], timed)
        return _Row(label if labeled else None, x, times)

    if timed and any(is_date(stamp.strip()) for stamp, _ in _PAIR.findall(body[0][1])):
        layout = replace(layout, units="s")  # dates were counted in seconds
    parsed = _parsed(body, read, layout, "TS", timed=timed)
    ignored = ("the target",) if targeted else ()
    return parsed._replace(detected=parsed.detected._replace(ignored=ignored, label=("the class",) if labeled else ()))


def _head(data: bytes) -> tuple[dict[str, str], list[tuple[int, str]]]:
    """Return the attributes in lower case, and the lines below ``@data`` with their numbers."""
    flags: dict[str, str] = {}
    lines = enumerate(lines_of(data), 1)
    for _, line in lines:
        text = line.strip()
        if text.lower() == "@data":
            body = [(number, row.strip()) for number, row in lines if row.strip() and not row.startswith(("#", "%"))]
            if not body:
                break
            return flags, body
        if text.startswith("@"):
            name, _, value = text[1:].partition(" ")
            flags[name.lower()] = value.strip()
        elif text and not text.startswith(("#", "%")):
            break
    raise DataError("expected a .ts file of a time-series archive, with movements below a line @data, got none")


def _says(flags: dict[str, str], name: str) -> bool:
    return flags.get(name, "false").lower().split()[:1] == ["true"]


def _values(part: str) -> tuple[Array, Array]:
    x = np.array(part.replace("?", "nan").split(","), dtype=np.float64)
    return np.arange(float(len(x))), x


def _timed(part: str) -> tuple[Array, Array]:
    pairs = _PAIR.findall(part)
    if len(pairs) != part.count("("):
        raise ValueError(f"expected pairs (time,value), got {part[:40]!r}")
    stamps = [stamp.strip() for stamp, _ in pairs]
    x = np.array([cell.replace("?", "nan") for _, cell in pairs], dtype=np.float64)
    if not all(map(is_date, stamps)):
        return np.array(stamps, dtype=np.float64), x
    return seconds_of_dates(stamps)[0], x


def _side_by_side(columns: Sequence[tuple[Array, Array]], timed: bool) -> tuple[Array, Array]:
    """Return the columns of a movement as times (T,) and positions (T, d), without padding at the end."""
    if not columns:
        raise ValueError("expected values of at least one dimension, got none")
    lengths = [len(x) for _, x in columns]
    if len({*lengths}) > 1:
        raise ValueError(f"expected columns of one length, got {listed(map(str, lengths))}")
    times = columns[0][0]
    if timed and not all(np.array_equal(t, times) for t, _ in columns):
        raise ValueError("expected columns at the same times, got several clocks")
    x = np.column_stack([x for _, x in columns])
    filled = np.flatnonzero(~np.isnan(x).all(axis=1))
    end = filled[-1] + 1 if len(filled) else 0
    return times[:end], x[:end]


def _parsed(
    lines: Iterable[tuple[int, Any]],
    read: Callable[[Any], _Row],
    layout: Layout,
    kind: str,
    names: Sequence[str] = (),
    timed: bool = False,
) -> Parsed:
    """Read numbered lines as movements of the named coordinates, by default of the widest, and say what others lack."""
    rows, left_out = dict[str, _Row](), list[str]()
    for number, line in lines:
        try:
            rows[f"line {number}"] = read(line)
        except ValueError as error:
            left_out.append(f"line {number}: {error}")
    if not rows:
        reason = f"; {left_out[0]}" if left_out else ""
        raise DataError(f"expected a movement in each line, got none{reason}")
    widths = {place: row.positions.shape[1] for place, row in rows.items()}
    names = names or axis_names(max(widths.values()))
    for place, width in widths.items():
        if width != len(names):
            left_out.append(f"{place}: expected {len(names)} columns, got {width}")
            del rows[place]
    labels, xs, ts = zip(*rows.values(), strict=True)
    parsed = parsed_arrays(xs, ts if timed else None, Named(labels, "times", [*rows], names), layout, (kind, ROWS))
    return parsed._replace(left_out=tuple(left_out))
