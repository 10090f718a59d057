"""Nearly coincident stamps: what noise between them does to what is learned, and what is left as it was."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kineme import DMP, Demonstrations, Resample, RhythmicDMP, Smooth, preprocess
from kineme.movements.trajectories import _compiled
from kineme.movements.trajectories.movements import merge_close

N = 200
WHOLE = np.array([0, N])


def _gaps(kind, rng):
    gaps = rng.uniform(0.4, 1.6, N - 1)
    if kind == "coincident":
        gaps[rng.random(N - 1) < 0.05] = 0.005
    elif kind == "in pairs":
        gaps[::2] = 0.005
    elif kind == "random":
        gaps = rng.exponential(size=N - 1)
    return gaps


def _learned_path_error(make_movement, kind, fit):
    """Largest and median error of 20 learned paths, root mean square in units of the extent, with 0.2 % of noise."""
    arrays, times, clean = [], [], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        u, x = make_movement(seed, n_samples=4001)
        t = 2.0 * np.append(0, (gaps := _gaps(kind, rng)).cumsum()) / gaps.sum()
        path = np.column_stack([np.interp(t, u, one) for one in x.T])
        times.append(t)
        arrays.append(path + 0.002 * np.ptp(x, axis=0).max() * rng.normal(size=path.shape))
        clean.append(x[::20])
    clean, n_basis = np.array(clean), 40 if fit == "trajectory" else 80
    learned = DMP(fit=fit, n_basis=n_basis).learn(Demonstrations.from_arrays(arrays, times=times))
    error = np.sqrt(((learned.rollout(n_samples=201).positions - clean) ** 2).mean(axis=(1, 2)))
    error /= np.ptp(clean, axis=1).max(axis=1)
    return error.max(), np.median(error)


@pytest.mark.parametrize(
    ("fit", "kind", "most", "median"),
    [
        ("trajectory", "even-ish", 0.0012, 0.0010),
        ("trajectory", "coincident", 0.0012, 0.0010),  # interpolated: 0.0088 and 0.0043
        ("trajectory", "in pairs", 0.0012, 0.0010),  # interpolated: 0.034 and 0.028
        ("trajectory", "random", 0.0075, 0.0022),  # interpolated: 2.5 and 0.015
        ("forcing", "coincident", 0.0025, 0.0016),  # interpolated: 0.059 and 0.0053
    ],
)
def test_noise_is_not_magnified_by_nearly_coincident_stamps(make_movement, fit, kind, most, median):
    worst, typical = _learned_path_error(make_movement, kind, fit)
    assert worst < most
    assert typical < median


def test_rhythms_at_random_stamps_have_a_period():
    """With noise of a tenth of the signal three of four were refused, at any stamps that come close."""
    off = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        t = np.append(0, np.append(np.sort(rng.random(298)), 1))
        phase = 2 * np.pi * 3.3 * t[:, None] * [1, 2] + rng.uniform(0, 6, 2)
        x = np.cos(phase) @ [[1.0, 0.5], [0.3, -0.4]]
        x += 0.1 * x.std() * rng.normal(size=x.shape)
        off.append(RhythmicDMP().learn(Demonstrations.from_arrays([x], times=[t])).periods[0] * 3.3 - 1)
    assert np.abs(off).max() < 0.005


@pytest.mark.parametrize("jitter", [0.0, 0.4, 0.8])
@given(seed=st.integers(0, 10**6), n=st.integers(4, 40))
def test_ordinary_stamps_are_left_as_they_are(jitter, seed, n):
    t = np.append(0, np.cumsum(np.random.default_rng(seed).uniform(1 - jitter, 1 + jitter, n - 1)))
    assert merge_close(t, t[:, None], np.array([0, n])) is None


@pytest.mark.parametrize("gap", [0.05, 5.0, 100.0])
def test_missing_samples_and_dense_stretches_are_left_as_they_are(gap):
    """A recording that waits, drops samples, or is denser for longer than a usual step, has no close samples."""
    gaps = np.ones(N - 1)
    gaps[40:80] = gap
    t = np.append(0, np.cumsum(gaps))
    assert merge_close(t, t[:, None], WHOLE) is None


@given(seed=st.integers(0, 10**6), origin=st.sampled_from([0.0, 1.7e9]))
def test_what_is_left_increases_and_keeps_both_ends(seed, origin):
    rng = np.random.default_rng(seed)
    gaps = rng.exponential(size=N - 1) + 1e-5
    gaps[rng.random(N - 1) < 0.1] = 1e-3
    t, x = origin + np.append(0, np.cumsum(gaps)), rng.normal(size=(N, 2))
    times, positions, offsets = merge_close(t, x, WHOLE)
    assert (np.diff(times) > 0).all()
    assert len(positions) == len(times) == offsets[1] < N
    np.testing.assert_array_equal(times[[0, -1]], t[[0, -1]])
    np.testing.assert_array_equal(positions[[0, -1]], x[[0, -1]])


def test_close_samples_become_their_mean():
    t, x = np.array([0.0, 1.0, 1.08, 2.0, 3.0, 4.0, 4.05]), np.array([0.0, 1.0, 3.0, 2.0, 3.0, 9.0, 4.0])
    times, positions, offsets = merge_close(t, x[:, None], np.array([0, 7]))
    np.testing.assert_allclose(times, [0.0, 1.04, 2.0, 3.0, 4.05])
    np.testing.assert_allclose(positions[:, 0], [0.0, 2.0, 2.0, 3.0, 4.0])
    assert offsets.tolist() == [0, 5]


def test_four_samples_stay():
    t = np.array([0.0, 0.01, 0.02, 1.0, 2.0])
    assert merge_close(t, t[:, None], np.array([0, 5])) is None


def test_smooth_movements_lose_nothing_by_it(make_movement):
    rng = np.random.default_rng(0)
    t = np.append(0, np.cumsum(_gaps("coincident", rng)))
    k = np.arange(1, 5)
    exact = Demonstrations.from_arrays([np.sin(k * t[:, None] / t[-1])], times=[t])
    even = preprocess(exact, [Resample(300)]).positions
    np.testing.assert_allclose(even, np.sin(k * np.linspace(0, 1, 300)[:, None]), atol=1e-6)


def test_a_group_is_shorter_than_a_tenth_of_a_step():
    """Close samples that follow each other for half a step become five, not one."""
    times = np.concatenate((np.arange(10.0), 9.0 + np.arange(1, 26) * 0.02, np.arange(10.0, 20.0)))
    merged = merge_close(times, times[:, None], np.array([0, len(times)]))
    assert merged is not None
    inside = merged[0][(merged[0] >= 9.0) & (merged[0] <= 9.5)]
    assert len(inside) in {5, 6}
    assert np.diff(inside).max() < 0.12
    assert len(merged[0]) == len(times) - 26 + len(inside)


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("compiled", ["never", "always"])
@pytest.mark.parametrize("gap", [1e-4, 1e-7, 1e-8, 1e-10, 1e-12])
def test_smoothing_does_not_notice_how_close_close_stamps_are(monkeypatch, compiled, gap):
    """A clock of nanoseconds, whose samples come in pairs."""
    monkeypatch.setenv("KINEME_COMPILED", compiled)
    rng = np.random.default_rng(0)
    close = rng.random(119) < 0.3
    noise = 1e-3 * rng.normal(size=(120, 2))

    def smoothed(gap):
        t = np.append(0.0, np.cumsum(np.where(close, gap, 1.0)))
        path = np.column_stack((np.sin(3 * t / t[-1]), np.cos(2 * t / t[-1]))) + noise
        return preprocess(Demonstrations.from_arrays([path], times=[t]), [Smooth(6.0)]).positions

    np.testing.assert_allclose(smoothed(gap), smoothed(1e-5), atol=2e-4 if gap > 1e-5 else 2e-5)


@settings(max_examples=200)  # six of the default do not tell `<` from `<=`
@given(values=st.lists(st.integers(-3, 3) | st.floats(-1e9, 1e9), min_size=1, max_size=60), share=st.floats(0, 1))
def test_the_nth_smallest_is_that_of_a_sorted_array(values, share):
    values = np.array(values, dtype=float)
    n = int(share * (len(values) - 1))
    assert _compiled.nth_smallest(values.copy(), n) == np.sort(values)[n]
