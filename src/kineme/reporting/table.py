"""A table as data, written as text for the terminal, as HTML for reports and notebooks, and as a data frame."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import zip_longest
from shutil import get_terminal_size
from textwrap import fill
from typing import Any, NamedTuple
from unicodedata import category, east_asian_width

from kineme.errors import DataError
from kineme.reporting.text import LONGEST_CELL, in_markup, printable, printable_lines, shortened

_PIPED = 160  # columns of a table that is not on a terminal, beyond which its last column is wrapped
_GAP = 2  # blanks between columns
_NARROW = 12  # columns below which no word is shortened


class Table(NamedTuple):
    """A title, column heads, rows of text with the row's name first, and the text below the table.

    `pictures` are markup, of `thumbnail` or empty, that stands before the first rows in HTML.
    """

    title: str
    columns: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    reading: str = ""
    pictures: Sequence[str] = ()


def to_text(table: Table, width: int | None = None) -> str:
    """Columns aligned for a terminal, by default of its width.

    What does not fit is wrapped, widest columns first; words that are wider than their column lose their middle. Where
    not even that leaves a few letters to each, every row becomes a list. Where the output goes elsewhere, only names of
    more than 120 letters are cut, and only the last column is wrapped.
    """
    # A column is as wide as its widest cell: one long name would hide the other columns.
    lines = [
        (*(shortened(printable(cell), LONGEST_CELL) for cell in row[:-1]), printable(row[-1]))
        for row in (table.columns, *table.rows)
    ]
    natural = [max(width_of(row[k]) for row in lines) for k in range(len(table.columns))]
    columns = (get_terminal_size().columns if sys.stdout.isatty() else None) if width is None else width
    title = printable_lines(table.title)
    if columns is None:
        # The last column is as wide as what is left.
        widths: list[int] | None = [
            *natural[:-1],
            max(24, min(natural[-1], _PIPED - sum(natural[:-1]) - 2 * len(natural))),
        ]
        reading = fill(printable_lines(table.reading), 110)
    else:
        title = "\n".join("\n".join(wrapped(line, columns)) for line in title.split("\n"))
        reading = fill(printable_lines(table.reading), min(columns, 110))
        widths = _narrowed(lines, natural, columns - _GAP * (len(natural) - 1))
    if widths is None:
        return "\n".join(filter(None, [title, *_as_lists(lines, columns or _PIPED), reading]))
    rendered = [_aligned(row, widths) for row in lines]
    rule = "-" * max(width_of(line) for row in rendered for line in row)
    body = [line for row in rendered[1:] for line in row]
    return "\n".join(filter(None, [title, rule, *rendered[0], rule, *body, reading]))


def _narrowed(lines: Sequence[tuple[str, ...]], natural: list[int], width: int) -> list[int] | None:
    """Widths that sum up to `width` at most, widest columns narrowed first; None where columns would get too narrow."""
    words = [max((width_of(word) for row in lines for word in row[k].split()), default=0) for k in range(len(natural))]
    for least in (words, [min(word, _NARROW) for word in words]):
        if sum(least) <= width:
            limit = next(
                n
                for n in range(max(natural), 0, -1)
                if sum(max(low, min(column, n)) for column, low in zip(natural, least, strict=True)) <= width
            )
            widths = [max(low, min(column, limit)) for column, low in zip(natural, least, strict=True)]
            for k in range(len(widths)):  # what is left over by whole columns
                widths[k] += max(0, min(natural[k] - widths[k], width - sum(widths)))
            return widths
    return None


def _aligned(row: tuple[str, ...], widths: list[int]) -> list[str]:
    cells = [
        [cell] if width_of(cell) <= width else wrapped(cell, width) for cell, width in zip(row, widths, strict=True)
    ]
    lines = zip_longest(*cells, fillvalue="")
    gap = " " * _GAP
    return [gap.join(padded(cell, width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines]


def _as_lists(lines: Sequence[tuple[str, ...]], width: int) -> list[str]:
    heads, *rows = lines
    listed: list[str] = []
    for row in rows:
        listed.append("-" * width)
        for head, cell in zip(heads, row, strict=True):
            listed += wrapped(f"{head}: {cell}" if head else cell, width)
    return listed


def to_html(table: Table) -> str:
    """A table element with caption."""
    head = "<td></td>" * bool(table.pictures)
    head += "".join(f'<th scope="col">{in_markup(cell)}</th>' for cell in table.columns)
    cells = ["".join(f"<td>{in_markup(cell)}</td>" for cell in row[1:]) for row in table.rows]
    before = [f"<td>{drawing}</td>" for drawing in table.pictures]
    before += ["<td></td>" * bool(before)] * (len(table.rows) - len(before))
    rows = zip(before, table.rows, cells, strict=True)
    body = "".join(f'<tr>{first}<th scope="row">{in_markup(row[0])}</th>{others}</tr>' for first, row, others in rows)
    reading = f"<p>{in_markup(table.reading)}</p>" if table.reading else ""
    return (
        f"<figure><table><caption>{in_markup(table.title)}</caption><thead><tr>{head}</tr></thead>"
        f"<tbody>{body}</tbody></table>{reading}</figure>"
    )


def data_frame(columns: Mapping[str, Any]) -> Any:
    """Columns as a data frame of pandas."""
    try:
        import pandas as pd
    except ImportError as error:
        raise DataError("expected the package pandas for a data frame; pip install pandas") from error
    return pd.DataFrame(columns)


def width_of(text: str) -> int:
    """Columns that a line takes: two for East Asian wide characters and emoji, none for marks that combine."""
    return len(text) if text.isascii() else sum(map(_columns, text))


def padded(text: str, width: int) -> str:
    """The text with blanks after it up to a width."""
    return text + " " * (width - width_of(text))


def fitted(text: str, width: int) -> str:
    """The text; of one wider than `width`, its beginning and its end, with an ellipsis between."""
    if width_of(text) <= width:
        return text
    end = (width - 1) // 2
    return f"{_beginning(text, width - 1 - end)}…{_beginning(text[::-1], end)[::-1]}"


def wrapped(text: str, width: int) -> list[str]:
    """Lines of at most `width` columns, cut at blanks; words that are wider are shortened."""
    lines: list[str] = []
    for word in (fitted(word_of_text, width) for word_of_text in text.split()):
        if lines and width_of(lines[-1]) + 1 + width_of(word) <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines or [""]


def _beginning(text: str, width: int) -> str:
    """Cut a text to as many characters as fit."""
    used = 0
    for k, mark in enumerate(text):
        used += _columns(mark)
        if used > width:
            return text[:k]
    return text


@lru_cache(maxsize=4096)
def _columns(mark: str) -> int:
    if category(mark) in {"Mn", "Me"}:
        return 0
    return 2 if east_asian_width(mark) in {"W", "F"} else 1
