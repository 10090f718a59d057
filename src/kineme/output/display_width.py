"""Text measured and cut by the columns that it takes on a terminal."""

from __future__ import annotations

from unicodedata import category, east_asian_width


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
    for word in (fitted(one, width) for one in text.split()):
        if lines and width_of(lines[-1]) + 1 + width_of(word) <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines or [""]


def widest_word(text: str) -> int:
    """Columns of the widest word."""
    return max(map(width_of, text.split()), default=0)


def _beginning(text: str, width: int) -> str:
    """As many characters as fit."""
    used = 0
    for k, mark in enumerate(text):
        used += _columns(mark)
        if used > width:
            return text[:k]
    return text


def _columns(mark: str) -> int:
    if category(mark) in {"Mn", "Me"}:
        return 0
    return 2 if east_asian_width(mark) in {"W", "F"} else 1
