"""Time stamps: their unit, from the column's head, from their size, or given by the caller; and dates."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.units import UNITS, converted, split_head, unit_named
from kineme.validation import Array

#: Units of stamps whose unit nobody says -> number per second.
PER_SECOND = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}

#: Names of units of time within words, as in ``elapsed_ms``; these are too often something else there: t_min, h.
TIME_UNITS = frozenset(name for name, unit in UNITS.items() if unit.quantity == "time") - {"min", "h"}

#: Words of camelCase, snake_case and [units] apart, but mSec and elapsed_mS are units; uS alone may be of conductance.
_WORDS = re.compile(
    r"(?:(?<![^\W\d_])[mnuµμ]|[MNU])Secs?(?![a-z])|(?<=[\W_])[mnuµμ]S(?![A-Za-z])|"
    r"[A-Z]+(?![a-z])|[A-Z]?[a-zµμ]+|\d+|[^\W\d_]+"
)

#: The years 2000 to 2100, in seconds since 1970.
UNIX = (946_684_800.0, 4_102_444_800.0)

#: Shortest step between samples, in units of the stamps, at which they are taken to be in that unit. Movements are not
#: sampled every 5 s or more slowly; steps of 5 ms to 1 s, 1 ms to 1 s, and from 1 ms on are usual.
_STEPS = (("ns", 1e6), ("us", 1e3), ("ms", 5.0))
_LONGEST = 5.0  # s between samples
#: Days to the year 2000 from where Windows and .NET begin to count 100 ns.
_TICKS_SINCE = {"since 1601": 145_731, "since the year 1": 730_119}
_CENTURY, _TICKS_A_DAY, _TICKS_A_SECOND = 36_525, 864e9, 1e7
_TICK_WORDS = frozenset({"tick", "ticks"})
_SLOW_IN_US = 2e5  # five samples a second, or fifty if they are ticks of 100 ns, as a camera with depth writes them
_DATE_WORDS = frozenset({"unix", "epoch", "utc"})
_DRIFT = 1e-4  # of the time that passed, between two clocks of one device
_RATE, _STEPS_APART = 1e-3, 3  # of the time that passed, and steps, by which clocks of one rate differ in the end
_RUNNING = 0.9  # of the steps of a clock, at least, go forward

_DATE = re.compile(r"\d{4}([-/])\d\d\1\d\d[T ]\d\d:\d\d(:\d\d([.,]\d+)?)?\s?(Z|[-+]\d\d:?\d\d)?")
_CLOCK = r"(?P<h>\d{1,3}):(?P<m>[0-5]\d):(?P<s>[0-5]\d([.,]\d+)?)"
#: A time of day, a duration as pandas writes it, and one after ISO 8601.
_DURATIONS = (
    re.compile(rf"((?P<d>-?\d+) days? ?\+?)?{_CLOCK}"),
    re.compile(r"P(?P<d>-?\d+)DT(?P<h>\d+)H(?P<m>\d+)M(?P<s>\d+([.,]\d+)?)S"),
    re.compile(r"(?P<d>-?\d+) days?"),
    re.compile(r"(?P<m>\d{1,3}):(?P<s>[0-5]\d[.,]\d+)"),  # without a fraction these may be hours
)
#: A time of day in halves, alone or after a date that begins with the year: 10:15:03.250 PM.
_HALF_DAYS = re.compile(
    r"(?P<date>\d{4}([-/])\d\d\2\d\d[T ])?(?P<h>0?[1-9]|1[0-2])(?P<rest>:[0-5]\d:[0-5]\d([.,]\d+)?)\s?(?P<half>[AP])M",
    re.I,
)
_HOUR, _DAY = 3600.0, 86400.0

#: Sources of a unit that are guesses.
GUESSED = ("since 1970", *_TICKS_SINCE, "by its steps", "assumed")


@lru_cache(maxsize=256)  # thousands of files have the same heads
def words_of(head: str) -> tuple[str, ...]:
    """The words in a column's head, in lower case: ``"timeStamp [ms]"`` is time, stamp, ms."""
    return tuple(word.lower() for word in _WORDS.findall(head))


