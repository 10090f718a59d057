"""CSV and similar text tables, and exports of motion capture, read by NumPy's C parser; irregular lines one by one."""

from __future__ import annotations

import io
import re
from codecs import BOM_UTF8
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from itertools import chain, islice
from typing import Any

import numpy as np

from kineme.errors import DataError
from kineme.io.limits import check_expanded
from kineme.io.motion_capture import export_heads
from kineme.io.motion_capture.export_heads import ExportHead
from kineme.io.tables.dialect import (
    COMMA_NUMBER,
    COMMENTS,
    LONGEST,
    Dialect,
    as_float,
    check_line,
    detect_dialect,
    is_missing,
    marks_within,
    numbers_in,
    split,
)
from kineme.movements.tables.columns import Roles, choose_roles, may_count, with_times_that_increase
from kineme.movements.tables.layout import Layout
from kineme.movements.tables.table import FLAGS, Table
from kineme.movements.tables.time_stamps import seconds_of_dates
from kineme.validation import MIN_SAMPLES, ROUNDED, Array

_STRETCH = 1000  # lines that are parsed at a time
_FAULTS = 2_000_000  # lines with faults, at most: each takes a while and some memory
_EMPTY = 20_000  # lines without any number, after which none is expected

_POSITION = re.compile(r"(.*)position(\d+)")  # of a joint
_EXACT_TO = 2.0**53
_INTEGER, _DIGITS = re.compile(r"[-+]?\d{16,}"), 300
_EMPTY_LINE = re.compile(rb"\n[ \t\r]*\n")
_SMOOTH = 0.3  # of the range: a step from 999 to 1.002 is less if these are thousands, and more if they are decimals
_GROUPED = re.compile(r"[-+]?[1-9]\d{0,2}[.,]\d{3}")  # a number that may be thousands
_NO_COUNT = np.array([0.5])  # in place of cells that are not read yet
_NUMBER, _TEXT, _COLUMN = 8, 64, 1000  # bytes of a number, a text and a column

_HEAD_LINES = 400  # of an export with a head of its own, at most
_FIRST = 3  # lines among which the first line of an export is
_MAKERS = (
    export_heads.optitrack_head, export_heads.vicon_head, export_heads.qualisys_head, export_heads.trc_head,
    export_heads.opensim_head, export_heads.empatica_head,
)  # fmt: skip
_LINE = 100  # bytes of a line in Python, beside its characters
_SAMPLES = 5  # in which decimal commas are looked for
_ROUNDED = 1e-5  # s by which written times may differ from those of frames at the rate


