"""The dialect of a table of samples: separator, decimal mark, heads, and types of the columns."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.limits import check_expanded
from kineme.movements.tables.columns import is_time
from kineme.movements.tables.table import flags_in
from kineme.movements.tables.time_stamps import is_date
from kineme.reporting.text import text_in
from kineme.units import unit_named

COMMENTS = ("#", "%", "//")
LONGEST = 2**22  # characters of a line, at most
_SEPARATORS = (";", "\t", ",")
_LETTERS = frozenset("mnwvahg-")  # units that may be names
_PEEK = 20  # samples from which the dialect is detected
_HEAD = 100_000  # lines among which they are
_MOST_HEADS = 5  # lines of heads, at most
_WIDEST, _SHORT = 100_000, 1000  # columns, at most; characters of a line that is not checked
_CELL = 32  # memory of a cell in Python, per character [bytes]
_DIGITS = r"[-+]?(\d+\.?\d*|\.\d+)(([eE][-+]?|[dD][-+])\d+)?"
_NUMBER = re.compile(rf"{_DIGITS}|[-+]?(nan|inf(inity)?)", re.IGNORECASE)
_MEASURED = re.compile(rf"{_DIGITS}\s*(?P<unit>[^\s\d.,].*)")  # a number with its unit beside it: 12.3 mm
_FORTRAN = re.compile(r"(?<=[\d.])[dD](?=[-+]\d)")  # before an exponent, of double precision
_MISSING = frozenset({"", "na", "n/a", "#n/a", "<na>", "null", "none"})  # as R, pandas and others write a gap
_BRACKETED = re.compile(r"^[\[(]\s*(.*?)\s*[\])]$")  # a unit; the brackets of m/(s^2) are its own
_STAMP = re.compile(r"\d+([:/.-])\d+\1\d+")  # digits of a date or of a time of day
_SEPARATOR_LINE = re.compile(r'"?sep=.{0,2}', re.IGNORECASE)
COMMA_NUMBER = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?")
#: A number whose marks lie between thousands for certain: 1,234.5 and 1.234,5 and 1 234,5 and 1'234 and 1,234,567.
_THOUSANDS = re.compile(
    r"[-+]?[1-9]\d{0,2}((,\d{3})+\.\d*|(\.\d{3})+,\d*|(,\d{3}){2,}|(\.\d{3}){2,}"
    r"|([ '\u2019\xa0\u202f_]\d{3})+([.,]\d*)?)"
)
_COMMA_NUMBERS = re.compile(rf"\s*{COMMA_NUMBER.pattern}(\s+{COMMA_NUMBER.pattern})+\s*")  # between blanks


class Dialect(NamedTuple):
    """The notation of a table: its separator (None: blanks), decimal comma, heads, and where the numbers begin."""

    separator: str | None
    decimal_comma: bool
    heads: tuple[str, ...]
    named: bool
    first: int  # line of the first sample, counted from 0
    kinds: tuple[str, ...]  # "number", "flag", "date" or "text" per column
    measured_in: tuple[str, ...] = ()  # per column, from a row of units below the heads
    end: int | None = None  # line after the last sample; None: the end of the file
    names_rows: bool = False  # whether the first column tells movements or labels apart, be these numbers

    def is_sample(self, line: str) -> bool:
        """Tell whether a line holds a sample, also one that begins like a comment but fits the columns."""
        if not is_skipped(line):
            return True
        if not (self.names_rows or self.kinds[0] == "text") or not line.strip():
            return False
        cells = split(line, self.separator)
        if self.kinds[0] == "number" and is_number(cells[0].lstrip("#%/ "), self.decimal_comma):
            return False
        return len(cells) == len(self.kinds) and all(
            is_number(cell, self.decimal_comma)
            for k, (cell, kind) in enumerate(zip(cells, self.kinds, strict=True))
            if k and kind == "number"
        )


def is_skipped(line: str) -> bool:
    """Tell whether a line is empty, begins as a comment, or says the separator to Excel: ``sep=;``."""
    stripped = line.strip()
    return not stripped or stripped.startswith(COMMENTS) or _SEPARATOR_LINE.fullmatch(stripped) is not None


def check_line(line: str) -> None:
    """Refuse a line that is too long to be one of a table, before it is split."""
    if len(line) <= _SHORT:
        return
    check_expanded(_CELL * len(line), "lines")
    if len(line) <= _WIDEST:
        return
    n_columns = 1 + max(map(line.count, _SEPARATORS))
    if len(line) > LONGEST or n_columns > _WIDEST:
        raise DataError(
            f"expected lines of at most {LONGEST:,} characters and {_WIDEST:,} columns, got one of {len(line):,} "
            f"characters and {n_columns:,} columns"
        )


def split(line: str, separator: str | None) -> list[str]:
    """Return the cells of a line."""
    plain = line.rstrip("\r\n")
    cells = _quoted_cells(plain, separator) if '"' in line else plain.split(separator)
    return [cell.strip() for cell in cells]


def _quoted_cells(line: str, separator: str | None) -> list[str]:
    """Return cells, quoted ones as csv does, whose limit on their length holds for the whole process."""
    end = r"\s" if separator is None else re.escape(separator)
    cell = re.compile(rf'[^\S{end}]*"([^"]*(?:""[^"]*)*)(?:"([^{end}]*))?|([^{end}]*)')
    gap = re.compile(r"\s+" if separator is None else end)
    line = line.strip() if separator is None else line
    cells, at = [], 0
    while match := cell.match(line, at):
        cells.append(match[3] if match[1] is None else match[1].replace('""', '"') + (match[2] or ""))
        if (between := gap.match(line, match.end())) is None:
            break
        at = between.end()
    return cells


def detect_dialect(text: Iterable[str]) -> Dialect:
    """Detect the dialect of a table, from its first lines; no more lines are read than needed."""
    lines, rows = [], []
    for line in islice(text, _HEAD):
        check_line(line)
        lines.append(line)
        if not is_skipped(line):
            rows.append(len(lines) - 1)
        if len(rows) == _PEEK:
            break
    if not rows:
        more = len(lines) == _HEAD
        raise DataError(f"expected samples, got {f'none in the first {_HEAD:,} lines' if more else 'an empty file'}")
    rows = _with_names_like_comments(lines, rows)
    separator = separator_of([lines[k] for k in rows[:2]])
    cells = [split(lines[k], separator) for k in rows]
    if (below := _below_preamble(lines, rows, cells)) != rows:
        rows, separator = below, separator_of([lines[k] for k in below[:2]])
        cells = [split(lines[k], separator) for k in rows]
    comma = separator != "," and any(COMMA_NUMBER.fullmatch(cell) for row in cells for cell in row)
    n_heads = _n_heads(cells, comma)
    rows, cells = rows[n_heads - 1 :], [_joined(cells[:n_heads]), *cells[n_heads:]]
    named = not _is_sample(cells, comma)
    heads, first = cells[0] if named else _commented_head(lines[: rows[0]], separator, len(cells[0])), rows[0] + named
    numbers = [str(k) for k in range(len(cells[0]))]  # above fractions, as data frames without heads are written
    numbered = not named and cells[0] == numbers and any("." in cell for cell in cells[-1])
    first += numbered
    units = _units_below(cells[0], cells[1]) if named and len(cells) > 2 and len(cells[1]) <= len(cells[0]) else ()
    if units:
        units, first = (*units, *[""] * (len(cells[0]) - len(units))), rows[1] + 1
    body = cells[named + bool(units) or numbered :]
    kinds = tuple(_kind([row[k] for row in body if k < len(row)], comma) for k in range(len(cells[0])))
    for k, (kind, cell) in enumerate(zip(kinds, body[0] if body else (), strict=False)):
        if kind == "text" and _STAMP.search(cell) and (is_time(heads[k]) if heads else k == 0):
            where = repr(heads[k]) if heads else "the first column"
            raise DataError(
                f"expected times such as 2024-05-06T07:08:09.25 or 07:08:09.25 in {where}, got {cell!r:.80}; write "
                f"them so{'' if heads else ', or name the columns in a first line'}"
            )
    # The first column without a head is of times, which no flag is.
    flags = {
        k
        for k in range(0 if heads else 1, len(kinds))
        if flags_in([row[k] for row in body if k < len(row) and not is_missing(row[k])]) is not None
    }
    kinds = tuple("flag" if k in flags else kind for k, kind in enumerate(kinds))
    if heads:
        return Dialect(separator, comma, tuple(map(text_in, heads)), True, first, kinds, tuple(map(text_in, units)))
    names = tuple(f"column {k}" for k in range(len(kinds)))
    return Dialect(separator, comma, names, False, first, kinds)


def _n_heads(cells: Sequence[list[str]], comma: bool) -> int:
    """Count the lines of heads: several where a name in the first stands above several columns, as of points."""
    lines = next((k for k, row in enumerate(cells) if any(is_number(cell, comma) or is_date(cell) for cell in row)), 1)
    lines -= lines > 1 and bool(units_in(cells[lines - 1]))
    if not 1 < lines <= _MOST_HEADS or len({len(row) for row in cells[:lines]}) > 1:
        return 1
    top = [cell for cell in _filled(cells[:lines])[0] if cell]
    return lines if len({*top}) < len(top) and not any(map(units_in, cells[1:lines])) else 1


def _filled(rows: Sequence[list[str]]) -> list[list[str]]:
    """Return lines of heads with a name also above the columns to the right that it stands for, whose cells are empty.

    It ends where one above it does, and stands for no column without a name below; the first column is none of them.
    """
    filled = [list(row) for row in rows]
    for i, row in enumerate(filled[:-1]):
        for k in range(2, len(row)):
            goes_on = i == 0 or filled[i - 1][k] == filled[i - 1][k - 1]
            if not row[k] and goes_on and any(below[k] for below in rows[i + 1 :]):
                row[k] = row[k - 1]
    return filled


def _joined(rows: Sequence[list[str]]) -> list[str]:
    """Return lines of heads as one: ``nose`` above ``x`` is nose.x. DeepLabCut's line of the scorer is left out."""
    if len(rows) == 1:
        return rows[0]
    names = [row[1:] for row in _filled(rows) if row[0] != "scorer"]
    first = next((row[0] for row in reversed(rows) if row[0]), "")
    heads = (".".join(filter(None, cells)) for cells in zip(*names, strict=True))
    return ["frame" if first == "coords" else first, *heads]


