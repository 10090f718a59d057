"""Single samples far from everything else, as trackers write them, hide no movement."""

from __future__ import annotations

import numpy as np
import pytest

import kineme
from kineme.movements.segmentation.table import without_glitches


def _with_glitch(known, at, length, size):
    x = known.recording.positions.copy()
    x[at : at + length] += size
    return kineme.Trajectory(known.recording.times, x)


@pytest.mark.parametrize("by", ["rest", "speed"])
@pytest.mark.parametrize("length", [1, 3])
@pytest.mark.parametrize(("size", "noise"), [(100.0, 0.0), (100.0, 0.002), (-1e4, 0.002)])
def test_a_glitch_hides_no_movement_wherever_it_is(make_recording, by, length, size, noise):
    known = make_recording(3, n=4, noise=noise)
    expected = kineme.segment(known.recording, by).cuts
    assert len(expected) == 4
    for at in (20, 150, 333, *((0, len(known.recording) - 1) if length == 1 else ())):
        found = kineme.segment(_with_glitch(known, at, length, size), by).cuts
        assert found.shape == expected.shape
        np.testing.assert_allclose(found, expected, atol=0.05)


def test_known_movements_are_spotted_beside_a_glitch(make_recording):
    known = make_recording(3, n=4)
    pieces = kineme.segment(known.recording).demonstrations
    recognizer = kineme.Recognizer().fit(pieces, ["a", "b", "c", "d"])
    expected, found = (
        [one.label for one in recognizer.spot(recording)]
        for recording in (known.recording, _with_glitch(known, 20, 1, 100.0))
    )
    assert expected
    assert found == expected


@pytest.mark.parametrize("noise", [0.0, 1e-4, 0.01])
@pytest.mark.parametrize("digits", [2, 12])
def test_samples_on_the_path_stay_as_they_are(make_recording, noise, digits):
    for seed in range(20):
        x = make_recording(seed, noise=noise).recording.positions.round(digits)
        assert without_glitches(x) is x


def test_a_step_that_does_not_return_is_no_glitch():
    x = np.repeat([[0.0], [5.0]], 50, axis=0) + np.random.default_rng(0).normal(scale=0.01, size=(100, 1))
    np.testing.assert_array_equal(without_glitches(x), x)


def test_samples_away_for_longer_than_three_are_a_movement():
    x = np.random.default_rng(0).normal(scale=0.01, size=(100, 1))
    x[40:44] += 5.0
    np.testing.assert_array_equal(without_glitches(x), x)