def read_text_table(data: bytes, layout: Layout) -> tuple[Table, Roles]:  # noqa: PLR0912 - one check after the other
    """Read a table of samples by lines, whatever their separator, heads, quotes and decimal mark, see `Dialect`."""
    encoding = _encoding(data)
    if (export := export_head(_lines(data, encoding), len(data))) is not None:
        return _read_export(data, encoding, export, layout)
    dialect = detect_dialect(_lines(data, encoding))
    _check_memory(data, dialect)
    dialect, roles, rows, faults = _roles_and_rows(data, encoding, dialect, layout)
    dated = roles.time is not None and dialect.kinds[roles.time] == "date"
    flags = {k for k, kind in enumerate(dialect.kinds) if kind == "flag"}
    if roles.time is None and layout.every is None and _EMPTY_LINE.search(data):
        # Refuse samples without times that empty lines part, of which nobody said that they are one movement.
        numbers = [line for line, _ in _samples(data, encoding, dialect)]
        sizes = np.diff([0, *(np.flatnonzero(np.diff(numbers) > 1) + 1), len(numbers)])
        if len(sizes) > 1 and sizes.min() >= MIN_SAMPLES:
            alike = f"say every={sizes[0]}, in the shell --every {sizes[0]}"
            remedy = alike if (sizes == sizes[0]).all() else "save each in a file of its own"
            raise DataError(
                f"expected one movement, got {len(sizes)} blocks of {sizes.min()} to {sizes.max()} samples between "
                f"lines that are left out; {remedy}, or remove those lines"
            )
    columns = [rows[name] for name in rows.dtype.names or ()]
    for k in flags & {*roles.positions}:
        cells = ["" if is_missing(cell) else cell.lower() for cell in columns[k].tolist()]
        columns[k] = np.array([FLAGS.get(cell, np.nan) for cell in cells])
        said = f"expected true or false in {dialect.heads[k]!r}"
        faults |= {row: f"{said}, got {cell!r}" for row, cell in enumerate(cells) if cell not in FLAGS}
    if long := [k for k in roles.positions if (np.abs(columns[k]) >= _EXACT_TO).any()]:
        faults |= _rounded(_samples(data, encoding, dialect), dialect, long)
    if unread := [k for k in roles.positions if np.isnan(columns[k]).all()]:
        _check_written(_samples(data, encoding, dialect), dialect, unread)
    if dialect.separator != ",":
        if b"." in data and b"," in data and (grouped := [k for k in roles.positions if _may_be_thousands(columns[k])]):
            _check_marks(_samples(data, encoding, dialect), dialect, grouped)
        for k in roles.positions:
            x = columns[k][np.isfinite(columns[k])]
            n_integers = int((x == np.rint(x)).sum())
            if 0 < n_integers < len(x) and _may_be_thousands(x):  # 999, 1.002
                split_lines = (split(line, dialect.separator) for _, line in _samples(data, encoding, dialect))
                _check_grouped((row[k] for row in split_lines if k < len(row)), dialect.heads[k])
    if dated and roles.time is not None:
        columns[roles.time], others = seconds_of_dates(columns[roles.time].tolist())
        said = f"expected a date in {dialect.heads[roles.time]!r}"
        faults = {row: f"{said}, got {cell or 'nothing'!r}" for row, cell in others.items()} | faults
    # Heads with the names of joints in place of ``field.position0`` where the column ``field.name0`` says one name.
    renamed = list(dialect.heads)
    place = {head: k for k, head in enumerate(dialect.heads)}
    for head, k in place.items():
        match = _POSITION.fullmatch(head)
        beside = None if match is None else place.get(f"{match[1]}name{match[2]}")
        if beside is not None and columns[beside].dtype.kind == "O" and len(names := {*columns[beside].tolist()}) == 1:
            renamed[k] = next(iter(names)) or head
    heads = tuple(renamed) if len({*renamed}) == len(renamed) else dialect.heads
    line_of = _line_numbers(data, encoding, dialect)
    return Table(heads, columns, len(rows), line_of, faults, "s" if dated else None, dialect.measured_in), roles


def _roles_and_rows(
    data: bytes, encoding: str, dialect: Dialect, layout: Layout
) -> tuple[Dialect, Roles, Any, dict[int, str]]:
    """Find the roles of columns and read their rows; whether those count that are named so is seen in their cells."""
    roles = choose_roles(dialect.heads, dialect.kinds, layout, dialect.named, lambda _: _NO_COUNT)
    are_found = dialect.named and layout.coordinates is None
    counters = {k for k in roles.positions if are_found and may_count(dialect.heads[k])}
    dated = roles.time is not None and dialect.kinds[roles.time] == "date"
    texts = {k for k in (*roles.movement, roles.label, *roles.ignored, roles.time if dated else None) if k is not None}
    texts |= {k for k, kind in enumerate(dialect.kinds) if kind == "flag"}
    if 0 in {roles.label, *roles.movement}:
        dialect = dialect._replace(names_rows=True)
    rows, faults = _rows(data, encoding, dialect, texts | counters)

    def values(k: int) -> Any:
        return numbers_in(rows[f"c{k}"].tolist(), dialect.decimal_comma) if k in counters else rows[f"c{k}"]

    if counters:
        roles = choose_roles(dialect.heads, dialect.kinds, layout, dialect.named, values)
    if counters & {*roles.positions}:
        rows, faults = _rows(data, encoding, dialect, texts | counters - {*roles.positions})
    if roles.time is not None and not (dialect.named or dated or layout.time is not None):
        roles = with_times_that_increase(roles, rows[f"c{roles.time}"], layout)
    return dialect, roles, rows, faults