def _units_below(heads: Sequence[str], cells: Sequence[str]) -> tuple[str, ...]:
    """Return the units in a row below heads that all differ, also beside words that are no units to us: ``%MVC``."""
    words = len({*heads}) == len(heads) and not any(is_number(cell, True) or is_date(cell) for cell in cells)
    return units_in(cells, words)


def units_in(cells: Sequence[str], words: bool = False) -> tuple[str, ...]:
    """Return the units in a row of nothing but units, without brackets, or of `words` beside them; else nothing."""
    plain = tuple(_BRACKETED.sub(r"\1", cell.strip()) for cell in cells)
    letters = [cell.lower() in _LETTERS for cell in plain]
    n_units = sum(unit_named(cell) is not None for cell, letter in zip(plain, letters, strict=True) if not letter)
    others = sum(unit_named(cell) is None for cell, letter in zip(plain, letters, strict=True) if cell and not letter)
    return plain if n_units and (words or not others) and 2 * sum(map(bool, plain)) >= len(plain) else ()


def _below_preamble(lines: Sequence[str], own: list[int], cells: Sequence[list[str]]) -> list[int]:
    """Return the lines from the heads on, below lines of other lengths without rows of numbers, as of loggers."""
    widths = {*map(len, cells)}
    if len(widths) == 1 and widths != {1}:
        return own
    separator = separator_of([lines[k] for k in own[-2:]])
    rows = [split(lines[k], separator) for k in own]
    width, comma = len(rows[-1]), separator != ","
    first = next(k for k, row in enumerate(rows) if len(row) == width)
    numbers = [sum(is_number(cell, comma) for cell in row) for row in rows]
    is_preamble = all(n < max(2, len(row)) for n, row in zip(numbers[:first], rows[:first], strict=True))
    below = rows[first:]
    if width < 2 or len(below) < 3 or numbers[first] or not is_preamble or any(len(row) != width for row in below):
        return own
    return own[first:]