def unit_in_head(head: str) -> str | None:
    """The unit of time that a column's head names, in brackets or as its last word that is one; s only at its end."""
    (_, bracketed), words = split_head(head), words_of(head)
    if (unit := unit_named(bracketed or "")) is not None and unit.quantity == "time":
        return unit.symbol
    last = len(words) - 1
    k = next((k for k in range(last, -1, -1) if words[k] in TIME_UNITS and (k == last or words[k] != "s")), None)
    if k is None:
        return None
    return "100ns" if words[max(k - 1, 0) : k + 1] == ("100", "ns") else UNITS[words[k]].symbol


def unit_by_size(stamps: Array, head: str = "") -> tuple[str, str]:
    """The unit of stamps (total,) below a head that does not say it, and the source of that knowledge.

    Stamps between the years 2000 and 2100 count from 1970 in the unit of which that is so, unless it makes the step
    longer than 5 s, as of a machine that was switched on weeks ago; so do those of such years in 100 ns since 1601 or
    since the year 1, as Windows and .NET count. Of others the median step decides.

    Refused are such stamps with a step of 1 to 5 s, which may as well be 1 to 5 thousandths of it (a head with a word
    as unix decides); ticks that count from elsewhere; and steps of 200,000 to a million, or relative times in
    thousands: microseconds of a slow clock, or 100 ns of a fast one.
    """
    finite = stamps[np.isfinite(stamps)]
    if len(finite) == 0:
        return "s", "assumed"
    steps = np.abs(np.diff(finite))
    steps = steps[steps > 0]
    step = float(np.median(steps)) if len(steps) else 0.0
    of_date = {*words_of(head)} & _DATE_WORDS
    for (unit, per_second), finer in zip(PER_SECOND.items(), [*PER_SECOND, ""][1:], strict=True):
        if not UNIX[0] <= finite[0] / per_second <= UNIX[1] or (step / per_second >= _LONGEST and not of_date):
            continue
        if finer and step / per_second >= 1.0 and not of_date:
            raise DataError(
                f"expected times whose unit can be told, got {finite[0]:.10g} and so on in steps of {step:.6g}, which "
                f"are {unit} since 1970 or {finer} since another time; say units='{unit}' or '{finer}', "
                "in the shell --units"
            )
        return unit, "since 1970"
    for since, days in _TICKS_SINCE.items():
        if days <= finite[0] / _TICKS_A_DAY <= days + _CENTURY and step / _TICKS_A_SECOND < _LONGEST:
            return "100ns", since
    by_step = next((unit for unit, least in _STEPS if step >= least), None)
    may_be_ticks = by_step == "us" and ("relative" in words_of(head) or step >= _SLOW_IN_US)
    if (of_ticks := {*words_of(head)} & _TICK_WORDS) or may_be_ticks:
        us = "" if of_ticks else "'us', "
        raise DataError(
            f"expected times whose unit can be told, got {head!r} in steps of {step:.6g}; say how long one is, as "
            f"units={us}'100ns' or a number of seconds, in the shell --units"
        )
    return (by_step, "by its steps") if by_step else ("s", "assumed")


def same_clock(times: Array, others: Array) -> bool:
    """Tell whether two columns of times [s] (total,) show the same clock: they run alike but for half a step."""
    both = np.isfinite(times) & np.isfinite(others)
    a, b = (each[both] - each[both][:1] for each in (times, others))
    step = float(np.median(np.abs(np.diff(a)))) if len(a) > 1 else 0.0
    return bool((np.abs(a - b) <= 0.5 * step + _DRIFT * np.abs(a)).all())


