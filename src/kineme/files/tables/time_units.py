"""The unit of time stamps: from the column's head, from their size, or given by the caller."""

from __future__ import annotations

import re
from functools import lru_cache

import numpy as np

from kineme.validation import Array

#: Unit -> number per second.
UNITS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}

_ALSO = {
    "s": "sec secs second seconds",
    "ms": "msec msecs millis millisecond milliseconds",
    "us": "µs μs usec usecs micros microsecond microseconds",
    "ns": "nsec nsecs nanos nanosecond nanoseconds",
}
_NAMES = {name: unit for unit, names in _ALSO.items() for name in (unit, *names.split())}

#: Every name of a unit -> number per second.
PER_SECOND = {name: UNITS[unit] for name, unit in _NAMES.items()}

_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-zµμ]+|\d+|[^\W\d_]+")  # camelCase, snake_case, [units] apart

_UNIX = (946_684_800.0, 4_102_444_800.0)  # the years 2000 to 2100, in seconds since 1970

#: Shortest step between samples, in units of the stamps, at which they are taken to be in that unit. Movements are not
#: sampled every 5 s or more slowly; steps of 5 ms to 1 s, 1 ms to 1 s, and from 1 ms on are usual.
_STEPS = (("ns", 1e6), ("us", 1e3), ("ms", 5.0))


#: Sources of a unit that are guesses.
GUESSED = ("since 1970", "by its steps", "assumed")


@lru_cache(maxsize=256)  # thousands of files have the same heads
def words_of(head: str) -> tuple[str, ...]:
    """The words in a column's head, in lower case: ``"timeStamp [ms]"`` is time, stamp, ms."""
    return tuple(word.lower() for word in _WORDS.findall(head))


def unit_in_head(head: str) -> str | None:
    """The unit of time that a column's head ends in, if it names one."""
    words = words_of(head)
    return _NAMES.get(words[-1]) if words else None


def unit_by_size(stamps: Array) -> tuple[str, str]:
    """The unit of stamps (total,), and the source of that knowledge.

    Stamps that are dates between 2000 and 2100 in some unit are seconds since 1970 in that unit. Otherwise the median
    step decides, because people and robots are sampled between once and some thousand times a second.
    """
    finite = stamps[np.isfinite(stamps)]
    if len(finite) == 0:
        return "s", "assumed"
    for unit, per_second in UNITS.items():
        if _UNIX[0] <= finite[0] / per_second <= _UNIX[1]:
            return unit, "since 1970"
    steps = np.abs(np.diff(finite))
    steps = steps[steps > 0]
    step = float(np.median(steps)) if len(steps) else 0.0
    found = next((unit for unit, least in _STEPS if step >= least), None)
    return (found, "by its steps") if found else ("s", "assumed")


def in_seconds(stamps: Array, units: str | float) -> Array:
    """Stamps (total,) of a unit in seconds; by division, so that 100 ms are exactly the float 0.1."""
    return stamps / PER_SECOND[units] if isinstance(units, str) else stamps * float(units)
