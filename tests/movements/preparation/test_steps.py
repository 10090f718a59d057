"""What each preprocessing step does to a movement, and that it is written down."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme import DMP, Demonstrations, Resample, Smooth, TrimRest, preprocess
from kineme.errors import SpecificationError


def _one(x, times=None):
    return Demonstrations.from_arrays([x], times=None if times is None else [times])


def test_steps_are_recorded_in_order(make_movement):
    demos = preprocess(_one(make_movement(0)[1]), [TrimRest(), Smooth(10.0)])
    again = preprocess(demos, [Resample(50)])
    assert again.steps == (TrimRest(), Smooth(10.0), Resample(50))
    assert again[:1].steps == again.steps


def test_steps_leave_the_original_as_it_is(make_movement):
    demos = _one(make_movement(0)[1])
    before = demos.positions.copy()
    preprocess(demos, [TrimRest(), Smooth(3.0), Resample(20)])
    np.testing.assert_array_equal(demos.positions, before)
    assert demos.steps == ()


def test_steps_keep_labels_and_names(make_movement):
    demos = Demonstrations.from_arrays(
        [make_movement(i)[1] for i in range(3)], labels=[2, 1, 2], names=["a", None, "c"]
    )
    after = preprocess(demos, [TrimRest(), Smooth(), Resample()])
    assert after.labels.tolist() == [2, 1, 2]
    assert after.names == ("a", None, "c")


def test_steps_of_a_specification_are_those_applied_by_hand(make_movement):
    demos = _one(make_movement(0)[1])
    steps = (TrimRest(0.05), Smooth(8.0))
    np.testing.assert_array_equal(
        DMP(preprocessing=steps).learn(demos).weights, DMP().learn(preprocess(demos, steps)).weights
    )


@pytest.mark.parametrize("cutoff", [5.0, 20.0])
def test_smoothing_halves_the_amplitude_at_the_cutoff(cutoff):
    u = np.linspace(0, 1, 2001)
    wave = np.sin(2 * np.pi * cutoff * u)
    smoothed = preprocess(_one(wave), [Smooth(cutoff)]).positions[:, 0]
    middle = slice(500, 1501)
    assert np.ptp(smoothed[middle]) / np.ptp(wave[middle]) == pytest.approx(0.5, abs=0.01)


def test_smoothing_follows_its_stated_frequency_response():
    u = np.linspace(0, 1, 2001)
    middle = slice(500, 1501)
    for ratio in (0.25, 0.5, 2.0, 4.0):
        wave = np.sin(2 * np.pi * 20 * ratio * u)
        gain = np.ptp(preprocess(_one(wave), [Smooth(20.0)]).positions[middle]) / np.ptp(wave[middle])
        assert gain == pytest.approx(1 / (1 + ratio**4), abs=0.01)


@given(seed=st.integers(0, 10**6), cutoff=st.floats(0.5, 50))
def test_straight_lines_are_smooth(seed, cutoff):
    rng = np.random.default_rng(seed)
    t = np.sort(rng.random(30))
    line = rng.normal(size=3) + t[:, None] * rng.normal(size=3)
    np.testing.assert_allclose(preprocess(_one(line, t), [Smooth(cutoff)]).positions, line, atol=1e-9)


def test_smoothing_does_not_depend_on_duration_or_place(make_movement):
    t, x = make_movement(3, even=False)
    plain = preprocess(_one(x, t), [Smooth(5.0)]).positions
    moved = preprocess(_one(x + 100, 5 + 30 * t), [Smooth(5.0)]).positions
    np.testing.assert_allclose(moved - 100, plain, atol=1e-9)


def test_smoothing_brings_a_noisy_movement_nearer_to_the_clean_one(make_movement):
    _, x = make_movement(4, n_samples=300)
    noisy = x + 0.02 * np.random.default_rng(0).normal(size=x.shape)
    smoothed = preprocess(_one(noisy), [Smooth(10.0)]).positions
    assert np.linalg.norm(smoothed - x) < 0.4 * np.linalg.norm(noisy - x)


@pytest.mark.parametrize("choice", ["always", "never"])
def test_the_fewest_samples_are_smoothed_too(choice, monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", choice)
    x, h, cutoff = np.array([0.0, 1.0, -1.0, 0.5]), 1 / 3, 0.7
    lam = 3 / (2 * np.pi * cutoff) ** 4
    Q = np.array([[1, -2, 1, 0], [0, 1, -2, 1]]) / h
    R = h * np.array([[2 / 3, 1 / 6], [1 / 6, 2 / 3]])
    expected = x - lam * Q.T @ np.linalg.solve(R + lam * Q @ Q.T, Q @ x)
    np.testing.assert_allclose(preprocess(_one(x), [Smooth(cutoff)]).positions[:, 0], expected, atol=1e-12)


def _rested(x, before, after):
    return np.concatenate((np.repeat(x[:1], before, axis=0), x, np.repeat(x[-1:], after, axis=0)))


@pytest.mark.parametrize(("before", "after"), [(20, 0), (0, 20), (20, 20)])
def test_rest_is_cut(make_movement, before, after):
    _, x = make_movement(5, n_samples=200)
    trimmed = preprocess(_one(_rested(x, before, after)), [TrimRest(0.0)])
    np.testing.assert_array_equal(trimmed.positions, x)


@pytest.mark.parametrize("formulation", ["original", "bio-inspired"])
def test_trimming_brings_the_features_of_a_rested_movement_back(make_movement, formulation):
    """A tenth of rest at each end changes f by a third or more; trimmed, it is within 2 % of the trimmed clean one."""
    _, x = make_movement(5, n_samples=200)
    dmp, trimming = DMP(formulation, n_basis=30), DMP(formulation, n_basis=30, preprocessing=(TrimRest(),))
    rested = _rested(x, 20, 20) + 1e-4 * np.random.default_rng(1).normal(size=(240, 2)).cumsum(axis=0) / 15
    clean = dmp.learn([x]).forcing()
    off = np.linalg.norm(dmp.learn([_rested(x, 20, 20)]).forcing() - clean) / np.linalg.norm(clean)
    clean = trimming.learn([x]).forcing()
    back = np.linalg.norm(trimming.learn([rested]).forcing() - clean) / np.linalg.norm(clean)
    assert off > 0.3
    assert back < 0.05


def test_trimming_keeps_the_stamps_of_what_is_left(make_movement):
    t, x = make_movement(6, n_samples=100)
    times = np.arange(140) * 0.1 + 50
    trimmed = preprocess(_one(_rested(x, 20, 20), times), [TrimRest(0.0)])[0]
    np.testing.assert_array_equal(trimmed.times, times[20:120])
    assert trimmed.duration == pytest.approx(9.9)
    assert len(t) == 100


@pytest.mark.parametrize("even", [True, False])
def test_steps_keep_the_origin_of_time(make_movement, even):
    t, x = make_movement(0, even=even)
    demos = Demonstrations.from_arrays([x, x], times=[t, t + 10])
    after = preprocess(demos, [Smooth(), Resample(50)])
    assert [movement.times[0] for movement in after] == [t[0], t[0] + 10]
    assert [movement.times[-1] for movement in after] == [t[-1], t[-1] + 10]
    assert after.even_length == 50


def test_a_still_movement_is_left_as_it_is():
    demos = Demonstrations.from_arrays([np.ones((20, 2)), np.linspace(0, 1, 20)[:, None] * [1, 1]])
    assert preprocess(demos, [TrimRest()]).lengths[0] == 20


@given(n_samples=st.integers(4, 12), jump=st.integers(1, 11), tolerance=st.floats(0, 0.49))
def test_at_least_four_samples_stay(n_samples, jump, tolerance):
    x = (np.arange(n_samples) >= min(jump, n_samples - 1)).astype(float)
    assert preprocess(_one(x), [TrimRest(tolerance)]).lengths[0] >= 4


@given(seed=st.integers(0, 10**6), tolerance=st.floats(0, 0.2))
def test_what_stays_begins_and_ends_at_rest(make_movement, seed, tolerance):
    """Within the tolerance of the first and the last position, so the goal is not moved by more."""
    _, x = make_movement(seed, n_samples=120)
    kept = preprocess(_one(x), [TrimRest(tolerance)]).positions
    radius = tolerance * np.linalg.norm(np.ptp(x, axis=0)) + 1e-12
    assert np.linalg.norm(kept[0] - x[0]) <= radius
    assert np.linalg.norm(kept[-1] - x[-1]) <= radius


@pytest.mark.parametrize(
    ("step", "message"),
    [
        (lambda: TrimRest(-0.1), "tolerance to be a number of at least 0 and below 0.5, got -0.1"),
        (lambda: TrimRest(0.5), "tolerance to be a number of at least 0 and below 0.5, got 0.5"),
        (lambda: TrimRest("0.1"), "tolerance to be a number of at least 0 and below 0.5, got '0.1'"),
        (lambda: Smooth(0), "cutoff to be a number above 0, got 0"),
        (lambda: Smooth(float("nan")), "cutoff to be a number above 0, got nan"),
        (lambda: Resample(3), "n_points to be a whole number of at least 4, got 3"),
        (lambda: Resample(50.0), "n_points to be a whole number of at least 4, got 50.0"),
    ],
)
def test_parameters_out_of_range_are_refused(step, message):
    with pytest.raises(SpecificationError, match=message):
        step()


@pytest.mark.parametrize("steps", ["smooth", [TrimRest], [None], Smooth(), 3], ids=repr)
def test_what_is_no_step_is_refused(make_movement, steps):
    with pytest.raises(
        SpecificationError, match=r"a tuple of steps such as \(kineme.TrimRest\(\), kineme.Smooth\(\)\), got "
    ):
        preprocess(_one(make_movement(0)[1]), steps)
    with pytest.raises(SpecificationError, match="a tuple of steps"):
        DMP(preprocessing=steps)


def test_steps_take_movements_in_any_form():
    x = np.linspace(0, 1, 30)[:, None] ** 2
    np.testing.assert_array_equal(
        preprocess([x], (Smooth(),)).positions, preprocess(Demonstrations.from_arrays([x]), (Smooth(),)).positions
    )


def test_a_sample_far_away_makes_no_rest_of_the_rest():
    t = np.linspace(0.0, 1.0, 120)
    x = np.column_stack([np.sin(3 * t), t**2]) + 5.0
    x[60] = 0.0
    (trimmed,) = preprocess(_one(x, t), [TrimRest()])
    x[60] = 0.5 * (x[59] + x[61])
    (expected,) = preprocess(_one(x, t), [TrimRest()])
    np.testing.assert_array_equal(trimmed.times, expected.times)
    assert (trimmed.positions == 0.0).any()  # nothing that was recorded is changed