def _check_written(samples: Iterator[tuple[int, str]], dialect: Dialect, columns: Sequence[int]) -> None:
    """Refuse columns that hold nothing that reads as a number, unless they hold nothing at all."""
    for _, line in samples:
        cells = split(line, dialect.separator)
        for k in columns if len(cells) == len(dialect.heads) else ():
            if not is_missing(cells[k]):
                raise DataError(
                    f"expected numbers in {dialect.heads[k]!r}{marks_within(cells[k])}, got {cells[k]!r}; write them "
                    "so, or leave the column aside with exclude=, in the shell --exclude"
                )


def _may_be_thousands(x: Array) -> bool:
    """Tell whether all numbers have at most three digits before the mark and behind it, which may be thousands."""
    x = x[np.isfinite(x)]
    return len(x) > 0 and bool((np.abs(x) < 1000).all() and (np.abs(1000 * x - np.rint(1000 * x)) < 1e-6).all())


def _check_marks(samples: Iterator[tuple[int, str]], dialect: Dialect, columns: Sequence[int]) -> None:
    """Refuse columns of thousands alone, 1,002 or 1.002, beside others that have the other mark before decimals."""
    numbers = [k for k, kind in enumerate(dialect.kinds) if kind == "number"]
    marked: dict[int, dict[str, str]] = {k: {} for k in numbers}  # column -> mark -> the first cell with it
    for _, line in samples:
        cells = split(line, dialect.separator)
        if len(cells) == len(dialect.heads):
            columns = [k for k in columns if is_missing(cells[k]) or _may_be_grouped(cells[k])]
            if not columns:
                return
            for k in numbers:
                for mark in {".", ","} & {*cells[k]}:
                    marked[k].setdefault(mark, cells[k])
    for k in columns:
        other = [cell for several in marked.values() for mark, cell in several.items() if mark not in marked[k]]
        if len(marked[k]) == 1 and other:
            raise DataError(
                f"expected numbers in {dialect.heads[k]!r} without marks between thousands, got "
                f"{next(iter(marked[k].values()))!r} beside {other[0]!r}; write them without such marks"
            )


def _may_be_grouped(cell: str) -> bool:
    return cell.lstrip("+-").isdecimal() or _GROUPED.fullmatch(cell) is not None


def _check_grouped(column: Iterable[str], head: str) -> None:
    """Refuse cells in which a mark is between thousands: 999, 1.002, which are one step apart and not one thousand."""
    cells: list[str] = []
    for cell in column:
        if not _may_be_grouped(cell):
            return
        cells.append(cell)
    marked = np.array([_GROUPED.fullmatch(cell) is not None for cell in cells])
    x = np.array([float(re.sub("[.,]", "", cell)) for cell in cells])
    between = np.flatnonzero(marked[1:] != marked[:-1])
    small, large = (
        float(np.median(np.abs(np.diff(each)[between]))) / float(np.ptp(each)) if len(between) and np.ptp(each) else 0.0
        for each in (x, np.where(marked, x / 1000, x))
    )
    if small < _SMOOTH < large:
        odd, plain = (cells[int(np.argmax(each))] for each in (marked, ~marked))
        raise DataError(
            f"expected numbers in {head!r} without marks between thousands, got {odd!r} beside {plain!r}; write them "
            "without such marks"
        )


def _rounded(samples: Iterator[tuple[int, str]], dialect: Dialect, columns: Sequence[int]) -> dict[int, str]:
    """Return row -> the first integer in some columns that a number of 64 bits would round."""
    faults: dict[int, str] = {}
    for row, (_, line) in enumerate(samples):
        cells = split(line, dialect.separator)
        for k in columns if len(cells) == len(dialect.heads) else ():
            if _INTEGER.fullmatch(cells[k]) and (len(cells[k]) > _DIGITS or int(cells[k]) != int(float(cells[k]))):
                faults[row] = (
                    f"expected a number in {dialect.heads[k]!r} that a float can hold, got {cells[k]}{ROUNDED}"
                )
    return faults


