"""The period: found to a thousandth, whole or fractional, noisy or irregular; refused where there is none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme import RhythmicDMP
from kineme.dmp.rhythmic.encode import dissimilarity, find_cycles
from kineme.dmp.rhythmic.operators import as_real, fit_harmonics, waves
from kineme.errors import TrajectoryError

SEEDS = st.integers(0, 10_000)


@pytest.mark.parametrize("even", [True, False])
@given(seed=SEEDS, cycles=st.floats(1.5, 6.3), period=st.floats(0.05, 50.0), noise=st.floats(0, 0.02))
def test_the_period_is_found_to_a_thousandth(make_rhythm, even, seed, cycles, period, noise):
    learned = RhythmicDMP().learn(make_rhythm(seed, cycles, period, even=even, noise=noise))
    np.testing.assert_allclose(learned.periods, period, rtol=1e-3)


@given(seed=SEEDS, cycles=st.floats(1.5, 20))
def test_without_noise_the_period_is_exact(make_rhythm, seed, cycles):
    learned = RhythmicDMP().learn(make_rhythm(seed, cycles, 1.3))
    np.testing.assert_allclose(learned.periods, 1.3, rtol=1e-9)
    np.testing.assert_allclose(learned.explained, 1.0, atol=1e-9)


def test_a_weak_odd_harmonic_doubles_the_period():
    """Left and right step alike but for two percent: the stride is the period, not the step."""
    t = np.linspace(0, 4.4, 300)
    x = np.cos(4 * np.pi * t) + 0.02 * np.cos(2 * np.pi * t)
    found = find_cycles(x[None, None], np.array([300]))
    np.testing.assert_allclose(found.cycles, 4.4, rtol=1e-6)


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("cycles", [3.3, 6.6])
@pytest.mark.parametrize("share", [0.1, 0.3])
def test_what_varies_from_period_to_period_does_not_double_it(cycles, share):
    """Smooth noise is the hard kind: two periods explain more of it than one, by chance and by their freedom."""
    rng, u, k = np.random.default_rng(0), np.linspace(0, 1, 300), 0.93 * np.arange(1, 21)
    turns = np.exp(2j * np.pi * k[:, None] * u)
    noise = ((rng.normal(size=(100, 20)) + 1j * rng.normal(size=(100, 20))) @ turns).real / np.sqrt(20)
    rows = np.cos(2 * np.pi * cycles * u + rng.uniform(0, 6, (100, 1))) + share * noise
    found = find_cycles(rows[:, None], np.full(100, 300))
    assert np.mean(np.abs(found.cycles / cycles - 1) < 0.1) >= 0.97


def test_dissimilarity_is_the_mean_square_distance_from_the_shifted_recording():
    rows = np.random.default_rng(0).normal(size=(3, 2, 30)) + 7
    expected = np.empty((3, 30))
    for i, row in enumerate(rows):
        for lag in range(30):
            apart = row[:, lag:] - row[:, : 30 - lag]
            expected[i, lag] = (apart**2).sum(axis=0).mean() / (2 * row.var(axis=1).sum())
    np.testing.assert_allclose(dissimilarity(rows), expected, atol=1e-12)


def test_the_harmonic_fit_is_least_squares():
    """Toeplitz normal equations against a general solver, recording by recording, with harmonics of its own."""
    rng = np.random.default_rng(1)
    rows, cycles, n_harmonics = rng.normal(size=(3, 2, 50)), np.array([1.5, 2.7, 6.3]), np.array([5, 2, 3])
    fit = fit_harmonics(rows, cycles, n_harmonics)
    for i in range(3):
        design = waves(2 * np.pi * cycles[i] * np.linspace(0, 1, 50), n_harmonics[i])
        expected = np.linalg.lstsq(design, rows[i].T)[0].T
        own = as_real(fit.coefficients[i, :, : n_harmonics[i] + 1])
        np.testing.assert_allclose(own, expected, atol=1e-9)
        assert not fit.coefficients[i, :, n_harmonics[i] + 1 :].any()
        np.testing.assert_allclose(fit.fitted[i], expected @ design.T, atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_what_does_not_repeat_is_refused(seed):
    rng = np.random.default_rng(seed)
    movements = rng.normal(size=(3, 150, 2))
    with pytest.raises(TrajectoryError, match=r"trajectory 0: expected a movement of at least 1.5 periods, found no .* \(3 of 3 movements\).*aperiodic=\"accept\""):  # fmt: skip  # noqa: E501
        RhythmicDMP().learn(movements)
    assert len(RhythmicDMP(aperiodic="accept").learn(movements)) == 3


def test_a_reach_is_one_period_where_that_is_accepted():
    reach = np.linspace(0, 1, 50)[None, :, None] ** 3
    with pytest.raises(TrajectoryError, match=r"nothing in it repeats.*kineme.DMP"):
        RhythmicDMP().learn(reach)
    assert RhythmicDMP(aperiodic="accept").learn(reach).periods == 1.0