def _with_names_like_comments(lines: Sequence[str], numbers: list[int]) -> list[int]:
    """Add lines that begin like comments but are rows, ``#1,0.0,0.25``, where no other row begins with a number."""
    separator = separator_of([lines[numbers[0]]])
    if separator is None or len(numbers) == len(lines) - numbers[0]:  # no line below was skipped
        return numbers
    rows = [split(lines[k], separator) for k in numbers]
    if any(is_number(row[0], separator != ",") for row in rows):
        return numbers
    below = (k for k in range(numbers[0] + 1, len(lines)) if lines[k].strip() and is_skipped(lines[k]))
    marked = ((k, split(lines[k], separator)) for k in below)
    own = (
        k
        for k, row in marked
        if len(row) == len(rows[0]) and any(is_number(cell, separator != ",") for cell in row[1:])
    )
    return sorted({*numbers, *islice(own, _PEEK)})[:_PEEK]


def separator_of(lines: Sequence[str]) -> str | None:
    """Return the mark between cells, by the first lines; None for blanks."""
    for mark in _SEPARATORS:
        if all(mark in line for line in lines):
            return None if mark == "," and all(map(_COMMA_NUMBERS.fullmatch, lines)) else mark
    return None


def is_missing(cell: str) -> bool:
    """Tell whether a cell says that there is no value: it is empty, ``NA``, ``null``."""
    return cell.lower() in _MISSING


