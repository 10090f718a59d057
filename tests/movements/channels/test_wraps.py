"""Angles that wrap come out continuous; nothing else is touched."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme.movements.channels.coordinates import period_of, without_wraps, wrap_period


@given(
    steps=st.lists(st.floats(-0.24, 0.24), min_size=4, max_size=60),
    start=st.floats(-20, 20),
    period=st.sampled_from([2 * np.pi, 360.0]),
    low=st.sampled_from([0.0, -0.5]),
    cut=st.integers(1, 3),
)
def test_a_wrapped_angle_comes_back_as_it_turned_in_each_movement(steps, start, period, low, cut):
    turned = period * (start + np.cumsum(steps))
    wrapped = turned - period * np.floor(turned / period - low)  # from low to low + 1 periods
    offsets = np.array([0, cut, len(steps)])
    found = without_wraps(wrapped, offsets, period)
    for first, stop in pairwise(offsets):
        np.testing.assert_allclose(found[first:stop] - found[first], turned[first:stop] - turned[first], atol=1e-9)
        assert found[first] == wrapped[first]


def test_steps_below_three_quarters_of_a_period_are_motion():
    angles = np.array([0.0, 4.5, 0.0, 4.5])
    assert without_wraps(angles, np.array([0, 4]), 2 * np.pi) is angles


@pytest.mark.parametrize(
    ("angles", "period"),
    [
        ([3.0, 3.1, -3.1, -3.0], 2 * np.pi),
        ([6.2, 0.05, 0.1, 0.2], 2 * np.pi),
        ([-179.0, 179.0, 178.0, 177.0], 360.0),
        ([359.0, 1.0, 2.0, 3.0], 360.0),
        ([3.0, 3.1, 3.2, 3.3], None),
        ([-3.0, -1.0, 1.0, 3.0], None),
        ([0.0, 5.0, -700.0, 1.0], None),
        ([0.0, 0.0, 325.0, 325.0], None),
        ([0.0, 1.0, 340.0, 341.0], None),
        ([0.0, 350.0, 170.0, 0.0], None),
        ([350.0, 260.0, 220.0, 125.0, 85.0, 10.0, 345.0], None),  # so sparse that it may as well turn the other way
        ([100.0, 60.0, 50.0, 20.0, 340.0, 330.0], None),  # not through the whole range
        ([40.0, 30.0, 18.0, 8.0, 346.0, 336.0], None),  # by 22 degrees, where others are of 10 to 12
        ([10.0, 3.0, 10.0, 350.0], 360.0),  # by 20 degrees, less than three times as many as before, to and fro
        ([10.0, 3.0, 10.0, 348.0], None),  # by 22
    ],
)
def test_only_a_jump_through_the_whole_range_shows_a_period(angles, period):
    assert wrap_period(np.array(angles), np.array([0, len(angles)])) == period


K = np.arange(100)


@pytest.mark.parametrize(
    ("values", "period"),
    [
        (K % 7, None),  # a counter; 6 is nearly a turn in radians
        (3 - K % 7, None),
        ((K // 2 % 7), None),
        (np.tile([0, 1, 2, 1, 2, 3, 4, 5, 6, 6], 10), None),
        (0.5 * (K % 13), None),
        (0.1 * (K % 61), None),
        (np.mod(0.1 * K, 2 * np.pi), 2 * np.pi),
        (np.round(np.mod(0.1 * K, 2 * np.pi), 2), 2 * np.pi),
        (np.mod(-0.5 * K + np.pi, 2 * np.pi) - np.pi, 2 * np.pi),
        (np.mod(20 * K, 360), 360.0),
        (np.mod(350 + 15 * np.sin(0.2 * K), 360), 360.0),
    ],
)
def test_a_counter_that_begins_anew_is_no_angle(values, period):
    assert wrap_period(values.astype(float), np.array([0, 50, 100])) == period


def test_a_jump_from_one_movement_to_the_next_is_none():
    assert wrap_period(np.array([3.0, 3.1, -3.1, -3.0]), np.array([0, 2, 4])) is None


@pytest.mark.parametrize(
    ("largest", "unit", "period"),
    [
        (3.0, None, 2 * np.pi),
        (90.0, None, 360.0),
        (3.0, "deg", 360.0),
        (9.0, "rad", 2 * np.pi),
        (9.0, "Degrees", 360.0),
        (3.0, "turn", 1.0),
        (90.0, "Grad", 360.0),
    ],
)
def test_the_unit_or_the_values_tell_the_period(largest, unit, period):
    assert period_of(np.array([0.0, largest]), unit) == period


def test_values_beyond_every_turn_do_not_wrap():
    ticks = np.array([0.0, 4095.0, 10.0, 4000.0])
    assert period_of(ticks, None) == np.inf
    assert without_wraps(ticks, np.array([0, 4]), np.inf) is ticks


@pytest.mark.parametrize(("beyond", "period"), [(0.3, 360.0), (0.5, None)])
def test_a_thousandth_of_a_turn_beyond_the_range_is_rounding(beyond, period):
    """Angles in single precision, or filtered ones, pass half a turn by a little; more is another range."""
    angles = np.array([179.0, 180.0 + beyond, -179.9, -179.0])
    assert wrap_period(angles, np.array([0, 4])) == period
    assert wrap_period(-angles, np.array([0, 4])) == period


@pytest.mark.parametrize(
    ("largest", "period"),
    [(2 * np.pi * 1.0009, 2 * np.pi), (2 * np.pi * 1.0011, 360.0), (360.3, 360.0), (360.4, np.inf)],
)
def test_angles_of_no_unit_pass_a_turn_by_a_thousandth(largest, period):
    assert period_of(np.array([0.0, largest]), None) == period


@pytest.mark.parametrize("high", [360.0, -360.0, 2 * np.pi])
def test_a_switch_between_whole_turns_is_no_constant_angle(high):
    wave = np.repeat([0.0, high, 0.0, high, 0.0], 20)
    offsets = np.array([0, 50, 100])
    assert wrap_period(wave, offsets) is None
    assert without_wraps(wave, offsets, period_of(wave, None)) is wave
    assert period_of(np.zeros(9), None) == 2 * np.pi
    assert period_of(wave, "deg") == 360.0
