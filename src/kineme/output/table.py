"""A table as data, written as text for the terminal and as HTML for the report."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean
from textwrap import fill, wrap
from typing import NamedTuple

from kineme.output.text import LONGEST_CELL, in_markup, printable, printable_lines, shortened


class Table(NamedTuple):
    """A title, column heads, rows of text with the row's name first, and the text below the table."""

    title: str
    columns: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    reading: str = ""


def mean_and_range(values: Sequence[float]) -> str:
    """Mean and range over draws, as ``0.954 (0.89-1.00)``."""
    return f"{fmean(values):.3f} ({min(values):.2f}-{max(values):.2f})"


def to_text(table: Table, width: int = 160) -> str:
    """Columns aligned for a terminal; the last one is wrapped to stay within `width`."""
    lines = [(*(_cell(one) for one in row[:-1]), printable(row[-1])) for row in (table.columns, *table.rows)]
    widths = [max(len(row[k]) for row in lines) for k in range(len(table.columns))]
    widths[-1] = max(24, min(widths[-1], width - sum(widths[:-1]) - 2 * len(widths)))
    rendered = [line for row in lines for line in _wrapped(row, widths)]
    rule = "-" * max(map(len, rendered))
    title, reading = printable_lines(table.title), fill(printable_lines(table.reading), 110)
    return "\n".join(filter(None, [title, rule, rendered[0], rule, *rendered[1:], reading]))


def _cell(text: str) -> str:
    """A cell, shortened: a column is as wide as its widest cell, and one long name would hide the other columns."""
    return shortened(printable(text), LONGEST_CELL)


def _wrapped(row: tuple[str, ...], widths: list[int]) -> list[str]:
    first, *more = wrap(row[-1], widths[-1]) or [""]
    head = "  ".join(cell.ljust(size) for cell, size in zip(row[:-1], widths, strict=False))
    return [f"{head}  {first}".rstrip(), *(f"{'':{len(head)}}  {line}" for line in more)]


def to_html(table: Table) -> str:
    """A table element with caption."""
    head = "".join(f'<th scope="col">{in_markup(cell)}</th>' for cell in table.columns)
    body = "".join(
        f'<tr><th scope="row">{in_markup(row[0])}</th>'
        + "".join(f"<td>{in_markup(cell)}</td>" for cell in row[1:])
        + "</tr>"
        for row in table.rows
    )
    reading = f"<p>{in_markup(table.reading)}</p>" if table.reading else ""
    return (
        f"<figure><table><caption>{in_markup(table.title)}</caption><thead><tr>{head}</tr></thead>"
        f"<tbody>{body}</tbody></table>{reading}</figure>"
    )
