"""Tables of labels beside a long recording: which row, head and unit means what."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

from kineme.errors import DataError
from kineme.io.annotations.audacity import UNKNOWN
from kineme.movements.tables.time_stamps import TIME_UNITS
from kineme.reporting.text import text_in
from kineme.units import UNITS, converted, split_head, unit_named

_TIMES = "|".join(sorted(map(re.escape, TIME_UNITS), key=len, reverse=True))
_UNIT = rf"(\b|_({_TIMES})$)"
_START = re.compile(rf"(start|begin|onset|from){_UNIT}|(start|begin)[ _]?time")
_END = re.compile(rf"(end|stop|offset|to){_UNIT}|(end|stop)[ _]?time")
_LAST_WORD = re.compile(rf"(?<![.a-zµμ])({_TIMES})\W*$")  # that of hh:mm:ss.ms says how a clock is written
_COUNTED = re.compile(r"\b(frame|sample|index|idx|row)s?\b")  # what is no time without a rate
_LABELS = frozenset(
    {
        "label", "labels", "symbol", "annotation", "annotations", "value", "text", "name", "class", "action", "gesture",
        "activity", "category", "behavior", "event",
    }
)  # fmt: skip
_RECORDINGS, _PLACES = frozenset({"recording", "file", "path"}), frozenset({"place"})
_CLOCK = re.compile(r"(?:(\d+):)?(\d+):(\d+(?:[.,]\d+)?)")
_NOTHING = frozenset({"", "-", "?", UNKNOWN, "none", "nan", "null"})  # labels that say that there is none


class LabelRow(NamedTuple):
    """A row of a table of labels.

    Attributes
    ----------
    start, end : float
        In seconds.
    label : str or None
    recording, place : str
        Which recording, and which movement of it; empty where the table does not say.
    line : int
        Row of the table, from 1.
    """

    start: float
    end: float
    label: str | None
    recording: str
    place: str
    line: int


class Heads(NamedTuple):
    """Columns of a table of labels by their roles, the units of start and end, and whether ELAN wrote the heads."""

    start: int
    end: int
    label: int
    recording: int | None
    place: int | None
    units: tuple[str, str]
    of_elan: bool


def heads_of(cells: Sequence[str]) -> Heads | None:
    """The roles of the columns of a table with these heads; None if they are none.

    Raises
    ------
    DataError
        No column of labels; or a start and an end in another unit than of time, as frames.
    """
    names = [cell.strip().strip('"#').strip().lower() for cell in cells]
    either = [[k for k, one in enumerate(names) if wanted.match(one)] for wanted in (_START, _END)]
    starts, ends = ([k for k in some if _is_time(names[k])] for some in either)
    if all(either) and not (starts and ends):
        odd = next(k for some in either for k in some if not _is_time(names[k]))
        raise DataError(
            f"expected start and end in a unit of time (s, ms, us, ns, min, h), got {cells[odd].strip()!r}; divide "
            "frames or samples by the rate, and name the unit in brackets"
        )
    if not starts or not ends:
        return None
    start, end = (min(some, key=lambda k: "hh:mm" in names[k]) for some in (starts, ends))
    known = [k for k, one in enumerate(names) if one in _LABELS]
    others = [k for k, one in enumerate(names) if k not in {*starts, *ends} and not one.startswith("duration")]
    aside = _RECORDINGS | _PLACES
    labels = known or [k for k in others if names[k] and names[k] not in aside]
    if len(labels) != 1 and not known:
        raise DataError(f"expected one column of labels beside start and end, got {list(cells)}; call it label")
    return Heads(
        start,
        end,
        labels[0],
        next((k for k, one in enumerate(names) if one in _RECORDINGS), None),
        next((k for k, one in enumerate(names) if one in _PLACES), None),
        (_unit_of(names[start]), _unit_of(names[end])),
        "time - " in names[start],
    )


def _is_time(name: str) -> bool:
    """Whether a head of a start or an end says no other unit than of time."""
    unit = unit_named(split_head(name)[1] or "")
    return _COUNTED.search(name) is None if unit is None else unit.quantity == "time"


def _unit_of(name: str) -> str:
    """The unit of the times below a head in lower case: in brackets, or its last word; else seconds."""
    unit, word = unit_named(split_head(name)[1] or ""), _LAST_WORD.search(name)
    if unit is not None and unit.quantity == "time":
        return unit.symbol
    return word[1] if word else "s"


def heads_of_cells(cells: Sequence[str]) -> Heads | None:
    """The roles of the columns of a table without heads, start, end and label in this order; None if they are none."""
    clocks = [k for k, cell in enumerate(cells) if ":" in cell and seconds_of(cell) is not None]
    numbers = [k for k, cell in enumerate(cells[:-1]) if ":" not in cell and seconds_of(cell) is not None]
    times = clocks if len(clocks) > 1 else numbers
    return Heads(times[0], times[1], len(cells) - 1, None, None, ("s", "s"), True) if len(times) > 1 else None


def row_of(cells: Sequence[str], heads: Heads, line: int) -> LabelRow:
    """A row as a record.

    Raises
    ------
    DataError
        Times that are none, or an end before the start; the message names the line.
    """
    if len(cells) <= max(heads.start, heads.end, heads.label):
        raise DataError(f"line {line}: expected start, end and label, got {list(cells)}")
    start, end = (_time_in(cells[k], unit) for k, unit in zip((heads.start, heads.end), heads.units, strict=True))
    if not end > start:
        raise DataError(
            f"line {line}: expected a start and an end after it, got {cells[heads.start]!r} and {cells[heads.end]!r}"
        )
    recording, place = (
        "" if k is None or k >= len(cells) else text_in(cells[k].strip()) for k in (heads.recording, heads.place)
    )
    label = text_in(cells[heads.label].strip())
    return LabelRow(start, end, None if label.lower() in _NOTHING else label, recording, place, line)


def _time_in(cell: str, unit: str) -> float:
    """Seconds of a cell in a unit of time; of mm:ss.sss whatever the unit is; NaN of what is none."""
    time = seconds_of(cell)
    if time is None:
        return math.nan
    return time if ":" in cell else float(converted(time, UNITS[unit], UNITS["s"]))


def seconds_of(cell: str) -> float | None:
    """A time as seconds or as hh:mm:ss.sss; None if it is neither."""
    text = cell.strip()
    if clock := _CLOCK.fullmatch(text):
        hours, minutes, seconds = clock.groups()
        return 3600.0 * int(hours or 0) + 60.0 * int(minutes) + float(seconds.replace(",", "."))
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        return None
    return value if math.isfinite(value) else None
