"""One table of units: every spelling has the size that the definitions of the units give it."""

import math
from fractions import Fraction

import numpy as np
import pytest

from kineme.units import UNITS, converted, is_unit_of, split_head, unit_named

#: Quantity -> (size in m, rad, s or of a range, as the SI Brochure, NIST SP 811 and LeRobot define it; spellings).
FACTS = {
    "length": [
        (1e3, ["km", "kilometer", "Kilometers", "kilometr" + "es"]),
        (1.0, ["m", "M", "meter", "Meters", "metr" + "es"]),
        (0.1, ["dm", "decimeters"]),
        (0.01, ["cm", "Centimeters"]),
        (0.001, ["mm", "MM", "[mm]", "(mm)", "millimeter", "Millimeters", "millimetr" + "es"]),
        (1e-6, ["um", "µm", "μm", "micrometers", "micron"]),
        (0.0254, ["in", "inch", "Inches"]),
        (0.3048, ["ft", "foot", "Feet"]),
    ],
    "angle": [
        (1.0, ["rad", "Rad", "rads", "radian", "Radians"]),
        (1e-3, ["mrad", "milliradians"]),
        (math.radians(1), ["deg", "Deg", "degs", "degree", "Degrees", "[degrees]", "°", "º", "˚"]),
        (math.radians(0.9), ["gon", "gradians"]),
        (2 * math.pi, ["rev", "revs", "revolutions", "turn", "turns"]),
    ],
    "time": [
        (1.0, ["s", "sec", "secs", "second", "Seconds"]),
        (1e-3, ["ms", "msec", "millis", "milliseconds"]),
        (1e-6, ["us", "µs", "μs", "usecs", "micros", "microseconds"]),
        (1e-7, ["100ns", "[100 ns]"]),
        (1e-9, ["ns", "nsecs", "nanos", "nanosec", "nanoseconds"]),
        (60.0, ["min", "minutes"]),
        (3600.0, ["h", "hours"]),
    ],
    "range": [(0.01, ["%", "percent", "range_0_100"]), (0.005, ["-100..100", "±100", "range_m100_100"])],
    "frequency": [(1.0, ["Hz", "hertz"])],
    "mass": [(1.0, ["kg", "kilograms"])],
    "force": [(1.0, ["N", "newtons"])],
    "torque": [(1.0, ["Nm", "N.m", "N·m", "N*m"]), (1e-3, ["Nmm", "N.mm", "N·mm", "mm.N"])],
    "power": [(1.0, ["W", "watts"])],
    "voltage": [(1.0, ["V", "volts"]), (1e-3, ["mV"]), (1e-6, ["uV", "µV", "μV"])],
    "current": [(1.0, ["A", "amps"]), (1e-3, ["mA"])],
    "magnetic flux density": [(1e-6, ["uT", "µT", "μT"])],
    "image": [(1.0, ["px", "pixels"])],
    "count": [(1.0, ["count", "counts", "ticks"])],
    "frames": [(1.0, ["frame", "frames"])],
    "angle/time": [
        (math.radians(1), ["deg/s", "°/s", "degrees per second", "dps"]),
        (1.0, ["rad/s"]),
        (math.pi / 30, ["rev/min"]),
    ],
    "angle/time^2": [(math.radians(1), ["deg/s^2", "deg/s²"]), (1.0, ["rad/s2"])],
    "length/time": [(1.0, ["m/s"]), (1e-3, ["mm/s"]), (1 / 3.6, ["km/h"])],
    "length/time^2": [(1.0, ["m/s^2", "m/s²", "m/s2", "m/s**2", "m/(s^2)", "[m/(sec^2)]"]), (1e-3, ["mm/s^2"])],
    "force/mass": [(1.0, ["N/kg"])],
}
ROWS = [(quantity, size, names) for quantity, facts in FACTS.items() for size, names in facts]


@pytest.mark.parametrize(("quantity", "size", "names"), ROWS, ids=[names[0] for *_, names in ROWS])
def test_a_spelling_has_the_size_of_its_unit(quantity, size, names):
    for name in names:
        unit = unit_named(name)
        assert unit is not None, name
        assert unit.quantity == quantity, name
        assert float(unit.size) == pytest.approx(size, rel=1e-15), name


def test_no_unit_of_the_table_is_without_a_fact():
    facts = {unit_named(name) for _, _, names in ROWS for name in names}
    assert set(UNITS.values()) <= facts


@pytest.mark.parametrize("name", ["", "Grad", "g", "furlong", "deg/", "m/fortnight", "degreess", "/s", "m/s^3", "m²"])
def test_what_is_no_unit_or_could_be_two(name):
    assert unit_named(name) is None
    assert not is_unit_of(name, "angle")


@pytest.mark.parametrize(
    ("values", "unit", "other", "expected"),
    [
        (100, "ms", "s", 0.1),
        (59, "mm", "m", 0.059),
        (0.059, "m", "mm", 59.0),
        (180, "deg", "rad", math.pi),
        (math.pi / 2, "rad", "deg", 90.0),
        (10, "in", "cm", 25.4),
        (50, "%", "-100..100", 0.0),
        (-100, "-100..100", "%", 0.0),
        (100, "-100..100", "%", 100.0),
    ],
)
def test_numbers_of_one_unit_as_numbers_of_another(values, unit, other, expected):
    result = converted(np.array([values, values]), UNITS[unit], UNITS[other])
    np.testing.assert_allclose(result, expected, rtol=1e-15, atol=1e-15)
    assert converted(values, UNITS[unit], UNITS[unit]) == values


def test_times_and_lengths_are_converted_without_rounding_but_of_the_result():
    for unit in UNITS.values():
        if unit.quantity in {"length", "time"}:
            base = UNITS["m" if unit.quantity == "length" else "s"]
            for k in (1, 3, 7, 100, 1234567):
                assert converted(k, unit, base) == float(Fraction(unit.size) * k), unit


@pytest.mark.parametrize(
    ("head", "parts"),
    [
        ("x [mm]", ("x", "mm")),
        ("elbow (deg) ", ("elbow", "deg")),
        ("joint[0]", ("joint[0]", None)),
        ("Left (X)", ("Left (X)", None)),
        ("q[1] [deg]", ("q[1]", "deg")),
        ("x", ("x", None)),
        ("x []", ("x", None)),
        ("x [a.u.]", ("x", "a.u.")),
    ],
)
def test_a_head_and_the_unit_behind_it(head, parts):
    assert split_head(head) == parts
