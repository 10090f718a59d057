r"""Names from files and libraries, made fit to be shown: on a terminal, in a drawing, in HTML.

A terminal obeys control characters, a reader is misled by characters that turn the direction of writing or cannot be
seen, and XML allows no control characters at all. All are written out, as ``\x1b`` or ``\u202e``. A file may also hold
a name of a million characters: of those that are longer than anybody reads, beginning and end are shown.
"""

from __future__ import annotations

from html import escape
from typing import Any

#: Letters and marks of no ink and no width, or as wide as a blank, which Unicode does not count as such.
_UNSEEN = frozenset("\u034f\u115f\u1160\u17b4\u17b5\u2800\u3164\uffa0")


#: Characters of a name, and of one in a column of a table, that are shown.
_LONGEST, LONGEST_CELL = 4000, 120


def printable(name: Any) -> str:
    """A name on one line, with everything that does not show itself written out; a blank stays a blank."""
    return _shown(shortened(str(name), _LONGEST))


def shortened(text: str, longest: int) -> str:
    """Two thirds of it from the beginning and one third from the end, where it is longer than `longest`."""
    if len(text) <= longest:
        return text
    end = longest // 3
    return f"{text[: longest - end - 1]}…{text[-end:]}"


def _shown(text: str) -> str:
    if text.isprintable() and _UNSEEN.isdisjoint(text):
        return text
    return "".join(mark if mark.isprintable() and mark not in _UNSEEN else _written_out(mark) for mark in text)


def printable_lines(text: Any) -> str:
    """As `printable`, for text of several lines."""
    return "\n".join(map(_shown, str(text).split("\n")))


def drawable(name: Any) -> str:
    """As `printable`, for Matplotlib, which takes what stands between dollars for a formula."""
    return printable(name).replace("$", r"\$")


def in_markup(text: Any) -> str:
    """As `printable_lines`, for HTML and XML."""
    return escape(printable_lines(text))


def counted(number: int, noun: str) -> str:
    """A number and its noun: ``1 movement``, ``2 movements``."""
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def _written_out(mark: str) -> str:
    return mark.encode("unicode_escape").decode("ascii")