def same_rate(times: Array, others: Array) -> bool:
    """Tell whether two columns of times [s] (total,) run alike but for a few steps; true of one that often stands.

    Steps back, as where another movement begins, and missing stamps do not count.
    """
    both = np.isfinite(times) & np.isfinite(others)
    a, b = (np.diff(each[both]) for each in (times, others))
    if not len(b) or np.mean(b > 0) < _RUNNING:
        return True
    on = (a >= 0) & (b >= 0)
    passed, n_steps = float(a[on].sum()), max(1, int(np.count_nonzero(on)))
    return abs(passed - float(b[on].sum())) <= (_STEPS_APART / n_steps + _RATE) * passed


def in_seconds(stamps: Array, units: str | float) -> Array:
    """Stamps (total,) of a unit in seconds; by division, so that 100 ms are exactly the float 0.1."""
    if isinstance(units, str):
        return np.asarray(converted(stamps, UNITS[units], UNITS["s"]))
    return stamps * float(units)


def is_date(cell: str) -> bool:
    """Tell whether a cell reads as a date with a time of day, after ISO 8601, as a time of day, or as a duration."""
    cell = _in_whole_days(cell)
    return _DATE.fullmatch(cell) is not None or _duration(cell) is not None


def seconds_of_dates(cells: Sequence[str]) -> tuple[Array, dict[int, str]]:
    """Seconds, NaN where a cell is no date, time of day or duration; and row -> that cell.

    Of dates they count from 1970, to the microsecond; no zone is UTC. Where times of day pass midnight, they go on.
    Times with AM and PM are understood. Dates begin with the year: of others nobody knows which number is the month.
    """
    seconds, others = np.full(len(cells), np.nan), {}
    for row, cell in enumerate(cells):
        text = _in_whole_days(cell.strip())
        if (duration := _duration(text)) is not None:
            seconds[row] = duration
            continue
        try:
            date = datetime.fromisoformat(text.replace("/", "-"))
            seconds[row] = (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()
        except (ValueError, OverflowError):
            others[row] = cell
    late, early = seconds[:-1] >= _DAY - _HOUR, seconds[1:] < _HOUR
    if (midnights := late & early & (seconds[:-1] < _DAY)).any():
        seconds[1:] += _DAY * np.cumsum(midnights)
    return seconds, others


def _in_whole_days(cell: str) -> str:
    """A time of day in halves, 10:15:03 PM, as 22:15:03; anything else as it is."""
    match = _HALF_DAYS.fullmatch(cell)
    if match is None:
        return cell
    hour = int(match["h"]) % 12 + 12 * (match["half"] in "Pp")
    return f"{match['date'] or ''}{hour:02d}{match['rest']}"


def _duration(cell: str) -> float | None:
    """The seconds of a time of day or of a duration: ``12:30:01.5``, ``0 days 00:00:00.01``, ``P0DT0H0M0.01S``."""
    match = next(filter(None, (pattern.fullmatch(cell) for pattern in _DURATIONS)), None)
    if match is None:
        return None
    parts = match.groupdict()
    days, hours, minutes = (float(parts.get(name) or 0) for name in "dhm")
    return days * _DAY + hours * _HOUR + minutes * 60.0 + float((parts.get("s") or "0").replace(",", "."))


def nanoseconds(stamps: NDArray[Any]) -> Array:
    """Dates or durations (datetime64 or timedelta64 of any unit) as nanoseconds, NaN for missing ones."""
    missing = np.isnat(stamps)
    try:  # NumPy before 2.5 would wrap dates out of the range around silently
        counts = stamps.astype(f"{stamps.dtype.kind}8[ns]")
        counted = bool(((counts.astype(stamps.dtype) == stamps) | missing).all())
    except OverflowError:
        counted = False
    if not counted:
        present = stamps[~missing]
        farthest = present[np.abs(present.astype(np.int64).astype(np.float64)).argmax()]
        raise DataError(f"expected dates from 1678 to 2262 or durations of that size, got {farthest}")
    return np.where(missing, np.nan, counts.astype(np.int64))
