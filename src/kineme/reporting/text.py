r"""Escape names from files and libraries before they are shown on a terminal, in a figure or in HTML.

Control characters steer a terminal, bidirectional and invisible characters mislead readers, and XML allows no control
characters at all. All of them are escaped, as ``\x1b`` or ``\u202e``. Very long names are shortened in the middle.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape
from typing import Any

#: Characters that are invisible or look like a blank, although `str.isprintable` is true of them.
_INVISIBLE = frozenset("\u034f\u115f\u1160\u17b4\u17b5\u2800\u3164\uffa0")

_FORMULA = re.compile(r"'*[=+\-@\t\r]")  # what makes a cell a formula, also behind quotes that `as_cell` wrote

#: Longest text that is shown whole: anywhere, and in a column of a table.
_LONGEST, LONGEST_CELL = 4000, 120


def as_cell(text: str) -> str:
    """A text as a cell of a CSV file that a spreadsheet takes for text: no formula, whatever it begins with."""
    return f"'{text}" if _FORMULA.match(text) else text


def text_in(cell: str) -> str:
    """The inverse of `as_cell`."""
    return cell[1:] if cell.startswith("'") and _FORMULA.match(cell) else cell


def printable(name: Any) -> str:
    """A name on one line, with control and invisible characters escaped; blanks stay."""
    return _escape(shortened(str(name), _LONGEST))


def shortened(text: str, longest: int) -> str:
    """The text; of one longer than `longest`, two thirds from the beginning and one third from the end."""
    if len(text) <= longest:
        return text
    end = longest // 3
    return f"{text[: longest - end - 1]}…{text[-end:]}"


def _escape(text: str) -> str:
    if text.isprintable() and _INVISIBLE.isdisjoint(text):
        return text
    return "".join(
        mark if mark.isprintable() and mark not in _INVISIBLE else mark.encode("unicode_escape").decode("ascii")
        for mark in text
    )


def printable_lines(text: Any) -> str:
    """Make text of several lines printable, see `printable`."""
    return "\n".join(map(_escape, str(text).split("\n")))


def drawable(name: Any) -> str:
    """Make text printable for Matplotlib: dollar signs are escaped too, since they would start a formula."""
    return printable(name).replace("$", r"\$")


def in_markup(text: Any) -> str:
    """Escape printable lines for HTML and XML."""
    return escape(printable_lines(text))


def counted(number: int, noun: str, plural: str | None = None) -> str:
    """A number and its noun: ``1 movement``, ``2 movements``."""
    return f"{number:,} {noun if number == 1 else plural or noun + 's'}"


def first_names(names: Sequence[Any], most: int) -> str:
    """The first names of many, and how many more there are: ``a, b and 3 more``."""
    return ", ".join(map(str, names[:most])) + (f" and {len(names) - most} more" if len(names) > most else "")