def is_number(cell: str, comma: bool) -> bool:
    """Tell whether a cell reads as a number."""
    return bool(_NUMBER.fullmatch(cell) or (comma and COMMA_NUMBER.fullmatch(cell)))


def numbers_in(cells: Sequence[str], comma: bool) -> NDArray[np.float64]:
    """Return numbers, NaN for other cells."""
    try:
        return np.array(cells, dtype=np.float64)
    except ValueError:
        return np.array([as_float(cell.replace(",", ".")) if is_number(cell, comma) else np.nan for cell in cells])


def as_float(cell: str) -> float:
    """Return a number, also one whose exponent is written as Fortran does: 1.5D+02."""
    return float(_FORTRAN.sub("E", cell) if "d" in cell.lower() else cell)


def _is_measured(cell: str) -> bool:
    """Tell whether a cell holds a number and its unit, or percent."""
    match = _MEASURED.fullmatch(cell)
    return match is not None and (match["unit"] == "%" or unit_named(match["unit"]) is not None)


def marks_within(cell: str) -> str:
    """Say how to write a number that nobody can read for what is in it; nothing where a cell is no such number."""
    if _is_measured(cell):
        return " without their unit, which belongs into the head, as in 'x [mm]'"
    if _THOUSANDS.fullmatch(cell):
        return " without marks between thousands"
    return " with a decimal point, without marks between thousands" if COMMA_NUMBER.fullmatch(cell) else ""


def _is_sample(cells: Sequence[list[str]], comma: bool) -> bool:
    """Tell whether the first line holds a sample, not heads: it has as many numbers as the next, and at least one."""
    counts = [sum(is_number(cell, comma) for cell in row) for row in cells[:2]]
    return counts[0] > 0 and counts[0] >= counts[-1]


def _commented_head(lines: Sequence[str], separator: str | None, n_columns: int) -> list[str]:
    """Give the heads in the last comment above the samples, if it has as many words as columns, and one is for time."""
    comments = [line.strip().lstrip("#%/") for line in lines if line.strip()]
    if not comments:
        return []
    heads = split(comments[-1].strip(), separator)
    return heads if len(heads) == n_columns and any(map(is_time, heads)) else []


def _kind(cells: Sequence[str], comma: bool) -> str:
    filled = [cell for cell in cells if not is_missing(cell)] or [cell for cell in cells if cell.lower() == "none"]
    if filled and all(map(is_date, filled)):
        return "date"
    if all(map(_NUMBER.fullmatch, filled)):
        return "number"
    if all(map(_is_measured, filled)):
        return "number"
    # Numbers with marks that nobody can read are numbers too, so that they are refused.
    n_numbers = sum(is_number(cell, True) or _THOUSANDS.fullmatch(cell) is not None for cell in filled)
    return "number" if 2 * n_numbers >= len(filled) else "text"
