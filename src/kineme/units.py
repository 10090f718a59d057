"""Units of measurement: one table of their sizes and spellings, which everything asks that reads or converts a unit."""

from __future__ import annotations

import re
from collections.abc import Iterator
from fractions import Fraction
from functools import lru_cache
from math import tau
from typing import Any, NamedTuple


class Unit(NamedTuple):
    """A unit of a quantity.

    Its size is counted in meters, radians, seconds, the whole range of a joint; of other quantities in the unit of the
    International System. It is exact but for angles.
    """

    symbol: str  # as the program writes it
    quantity: str  # "length", "angle", "time", ...; of a quotient both, as "angle/time" or "length/time^2"
    size: Fraction | float
    zero: int = 0  # the number that stands for none of the quantity: -100 where a range goes from -100 to 100


#: The units, and their spellings in lower case. Words whose meaning depends on the reader are not among them: Grad is a
#: degree or the 400th part of a turn, g a mass or an acceleration.
_TABLE = (
    (Unit("km", "length", Fraction(1000)), "km kilometer(s)"),
    (Unit("m", "length", Fraction(1)), "m meter(s)"),
    (Unit("dm", "length", Fraction("0.1")), "dm decimeter(s)"),
    (Unit("cm", "length", Fraction("0.01")), "cm centimeter(s)"),
    (Unit("mm", "length", Fraction("0.001")), "mm millimeter(s)"),
    (Unit("um", "length", Fraction("1e-6")), "um µm μm micrometer(s) micron(s)"),
    (Unit("in", "length", Fraction("0.0254")), "in inch inches"),
    (Unit("ft", "length", Fraction("0.3048")), "ft foot feet"),
    (Unit("rad", "angle", 1.0), "rad(s) radian(s)"),
    (Unit("mrad", "angle", 1e-3), "mrad milliradian(s)"),
    (Unit("deg", "angle", tau / 360), "deg(s) degree(s) ° º ˚"),
    (Unit("gon", "angle", tau / 400), "gon gradian(s)"),
    (Unit("rev", "angle", tau), "rev(s) revolution(s) turn(s)"),
    (Unit("s", "time", Fraction(1)), "s sec(s) second(s)"),
    (Unit("ms", "time", Fraction("1e-3")), "ms msec(s) millis millisecond(s)"),
    (Unit("us", "time", Fraction("1e-6")), "us µs μs usec(s) µsec(s) μsec(s) micros microsecond(s)"),
    (Unit("100ns", "time", Fraction("1e-7")), "100ns"),  # of Windows and .NET
    (Unit("ns", "time", Fraction("1e-9")), "ns nsec(s) nanos nanosec(s) nanosecond(s)"),
    (Unit("min", "time", Fraction(60)), "min minute(s)"),
    (Unit("h", "time", Fraction(3600)), "h hour(s)"),
    (Unit("%", "range", Fraction(1, 100)), "% percent pct 0..100 range_0_100"),
    (Unit("-100..100", "range", Fraction(1, 200), -100), "-100..100 ±100 range_m100_100"),
    (Unit("Hz", "frequency", Fraction(1)), "hz hertz"),
    (Unit("kg", "mass", Fraction(1)), "kg kilogram(s)"),
    (Unit("N", "force", Fraction(1)), "n newton(s)"),
    (Unit("Nm", "torque", Fraction(1)), "nm n.m n·m n*m"),
    (Unit("Nmm", "torque", Fraction("1e-3")), "nmm n.mm n·mm n*mm mm.n"),
    (Unit("W", "power", Fraction(1)), "w watt(s)"),
    (Unit("V", "voltage", Fraction(1)), "v volt(s)"),
    (Unit("mV", "voltage", Fraction("1e-3")), "mv millivolt(s)"),
    (Unit("uV", "voltage", Fraction("1e-6")), "uv µv μv microvolt(s)"),
    (Unit("uT", "magnetic flux density", Fraction("1e-6")), "ut µt μt microtesla(s)"),
    (Unit("deg/s", "angle/time", tau / 360), "dps"),
    (Unit("A", "current", Fraction(1)), "a ampere(s) amp(s)"),
    (Unit("mA", "current", Fraction("1e-3")), "ma milliampere(s)"),
    (Unit("px", "image", Fraction(1)), "px pixel(s)"),
    (Unit("count", "count", Fraction(1)), "count(s) tick(s)"),
    (Unit("frame", "frames", Fraction(1)), "frame(s)"),
)


def _spellings(names: str) -> Iterator[str]:
    """Names, also in the plural where an (s) says so, and as the British write them."""
    for name in names.split():
        for spelling in (name, f"{name[:-5]}re(s)") if name.endswith("meter(s)") else (name,):
            singular = spelling.removesuffix("(s)")
            yield from (singular, f"{singular}s") if spelling != singular else (spelling,)


#: Spelling in lower case -> unit.
UNITS = {name: unit for unit, names in _TABLE for name in _spellings(names)}

_BRACKETS = re.compile(r"[\[(]([^\[\]()]*)[\])]\s*$")
_AFTER_NUMBER = re.compile(r"(?<=^100) (?=ns$)")
_QUOTIENT = re.compile(r"(.+?)\s*(?:/|\bper\b)\s*\(?([^/()]+?)\s*(?:\^|\*\*)?([2²])?")


@lru_cache(maxsize=1024)
def unit_named(text: str) -> Unit | None:
    """The unit of a spelling, in any case and also within brackets: ``mm``, ``[Degrees]``, ``deg/s``, ``m/s^2``.

    None of what is no unit of the table, nor a quotient of two of them.
    """
    plain = _AFTER_NUMBER.sub("", text.strip().strip("[]()").strip().lower())
    if (unit := UNITS.get(plain)) is not None or (parts := _QUOTIENT.fullmatch(plain)) is None:
        return unit
    above, below = UNITS.get(parts[1]), UNITS.get(parts[2])
    if above is None or below is None:
        return None
    power, sign = (2, "^2") if parts[3] else (1, "")
    return Unit(
        f"{above.symbol}/{below.symbol}{sign}",
        f"{above.quantity}/{below.quantity}{sign}",
        above.size / below.size**power,
    )


def is_unit_of(text: str | None, quantity: str) -> bool:
    """Tell whether a text spells a unit of this quantity."""
    unit = unit_named(text or "")
    return unit is not None and unit.quantity == quantity


def split_head(head: str) -> tuple[str, str | None]:
    """Split the head of a column from the text in brackets that it ends in: ``x [mm]`` into ``x`` and ``mm``.

    The number of ``joint[0]`` and the axis of ``hand (X)`` are part of the name.
    """
    match = _BRACKETS.search(head)
    if match is None or match[1].strip().isdecimal() or match[1].strip().lower() in {*"xyz"}:
        return head, None
    return head[: match.start()].rstrip(), match[1].strip() or None


def converted(values: Any, unit: Unit, other: Unit) -> Any:
    """Numbers of one unit as numbers of another unit of the same quantity.

    ``other.zero + (values - unit.zero) unit.size / other.size``; exact but for the last digit, so that 100 ms are
    the float 0.1.
    """
    assert unit.quantity == other.quantity
    ratio = unit.size / other.size
    shifted = values - unit.zero if unit.zero else values
    if isinstance(ratio, Fraction):
        scaled = shifted * float(ratio.numerator) / float(ratio.denominator)
    else:
        scaled = shifted * ratio
    return scaled + other.zero if other.zero else scaled
