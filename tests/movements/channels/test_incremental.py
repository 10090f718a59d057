"""Samples that come one after the other become what a whole recording becomes, however they are divided."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme.movements.channels.channel import Channel, recorded_names
from kineme.movements.channels.coordinates import canonical, learned, with_periods
from kineme.movements.channels.incremental import IncrementalCoordinates

OF_KIND = {
    "position": lambda k: Channel(f"x{k}", "position", (f"x{k}",), "mm"),
    "angle": lambda k: Channel(f"j{k}", "angle", (f"j{k}",), ("rad", "deg", None)[k % 3]),
    "discrete": lambda k: Channel(f"g{k}", "discrete", (f"g{k}",)),
    "orientation": lambda k: Channel(
        f"q{k}", "orientation", tuple(f"q{k}{part}" for part in "xyzw"), None, ("xyzw", "wxyz")[k % 2]
    ),
}


def recorded(kinds, random, n):
    """Channels of those kinds, and n samples: angles that wrap, quaternions whose signs and norms are not exact."""
    channels = tuple(OF_KIND[kind](k) for k, kind in enumerate(kinds))
    columns = []
    for one in channels:
        if one.kind == "orientation":
            q = np.cumsum(random.normal(size=(n, 4)), axis=0)
            norms = np.linalg.norm(q, axis=1, keepdims=True) * random.uniform(0.995, 1.005, (n, 1))
            columns.append(q / norms * random.choice([-1.0, 1.0], (n, 1)))
        elif one.kind == "angle":
            turn = 360.0 if one.unit == "deg" else 2 * np.pi
            path = np.cumsum(random.normal(scale=0.2 * turn, size=(n, 1)), axis=0)
            columns.append((path + turn / 2) % turn - turn / 2)
        else:
            columns.append(random.normal(size=(n, 1)))
    columns = np.concatenate(columns, axis=1)
    return with_periods(channels, columns), columns


@given(
    kinds=st.lists(st.sampled_from(sorted(OF_KIND)), min_size=1, max_size=5).filter(lambda k: {*k} != {"discrete"}),
    seed=st.integers(0, 10_000),
    n=st.integers(1, 40),
    cuts=st.lists(st.integers(0, 40), max_size=6),
)
def test_they_are_those_of_the_whole_recording_to_the_last_bit(kinds, seed, n, cuts):
    channels, columns = recorded(kinds, np.random.default_rng(seed), n)
    whole = np.array([0, n])
    expected = learned(canonical(columns, whole, channels), whole, channels)
    follow = IncrementalCoordinates(channels)
    for _ in range(2):
        for chunks in (np.split(columns, sorted(min(cut, n) for cut in cuts)), columns[:, None], [columns]):
            found = np.concatenate([follow.take(chunk) for chunk in chunks if len(chunk)])
            np.testing.assert_array_equal(found, expected)
            follow.clear()


def test_an_angle_without_a_known_period_is_left_as_it_is():
    follow = IncrementalCoordinates((Channel("j", "angle", ("j",)),))
    column = np.array([[3.0], [-3.0], [300.0]])
    np.testing.assert_array_equal(follow.take(column), column)


@pytest.mark.parametrize("bad", [np.zeros(4), np.full(4, np.nan), np.full(4, 1e200), np.array([1.1, 0, 0, 0])])
def test_samples_that_are_no_rotation_are_told(bad):
    channels = (OF_KIND["position"](0), OF_KIND["orientation"](1))
    good = [5.0, 1.0, 0, 0, 0]
    rows = np.array([good, [5.0, *bad], good])
    assert len(recorded_names(channels)) == rows.shape[1]
    assert IncrementalCoordinates(channels).usable(rows).tolist() == [True, False, True]