def export_head(lines: Iterable[str], n_bytes: int) -> tuple[ExportHead, Dialect] | None:
    """Return the head of an export of `_MAKERS` and how its samples are written; None for other tables."""
    lines = iter(lines)
    some = list(islice(lines, _FIRST))
    for line in some:
        check_line(line)
    for find in _MAKERS:
        try:
            is_made = find(some, split) is not None
        except DataError:  # the head is longer than the first lines
            is_made = True
        if is_made:
            break
    else:
        return None
    most: int | None = _HEAD_LINES
    if find is export_heads.vicon_head:  # the section that is read may stand anywhere
        check_expanded(2 * n_bytes + _LINE)
        most = None
    some += list(islice(lines, most))
    head = find(some, split)
    assert head is not None
    rows = [split(line, head.separator) for line in some[head.first : head.end][:_SAMPLES] if line.strip()]
    if not rows:
        raise DataError(f"expected samples below the heads of a {head.maker} export, got none")
    wide = max(0, len(rows[0]) - len(head.heads))
    heads, units = ((*given, *[""] * wide) for given in (head.heads, head.measured_in))
    comma = (
        not head.packed and head.separator != "," and any(COMMA_NUMBER.fullmatch(cell) for row in rows for cell in row)
    )
    kinds = ("number",) * len(heads)
    return head, Dialect(head.separator, comma, heads, True, head.first, kinds, units, head.end)


def _read_export(data: bytes, encoding: str, export: tuple[ExportHead, Dialect], layout: Layout) -> tuple[Table, Roles]:
    """Read the text export of a motion capture system; the rate in its head becomes time stamps."""
    head, dialect = export
    if not head.is_timed and isinstance(layout.units, float | int):
        head = head._replace(rate=None)  # the step that the caller says wins
    data = data.replace(b",", b"\t") if head.packed else data
    _check_memory(data, dialect)
    more = head.rate is not None and not head.is_timed  # a column of the times that follow from the rate
    heads = (*dialect.heads, *[export_heads.STAMP] * more)
    measured_in = (*dialect.measured_in, *["s"] * more)
    roles = choose_roles(heads, (*dialect.kinds, *["number"] * more), layout)
    rows, faults = _rows(data, encoding, dialect, {k for k in (*roles.movement, roles.label) if k is not None})
    faults = {row: text for row, text in faults.items() if "columns" in text}  # other cells are taken for gaps
    columns = _with_times_and_gaps(head, dialect.heads, [rows[name] for name in rows.dtype.names or ()])
    line_of = _line_numbers(data, encoding, dialect)
    return Table(heads, columns, len(rows), line_of, faults, None, measured_in, None, head.maker), roles


def _with_times_and_gaps(head: ExportHead, names: Sequence[str], columns: list[Any]) -> list[Any]:
    """Return columns with the times of frames at the rate, and NaN for markers that were not found."""
    if head.rate is not None and not head.is_timed:
        counted = {name: columns[k] for k, name in enumerate(names) if name in ("frame", "sub frame")}
        frames, parts = counted.get("frame"), counted.get("sub frame")
        if frames is None or (parts is not None and parts.any()):  # frames are divided or not counted
            frames = np.arange(len(columns[0]))
        columns = [*columns, head.start + (frames - frames[0]) / head.rate]
    elif head.rate is not None and "frame" in head.heads:
        k, frames = head.heads.index(export_heads.STAMP), columns[head.heads.index("frame")]
        even = columns[k][0] + (frames - frames[0]) / head.rate
        columns[k] = np.where(np.abs(columns[k] - even) <= _ROUNDED, even, columns[k])
    if head.zeros_are_gaps:
        # NaN in place of the zeros that stand for a marker or a body that was not found.
        groups: dict[str, list[int]] = {}
        for k, name in enumerate(names):
            if name[-2:] in (".x", ".y", ".z"):
                groups.setdefault(name[:-2].removesuffix(".position"), []).append(k)
        for owner, members in groups.items():
            lost = np.all([columns[k] == 0 for k in members], axis=0)
            if lost.any():
                angles = [k for k, name in enumerate(names) if name.startswith(f"{owner}.")]
                for k in chain(members, angles):
                    columns[k] = np.where(lost, np.nan, columns[k])
    return columns


def _rows(data: bytes, encoding: str, dialect: Dialect, texts: set[int]) -> tuple[Any, dict[int, str]]:
    dtype = np.dtype([(f"c{k}", "O" if k in texts else "f8") for k in range(len(dialect.heads))])
    rows = _read_fast(data, encoding, dialect, dtype)
    return read_slowly(_samples(data, encoding, dialect), dialect, dtype) if rows is None else (rows, {})


