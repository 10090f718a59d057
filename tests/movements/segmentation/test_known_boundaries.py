"""Constructed recordings: every movement is found, once, where it is."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import kineme
from kineme.movements.segmentation.table import moving_bouts

seeds = st.integers(0, 10_000)


def _errors(cuts, known):
    """Distance of each boundary from the truth, in durations of its movement."""
    assert len(cuts) == len(known.truth), f"found {cuts.round(2)}, expected {known.truth.round(2)}"
    return np.abs(cuts - known.truth) / known.durations[:, None]


@given(seed=seeds, n_dims=st.sampled_from([1, 2, 3, 6]), even=st.booleans())
def test_rests_are_found_whatever_the_number_of_movements_their_durations_and_rests(make_recording, seed, n_dims, even):
    known = make_recording(seed, n_dims=n_dims, even=even)
    assert _errors(kineme.segment(known.recording).cuts, known).max() < 0.03


@pytest.mark.parametrize(("noise", "tolerance"), [(0.001, 0.04), (0.005, 0.07), (0.01, 0.08)])
@given(seed=seeds)
def test_noise_moves_the_boundaries_little_and_makes_none(make_recording, noise, tolerance, seed):
    known = make_recording(seed, noise=noise)
    errors = _errors(kineme.segment(known.recording).cuts, known)
    assert errors.max() < tolerance + 0.05
    assert np.median(errors) < tolerance


@pytest.mark.parametrize("noise", [0.06, 0.1])
def test_noise_that_no_smoothing_tells_from_the_motion_joins_and_hides_few(make_recording, noise):
    recordings = [make_recording(seed, noise=noise) for seed in range(20)]
    counts = [len(kineme.segment(known.recording)) == len(known.truth) for known in recordings]
    assert np.mean(counts) >= 0.8, counts


@given(seed=seeds)
def test_minima_of_speed_are_cut_and_the_rest_around_them_is_left_out(make_recording, seed):
    known = make_recording(seed)
    assert _errors(kineme.segment(known.recording, "speed").cuts, known).max() < 0.03


def test_movements_without_rest_between_them_are_cut_where_they_slow_down(minimum_jerk):
    t = np.linspace(0, 4, 401)
    corners = [1.0, 2.2, 3.1]
    legs = zip([0.0, *corners], [*corners, 4.0], [(1, 0), (0, 1), (-1, 0.5), (0, -1)], strict=True)
    x = sum(minimum_jerk((t - a) / (b - a))[:, None] * np.array(step) for a, b, step in legs)
    whole = kineme.segment(kineme.Trajectory(t, x), "speed", cover=True)
    np.testing.assert_allclose(whole.cuts[1:, 0], corners, atol=0.02)


def test_corners_at_constant_speed_are_cut_when_asked(agree):
    s = np.linspace(0, 4, 801)
    square = np.column_stack((np.interp(s, range(5), [0, 1, 1, 0, 0]), np.interp(s, range(5), [0, 0, 1, 1, 0])))
    recording = kineme.Trajectory(s, square)
    assert len(kineme.segment(recording, "speed", cover=True)) == 1
    cuts = kineme.segment(recording, "speed", turn=1.0, cover=True).cuts[1:, 0]
    np.testing.assert_allclose(cuts, [1, 2, 3], atol=0.02)
    assert len(kineme.segment(recording, "speed", turn=1.7, cover=True)) == 1  # the corners are right angles


@pytest.mark.parametrize("duration", [0.3, 1.0, 30.0])
def test_to_stop_for_a_moment_and_turn_back_is_one_movement(minimum_jerk, duration):
    t = np.linspace(-0.5, 2.5, 601)
    x = minimum_jerk(t) - minimum_jerk(t - 1.0)
    found = kineme.segment(kineme.Trajectory(duration * t, x))
    np.testing.assert_allclose(found.cuts / duration, [[0.0, 2.0]], atol=0.03)


def test_a_recording_that_only_moves_is_one_movement():
    t = np.linspace(0, 1, 50)
    found = kineme.segment(kineme.Trajectory(t, np.column_stack((t, np.sin(2 * t)))))
    np.testing.assert_array_equal(found.cuts, [[0.0, 1.0]])


def test_a_twitch_within_a_rest_is_not_a_movement(make_recording):
    known = make_recording(5, n=3)
    x = known.recording.positions.copy()
    middle = int(100 * (known.truth[0, 1] + known.truth[1, 0]) / 2)
    x[middle : middle + 4, 0] += 0.05
    twitching = kineme.Trajectory(known.recording.times, x)
    assert _errors(kineme.segment(twitching).cuts, known).max() < 0.03
    assert len(kineme.segment(twitching, min_movement=0.0)) == 4


def test_rests_shorter_than_asked_are_pauses_within_a_movement(make_recording):
    known = make_recording(7, n=4)
    rests = known.truth[1:, 0] - known.truth[:-1, 1]
    for least in np.sort(rests) + 0.08:
        found = kineme.segment(known.recording, min_rest=float(least))
        assert len(found) == 1 + (rests > least).sum()


@given(seed=seeds, n=st.sampled_from([1, 3, 9]), noise=st.sampled_from([0.0, 0.005]))
def test_change_points_separate_movements_from_rests(make_recording, seed, n, noise):
    pytest.importorskip("ruptures", reason="by='change-points' needs pip install kineme[segmentation]")
    known = make_recording(seed, n=n, noise=noise)
    cuts = kineme.segment(known.recording, "change-points").cuts
    middles = known.truth.mean(axis=1)
    assert n <= len(cuts) <= n + n // 3  # now and then one velocity is cut in two: within a reach it changes all along
    assert ((cuts[:, 0] < middles[:, None]) & (middles[:, None] < cuts[:, 1])).any(axis=1).all()
    told = kineme.segment(known.recording, "change-points", n_pieces=2 * n + 1, cover=True)
    assert len(told) == 2 * n + 1


def test_a_run_above_the_lower_threshold_counts_if_it_exceeds_the_higher_one():
    speed = np.array([0, 2, 0, 2, 5, 2, 0, 2, 2, 6.0])
    assert moving_bouts(speed, 1.0, 4.0).tolist() == [[3, 6], [7, 10]]
    assert moving_bouts(speed, 1.0, 1.0).tolist() == [[1, 2], [3, 6], [7, 10]]
