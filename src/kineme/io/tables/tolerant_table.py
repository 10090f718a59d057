"""Text tables with irregular lines: regular stretches are read by NumPy's parser, the other lines one by one."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice
from typing import Any

import numpy as np

from kineme.errors import DataError
from kineme.io.tables.dialect import Dialect, check_line, is_missing, marks_within, split

_STRETCH = 1000  # lines that are parsed at a time
_FAULTS = 2_000_000  # lines with faults, at most: each takes a while and some memory
_EMPTY = 20_000  # lines without any number, after which none is expected


def read_slowly(
    samples: Iterable[tuple[int, str]], dialect: Dialect, dtype: np.dtype[Any]
) -> tuple[Any, dict[int, str]]:
    """All samples, NaN for missing numbers, and row -> what is wrong there; an empty cell or NA is a gap."""
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
        known = not quoted or quotes_are_plain("".join(plain).encode(), dialect)
        if known and (read := try_rows(plain, dialect, dtype)) is not None:
            return read, {}
        if not quoted and not any(texts) and dialect.separator:  # an empty cell is usual
            text = "\n".join(line.rstrip("\r\n") for line in plain)
            if (read := try_rows(_filled(text, dialect.separator).split("\n"), dialect, dtype)) is not None:
                return read, {}
    rows = np.empty(len(lines), dtype)
    faults = {}
    for k, line in enumerate(lines):
        rows[k], wrong = _read_line(line, dialect, texts)
        if wrong:
            faults[k] = wrong
    return rows, faults


def try_rows(lines: Iterable[str], dialect: Dialect, dtype: np.dtype[Any]) -> Any:
    """Lines parsed by NumPy, texts stripped; None if a line differs from the others."""
    try:
        rows = np.loadtxt(lines, dtype, comments=None, delimiter=dialect.separator, quotechar='"', ndmin=1)
    except ValueError:
        return None
    for name in dtype.names or ():
        if dtype[name].kind == "O":
            rows[name] = [cell.strip() for cell in rows[name].tolist()]
    return rows


def quotes_are_plain(text: bytes, dialect: Dialect) -> bool:
    """Whether all quotes enclose whole cells within one line, which all parsers read in the same way."""
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


def _filled(text: str, separator: str) -> str:
    """Lines with nan in their empty cells."""
    empty = separator + separator
    if empty in text:  # twice: of three separators in a row, the first replacement finds one empty cell
        text = text.replace(empty, f"{separator}nan{separator}").replace(empty, f"{separator}nan{separator}")
    text = f"\n{text}\n".replace(f"\n{separator}", f"\nnan{separator}").replace(f"{separator}\n", f"{separator}nan\n")
    return text[1:-1]


def _read_line(line: str, dialect: Dialect, texts: list[bool]) -> tuple[tuple[Any, ...], str]:
    check_line(line)
    cells, wrong = split(line, dialect.separator), ""
    if len(cells) != len(texts):
        wrong = f"expected {len(texts)} columns, got {len(cells)}"
        cells = (cells + [""] * len(texts))[: len(texts)]
    row: list[Any] = []
    for cell, text, head in zip(cells, texts, dialect.heads, strict=True):
        row.append(cell if text else _number(cell, dialect.decimal_comma))
        if row[-1] is None:
            row[-1] = np.nan
            expected = f"expected a number in {head!r}{marks_within(cell)}"
            wrong = wrong or ("" if is_missing(cell) else f"{expected}, got {cell!r}")
    return tuple(row), wrong


def _number(cell: str, comma: bool) -> float | None:
    if "_" in cell:  # Python parses 1_000 as a number; tables do not write that
        return None
    try:
        return float(cell.replace(",", ".") if comma else cell)
    except ValueError:
        return None