def _line_numbers(data: bytes, encoding: str, dialect: Dialect) -> Callable[[int], int | None]:
    lines = cache(lambda: np.fromiter((line for line, _ in _samples(data, encoding, dialect)), np.intp))
    return lambda row: int(lines()[row])


def lines_of(data: bytes) -> Iterator[str]:
    """Return the lines of a text of any encoding that `read_text_table` takes; a `DataError` if it is none."""
    return _lines(data, _encoding(data))


def _encoding(data: bytes) -> str:
    """Tell the encoding of a text, of which no stretch is longer than the lines of a table ever are."""
    for at in range(0, len(data) - LONGEST, LONGEST):
        if data.find(b"\n", at, at + LONGEST) < 0 and data.find(b"\r", at, at + LONGEST) < 0:
            raise DataError(f"expected lines of at most {LONGEST:,} characters, got a longer one")
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    if b"\0" in data:
        raise DataError("expected text, got bytes that are none")
    try:
        data if data.isascii() else data.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"  # degree signs of older programs, for example
    return "utf-8-sig"


def _lines(data: bytes, encoding: str) -> Iterator[str]:
    """Return the lines, decoded; `_encoding` has checked that all bytes of 8 bits are valid."""
    lines = io.TextIOWrapper(io.BytesIO(data), encoding=encoding)
    return _checked(lines) if encoding == "utf-16" else iter(lines)


def _checked(lines: Iterable[str]) -> Iterator[str]:
    try:
        for line in lines:
            if "\0" in line:
                raise DataError("expected text, got bytes that are none")
            yield line
    except UnicodeError as error:
        raise DataError(f"expected text, got bytes that are none ({error})") from error


def _samples(data: bytes, encoding: str, dialect: Dialect) -> Iterator[tuple[int, str]]:
    """Return line number, counted from 1, and text of every sample."""
    numbered = enumerate(islice(_lines(data, encoding), dialect.first, dialect.end), dialect.first + 1)
    return ((k, line) for k, line in numbered if dialect.is_sample(line))


def _check_memory(data: bytes, dialect: Dialect) -> None:
    """Refuse a table that would take more memory than the limit, from the number of its lines and columns."""
    n_lines = 1 + max(data.count(b"\n"), data.count(b"\r"))
    row = sum(_TEXT if kind == "text" else _NUMBER for kind in dialect.kinds)
    check_expanded(len(data) + _COLUMN * len(dialect.kinds) + n_lines * row)


def _read_fast(data: bytes, encoding: str, dialect: Dialect, dtype: np.dtype[Any]) -> Any:
    """Read samples as a structured array, or None if a line differs from the others: then `read_slowly` is needed."""
    has_text = any(dtype[name].kind == "O" for name in dtype.names or ())
    if dialect.decimal_comma and has_text:
        return None  # a comma in a name is not a decimal mark
    if b'"' in data and not (encoding != "utf-16" and quotes_are_plain(data.removeprefix(BOM_UTF8), dialect)):
        return None
    lines: Iterator[str] = islice(_lines(data, encoding), dialect.first, dialect.end)
    if any(mark.encode() in data for mark in COMMENTS):
        lines = filter(dialect.is_sample, lines)
    if dialect.decimal_comma:
        lines = (line.replace(",", ".") for line in lines)
    first = next(filter(dialect.is_sample, lines), None)
    if first is None:
        raise DataError("expected samples, got none below the heads")
    return try_rows(chain((first,), lines), dialect, dtype)


def read_slowly(
    samples: Iterable[tuple[int, str]], dialect: Dialect, dtype: np.dtype[Any]
) -> tuple[Any, dict[int, str]]:
    """Read all samples, NaN for missing numbers, and row -> what is wrong there; an empty cell or NA is a gap."""
    stretches, faults, n_rows, has_numbers = [], dict[int, str](), 0, False
    numeric = [name for name in dtype.names or () if dtype[name].kind == "f"]
    samples = iter(samples)
    while lines := [line for _, line in islice(samples, _STRETCH)]:
        rows, wrong = _read_stretch(lines, dialect, dtype)
        faults.update({n_rows + row: reason for row, reason in wrong.items()})
        stretches.append(rows)
        n_rows += len(rows)
        has_numbers = has_numbers or any(np.isfinite(rows[name]).any() for name in numeric)
        if len(faults) > _FAULTS or (n_rows >= _EMPTY and not has_numbers):
            raise DataError(
                f"expected samples, got {len(faults):,} lines with faults among the first {n_rows:,}; the first: "
                f"{next(iter(faults.values()), 'no number')}"
            )
    if not stretches:
        raise DataError("expected samples, got none below the heads")
    return np.concatenate(stretches), faults


