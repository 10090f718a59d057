"""Learning: the path comes back; features know the shape and nothing of place, size, tempo and where it began."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme import Demonstrations, RhythmicDMP, Trajectory

SEEDS = st.integers(0, 10_000)
FITS = ("trajectory", "forcing")


def _extent(trajectory):
    return np.ptp(trajectory.positions, axis=0).max()


@pytest.mark.parametrize("fit", FITS)
@given(seed=SEEDS, cycles=st.floats(1.5, 6.3), start=st.floats(0, 6.28))
def test_the_recording_comes_back_from_where_it_started(make_rhythm, fit, seed, cycles, start):
    recorded = make_rhythm(seed, cycles, start=start)
    learned = RhythmicDMP(fit=fit).learn(recorded)
    again = learned.rollout(recorded.duration / learned.periods[0], phase=learned.phases, n_samples=len(recorded))
    assert np.abs(again.positions[0] - recorded.positions).max() < 2e-4 * _extent(recorded)


@pytest.mark.parametrize("fit", FITS)
def test_the_error_falls_exponentially_with_the_number_of_basis_functions(make_rhythm, fit):
    """The shape has four harmonics: with more functions what is left is their own roughness."""
    recorded = make_rhythm(5)
    errors = []
    for n_basis in (10, 20, 40):
        learned = RhythmicDMP(n_basis, fit=fit, ridge=1e-14, overlap=0.3).learn(recorded)
        again = learned.rollout(3.0, phase=learned.phases, n_samples=len(recorded)).positions[0]
        errors.append(np.abs(again - recorded.positions).max() / _extent(recorded))
    assert errors[1] < errors[0] / 30
    assert errors[2] < errors[1] / 10


def test_more_periods_average_the_noise(make_rhythm):
    clean = make_rhythm(1, 1.0, n_samples=201)
    errors = []
    for cycles in (2, 8):
        learned = RhythmicDMP().learn(make_rhythm(1, cycles, n_samples=100 * cycles + 1, noise=0.1))
        again = learned.rollout(1.0, phase=learned.phases, n_samples=201).positions[0]
        errors.append(np.sqrt(np.mean((again - clean.positions) ** 2)))
    assert errors[1] < 0.65 * errors[0]


@given(seed=SEEDS, starts=st.tuples(st.floats(0, 6.28), st.floats(0, 6.28)), cycles=st.floats(1.5, 4))
def test_where_the_recording_starts_does_not_matter(make_rhythm, agree, seed, starts, cycles):
    one, other = RhythmicDMP().learn([make_rhythm(seed, cycles, start=start) for start in starts])
    for name in ("forcing", "shape_attractor"):
        agree(getattr(one, name)(), getattr(other, name)(), 1e-6)
    agree(one.weights, other.weights, 1e-6)
    turned = (one.phases - other.phases - (starts[0] - starts[1]) + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(turned, 0, atol=1e-6)


def test_phase_zero_is_where_the_first_harmonic_of_the_largest_dimension_is_largest():
    t = np.linspace(0, 2, 201)
    x = np.column_stack((0.3 * np.sin(2 * np.pi * t), 2 * np.cos(2 * np.pi * t - 1)))
    learned = RhythmicDMP().learn(Trajectory(t, x))
    assert learned.aligned_on.tolist() == [1]
    np.testing.assert_allclose(learned.phases, 2 * np.pi - 1)
    np.testing.assert_allclose(learned.rollout(1.0).positions[0, 0, 1], 2.0, rtol=1e-5)
    on_first = RhythmicDMP(align_on=0).learn(Trajectory(t, x))
    np.testing.assert_allclose(on_first.phases, 2 * np.pi - np.pi / 2)
    mirrored = RhythmicDMP().learn(Trajectory(t, -x))
    np.testing.assert_allclose(mirrored.phases, np.pi - 1)


@given(seed=SEEDS, move=st.floats(-9, 9), size=st.floats(0.1, 9), tempo=st.floats(0.1, 9), late=st.floats(0, 1e6))
def test_what_the_features_do_not_know(make_rhythm, agree, seed, move, size, tempo, late):
    a = make_rhythm(seed)
    b = Trajectory(late + a.times * tempo, size * a.positions + move)
    one, other = RhythmicDMP().learn(a), RhythmicDMP().learn(b)
    agree(other.weights, one.weights, 1e-5)
    agree(other.forcing(), one.forcing(), 1e-5)
    agree(other.shape_attractor(), size * one.shape_attractor(), 1e-5)
    np.testing.assert_allclose(other.amplitudes, size * one.amplitudes, rtol=1e-6)
    np.testing.assert_allclose(other.periods, tempo * one.periods, rtol=1e-6)
    np.testing.assert_allclose(other.baselines, size * one.baselines + move, atol=1e-6 * (size + abs(move)))


@given(cycles=st.floats(1.5, 4), start=st.floats(0, 6.28))
def test_the_baseline_is_the_mean_of_whole_periods_and_the_amplitude_half_the_swing(cycles, start):
    t = np.linspace(0, cycles, 150)
    x = np.column_stack((3 + 2 * np.sin(2 * np.pi * t + start), np.full(150, 7.0)))
    learned = RhythmicDMP().learn(Trajectory(t, x))
    np.testing.assert_allclose(learned.baselines, [[3, 7]], atol=1e-7)
    np.testing.assert_allclose(learned.amplitudes, 2, rtol=1e-3)
    assert np.abs(learned.weights[0, :, 1]).max() < 1e-6  # a flat dimension stays flat
    np.testing.assert_allclose(learned.rollout(1.0, amplitude=0.5).positions[0, 0, 0], 3.5, rtol=1e-4)


def test_a_batch_is_the_movements_one_by_one(make_rhythm, agree):
    movements = [make_rhythm(i, 1.6 + 0.7 * i, 0.3 + 0.2 * i, n_samples=90 + 13 * i, even=i % 2 == 0) for i in range(6)]
    for dmp in (RhythmicDMP(), RhythmicDMP(fit="forcing")):
        batch = dmp.learn(movements)
        for i, movement in enumerate(movements):
            alone = dmp.learn(movement)
            np.testing.assert_allclose(alone.periods, batch.periods[i : i + 1], rtol=1e-4)
            agree(alone.forcing(), batch[i].forcing(), 2e-3)  # resampled to the longest, not to its own length
    even = [make_rhythm(i, 1.6 + 0.7 * i) for i in range(60)]
    batch = RhythmicDMP().learn(even)
    for i in (0, 31, 59):
        alone = RhythmicDMP().learn(even[i])
        agree(alone.weights, batch.weights[i : i + 1], 1e-8)
        assert alone.phases == pytest.approx(batch.phases[i])


def test_a_given_period_needs_one_period_with_or_without_the_sample_that_closes_it(make_rhythm, agree):
    closed = make_rhythm(2, 1.0, 1.3, n_samples=101)
    opened = Trajectory(closed.times[:-1], closed.positions[:-1])
    dmp = RhythmicDMP(period=1.3)
    agree(dmp.learn(opened).forcing(), dmp.learn(closed).forcing(), 1e-6)
    agree(dmp.learn(closed).forcing(), RhythmicDMP().learn(make_rhythm(2, 3.0, 1.3)).forcing(), 1e-6)
    assert dmp.learn(closed).periods == pytest.approx(1.3)


def test_few_samples_per_period_are_enough_for_a_smooth_one():
    t = np.arange(60) * 0.15
    x = np.sin(2 * np.pi * t)[:, None]
    learned = RhythmicDMP().learn(Trajectory(t, x))
    np.testing.assert_allclose(learned.periods, 1.0, rtol=1e-6)
    again = learned.rollout(t[-1], phase=learned.phases, n_samples=60).positions[0]
    assert np.abs(again - x).max() < 1e-3


def test_inputs_are_left_alone_and_results_are_read_only(make_rhythm):
    block = np.stack([make_rhythm(i).positions for i in range(2)])
    block.setflags(write=False)
    learned = RhythmicDMP().learn(block)
    for name in ("scaled_weights", "baselines", "amplitudes", "periods", "phases", "aligned_on", "explained"):
        assert not getattr(learned, name).flags.writeable


def test_labels_and_names_stay_with_their_movements(make_rhythm):
    demos = Demonstrations.from_arrays(
        [make_rhythm(i).positions for i in range(3)], list("abc"), names=("p", None, "r")
    )
    learned = RhythmicDMP().learn(demos)[[2, 0]]
    assert learned.labels.tolist() == ["c", "a"]
    assert learned.names == ("r", "p")
    assert learned.rollout(1.0).trajectories.names == ("r", "p")


def test_a_ridge_shrinks_the_weights(make_rhythm):
    rhythm = make_rhythm(0)
    for fit in FITS:
        dmp = RhythmicDMP(fit=fit)
        small = np.abs(replace(dmp, ridge=10.0).learn(rhythm).weights).max()
        assert small < 0.5 * np.abs(dmp.learn(rhythm).weights).max()