def _read_stretch(lines: list[str], dialect: Dialect, dtype: np.dtype[Any]) -> tuple[Any, dict[int, str]]:
    texts = [dtype[name].kind == "O" for name in dtype.names or ()]
    if not (dialect.decimal_comma and any(texts)):
        plain = [line.replace(",", ".") for line in lines] if dialect.decimal_comma else lines
        quoted = any('"' in line for line in plain)
        are_plain = not quoted or quotes_are_plain("".join(plain).encode(), dialect)
        if are_plain and (read := try_rows(plain, dialect, dtype)) is not None:
            return read, {}
        if not quoted and not any(texts) and dialect.separator:  # an empty cell is usual
            text = "\n".join(line.rstrip("\r\n") for line in plain)
            mark = dialect.separator
            for _ in range(2):  # of three separators in a row, the first replacement finds one empty cell
                text = text.replace(mark + mark, f"{mark}nan{mark}")
            text = f"\n{text}\n".replace(f"\n{mark}", f"\nnan{mark}").replace(f"{mark}\n", f"{mark}nan\n")
            if (read := try_rows(text[1:-1].split("\n"), dialect, dtype)) is not None:
                return read, {}
    rows = np.empty(len(lines), dtype)
    faults = {}
    for k, line in enumerate(lines):
        check_line(line)
        cells, wrong = split(line, dialect.separator), ""
        if len(cells) != len(texts):
            wrong = f"expected {len(texts)} columns, got {len(cells)}"
            cells = (cells + [""] * len(texts))[: len(texts)]
        row: list[Any] = []
        for cell, is_text, head in zip(cells, texts, dialect.heads, strict=True):
            row.append(cell if is_text else _number(cell, dialect.decimal_comma))
            if row[-1] is None:
                row[-1] = np.nan
                expected = f"expected a number in {head!r}{marks_within(cell)}"
                wrong = wrong or ("" if is_missing(cell) else f"{expected}, got {cell!r}")
        rows[k] = tuple(row)
        if wrong and tuple(cell.strip() for cell in cells) == tuple(head.strip() for head in dialect.heads):
            wrong = (
                "expected numbers, got the heads again, as where tables were put one behind the other; remove that line"
            )
        if wrong:
            faults[k] = wrong
    return rows, faults


def try_rows(lines: Iterable[str], dialect: Dialect, dtype: np.dtype[Any]) -> Any:
    """Return lines parsed by NumPy, texts stripped; None if a line differs from the others."""
    try:
        rows = np.loadtxt(lines, dtype, comments=None, delimiter=dialect.separator, quotechar='"', ndmin=1)
    except ValueError:
        return None
    for name in dtype.names or ():
        if dtype[name].kind == "O":
            rows[name] = [cell.strip() for cell in rows[name].tolist()]
    return rows


def quotes_are_plain(text: bytes, dialect: Dialect) -> bool:
    """Tell whether all quotes enclose whole cells within one line, which all parsers read in the same way."""
    if dialect.separator is None:
        return False
    marks = np.frombuffer(b"\n" + text + b"\n", np.uint8)
    quotes, ends = np.flatnonzero(marks == ord('"')), np.flatnonzero((marks == ord("\n")) | (marks == ord("\r")))
    if len(quotes) % 2:
        return False
    first, last = quotes[::2], quotes[1::2]
    beside = np.concatenate((marks[first - 1], marks[last + 1]))
    in_one_line = np.searchsorted(ends, first) == np.searchsorted(ends, last)
    return bool(np.isin(beside, [*b"\r\n", ord(dialect.separator)]).all() and in_one_line.all())


def _number(cell: str, comma: bool) -> float | None:
    if "_" in cell:  # Python parses 1_000 as a number; tables do not write that
        return None
    try:
        return as_float(cell.replace(",", ".") if comma else cell)
    except ValueError:
        return None
