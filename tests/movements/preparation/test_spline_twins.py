"""The spline and the smoother against SciPy's, plain and compiled, on movements as bad as they come."""

from __future__ import annotations

import numpy as np
import pytest
from exact_spline import exact_smoothing_spline
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from scipy.interpolate import make_smoothing_spline as smoothing_spline_of_numbers

from kineme import Demonstrations, Resample, Smooth, preprocess
from kineme.movements.preparation.resample import (
    arc_length_phase,
    relative_rows,
    resample_by_arc_length,
    resample_by_phase,
)
from kineme.movements.preparation.smooth import smooth_rows, spline_matrix, spline_rows
from soaking import examples

CHOICES = ("always", "never")


@pytest.fixture(params=CHOICES, scope="module")
def compiled(request):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("KINEME_COMPILED", request.param)
        yield request.param


def make_smoothing_spline(t, x, lam):
    """SciPy's, dimension by dimension: before 1.15 it takes no more than one."""
    splines = [smoothing_spline_of_numbers(t, one, lam=lam) for one in x.T]
    return lambda at: np.stack([spline(at) for spline in splines], axis=-1)


def _ragged(seed, least, n=6, origin=0.0, place=0.0, nearness=1e-3):
    """Movements of `least` samples and more, some stamps `nearness` of a step apart, far from 0 in time and space."""
    rng = np.random.default_rng(seed)
    movements = []
    for i in range(n):
        length = least if i == 0 else int(rng.integers(least, 60))
        gaps = rng.uniform(0.5, 1.5, length - 1)
        gaps[rng.random(length - 1) < 0.1] = nearness
        t = origin + np.append(0, np.cumsum(gaps)) / gaps.sum()
        phase = rng.uniform(0, 6, 3)
        movements.append((t, place + np.sin(4 * (t - origin)[:, None] + phase)))
    return movements


def _demonstrations(movements):
    # Every other column of a wider array: not contiguous.
    wide = [np.repeat(x, 2, axis=1)[:, ::2] for _, x in movements]
    return Demonstrations.from_arrays(wide, times=[t for t, _ in movements])


def _check_smooth(actual, movement, at, tolerance=1e-7):
    """Smoothed positions (S, d) at the shares `at` of a movement's duration, beside SciPy's.

    SciPy's spline is a product of B-splines, whose bands cancel where stamps nearly coincide: at 1e-3 of a step it is
    off by up to 5e-7 of the extent, the second derivatives that we solve for by 1e-11. Where the two differ by more
    than the tolerance, 50 digits decide, and allow us less.
    """
    t, x = movement
    u, lam = (t - t[0]) / (t[-1] - t[0]), (len(t) - 1) / (2 * np.pi * 6.0) ** 4
    at, x, extent = u if at is None else at, x - x[0], np.ptp(x, axis=0).max()
    if np.abs(actual - make_smoothing_spline(u, x, lam)(at)).max() > tolerance * extent:
        assert np.abs(actual - exact_smoothing_spline(u, x, lam)(at)).max() <= 1e-2 * tolerance * extent


def _spline_rows(demos):
    return spline_rows(demos.times, demos.positions, demos.offsets, 33)


def _company(seed, n, least):
    """Ragged movements of extents over 12 powers of ten, long and short ones next to each other."""
    rng = np.random.default_rng(seed)
    movements = []
    for _ in range(n):
        length = int(rng.integers(least, rng.choice([8, 120])))
        t = np.append(0, np.cumsum(rng.uniform(0.3, 1.7, length - 1)))
        movements.append((t, 10.0 ** rng.uniform(-6, 6) * rng.normal(size=(length, 2)).cumsum(axis=0)))
    return movements


def _within_its_extent(actual, expected, tolerance):
    assert np.abs(actual - expected).max() <= tolerance * np.ptp(expected, axis=0).max()


@given(seed=st.integers(0, 10**6))
def test_splines_of_many_movements_are_those_of_scipy_in_units_of_each_extent(compiled, seed):
    movements = _company(seed, examples(60, 200), least=4)  # several blocks of lanes
    rows = _spline_rows(_demonstrations(movements))
    for (t, x), row in zip(movements, rows, strict=True):
        _within_its_extent(row.T, CubicSpline(t, x - x[0])(np.linspace(0, t[-1], 33)), 1e-9)


@settings(max_examples=examples(1, 20))
@example(seed=1)
@given(seed=st.integers(0, 10**6))
def test_smoothing_splines_of_many_movements_are_those_of_scipy_in_units_of_each_extent(compiled, seed):
    movements = _company(seed, examples(60, 200), least=5)
    demos = _demonstrations(movements)
    rows = smooth_rows(demos, 0, len(demos), 6.0, 33)
    for movement, row, one in zip(movements, rows, preprocess(demos, [Smooth(6.0)]), strict=True):
        _check_smooth(row.T, movement, np.linspace(0, 1, 33))
        _check_smooth(one.positions - movement[1][0], movement, None)


any_ragged = given(
    seed=st.integers(0, 10**6),
    origin=st.sampled_from([0.0, -7.0, 1.7e9]),  # the last one is a ROS stamp
    place=st.sampled_from([0.0, -1e4]),
)


@any_ragged
def test_splines_are_those_of_scipy(compiled, seed, origin, place):
    movements = _ragged(seed, least=4, origin=origin, place=place)
    rows = _spline_rows(_demonstrations(movements))
    for (t, x), row in zip(movements, rows, strict=True):
        even = np.linspace(0, t[-1] - t[0], 33)
        np.testing.assert_allclose(row, CubicSpline(t - t[0], x - x[0])(even).T, atol=1e-9)


@any_ragged
@example(seed=1482, origin=-7.0, place=0.0)  # SciPy's is off by 4.8e-7
def test_smoothing_splines_are_those_of_scipy(compiled, seed, origin, place):
    movements = _ragged(seed, least=5, origin=origin, place=place)
    smoothed = preprocess(_demonstrations(movements), [Smooth(6.0)])
    for movement, one in zip(movements, smoothed, strict=True):
        _check_smooth(one.positions - movement[1][0], movement, None)


def test_what_fifty_digits_give_is_the_minimizer():
    t, x = _ragged(1482, least=5, origin=-7.0)[1]
    u, lam = (t - t[0]) / (t[-1] - t[0]), (len(t) - 1) / (2 * np.pi * 6.0) ** 4
    exact = exact_smoothing_spline(u, x, lam)
    third = np.vstack((np.zeros((1, 3)), 6 * exact.c[0], np.zeros((1, 3))))
    np.testing.assert_allclose(exact(u) + lam * np.diff(third, axis=0), x, atol=1e-9)


@settings(max_examples=examples(3))
@any_ragged
def test_smoothing_splines_between_the_samples_are_those_of_scipy(compiled, seed, origin, place):
    movements = _ragged(seed, least=5, n=40, origin=origin, place=place)
    rows = smooth_rows(_demonstrations(movements), 3, 40, 6.0, 33)
    for movement, row in zip(movements[3:], rows, strict=True):
        _check_smooth(row.T, movement, np.linspace(0, 1, 33), tolerance=1e-6)


def test_movements_too_long_to_be_worked_on_side_by_side_are_the_same(compiled, monkeypatch):
    demos = _demonstrations(_ragged(0, least=5))
    before = relative_rows(demos, 0, 6, 33), smooth_rows(demos, 0, 6, 8.0, 33), Smooth(8.0).apply(demos).positions
    monkeypatch.setattr("kineme.movements.preparation.smooth._LONGEST", 20)
    after = relative_rows(demos, 0, 6, 33), smooth_rows(demos, 0, 6, 8.0, 33), Smooth(8.0).apply(demos).positions
    for one, other in zip(before, after, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)


@pytest.mark.parametrize("share", [1.0, 0.4])
@given(seed=st.integers(0, 10**6), n_dims=st.integers(1, 4))
def test_arc_length_is_the_same_compiled_through_pauses_and_at_rest(share, seed, n_dims):
    rng = np.random.default_rng(seed)
    paths = np.cumsum(rng.normal(size=(3, n_dims, 70)), axis=2)
    paths[0, :, 20:40] = paths[0, :, 20:21]
    paths[1] = 7.0
    expected = resample_by_phase(paths, arc_length_phase(paths, share), 31)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("KINEME_COMPILED", "always")
        np.testing.assert_allclose(resample_by_arc_length(paths, 31, share), expected, atol=1e-9)


@settings(max_examples=examples(3))
@given(seed=st.integers(0, 10**6), nearness=st.sampled_from([1e-5, 1e-7]))
@example(seed=0, nearness=1e-9)
def test_nearly_duplicate_stamps_do_no_harm_to_exact_data(compiled, seed, nearness):
    """Between samples of a cubic the spline is that cubic, though chords over 1e-7 of a step are all rounding."""
    for t, _ in _ragged(seed, least=5, nearness=nearness):
        cubic = np.polynomial.Polynomial([0, 1, -2, 1.5])
        rows = spline_rows(t, cubic(t)[:, None], np.array([0, len(t)]), 50)
        np.testing.assert_allclose(rows[0, 0], cubic(np.linspace(0, 1, 50)), atol=1e-6)


@pytest.mark.parametrize("n_in", [4, 5, 50])
def test_the_spline_matrix_is_the_spline_of_scipy(n_in):
    y = np.random.default_rng(n_in).normal(size=n_in)
    expected = CubicSpline(np.linspace(0, 1, n_in), y)(np.linspace(0, 1, 37))
    np.testing.assert_allclose(spline_matrix(n_in, 37) @ y, expected, atol=1e-12)


def test_the_spline_matrix_is_of_fourth_order():
    fine = np.linspace(0, 1, 501)
    errors = [
        np.abs(spline_matrix(n, 501) @ np.sin(9 * np.linspace(0, 1, n)) - np.sin(9 * fine)).max() for n in (41, 81, 161)
    ]
    assert (np.log2(np.divide(errors[:-1], errors[1:])) > 3.8).all()


def test_spline_rows_are_of_fourth_order_on_irregular_stamps(compiled):
    fine, errors = np.linspace(0, 1, 501), []
    for n in (41, 81, 161):
        v = np.linspace(0, 1, n)
        u = v + 0.05 * np.sin(2 * np.pi * v)
        rows = spline_rows(u, np.sin(9 * u)[:, None], np.array([0, n]), 501)
        errors.append(np.abs(rows[0, 0] - np.sin(9 * fine)).max())
    assert (np.log2(np.divide(errors[:-1], errors[1:])) > 3.8).all()


def test_cubics_are_resampled_exactly(compiled):
    u = np.sort(np.append([0, 1], np.random.default_rng(0).random(20)))
    x = 1 + u - 3 * u**2 + 2 * u**3
    even = np.linspace(0, 1, 40)
    np.testing.assert_allclose(
        spline_rows(u, x[:, None], np.array([0, 22]), 40)[0, 0], even - 3 * even**2 + 2 * even**3, atol=1e-12
    )


def test_resampling_an_even_movement_again_changes_nothing(make_movement):
    demos = Demonstrations.from_arrays([make_movement(i, n_samples=50 + i, even=False)[1] for i in range(4)])
    once = preprocess(demos, [Resample(80)])
    twice = preprocess(once, [Resample(80)])
    np.testing.assert_allclose(twice.positions, once.positions, rtol=1e-13)
    np.testing.assert_array_equal(twice.times, once.times)


def test_resampling_keeps_start_goal_and_duration(make_movement):
    t, x = make_movement(1, even=False)
    one = preprocess(Demonstrations.from_arrays([x], times=[t + 9]), [Resample(33)])[0]
    np.testing.assert_allclose(one.positions[[0, -1]], x[[0, -1]], rtol=1e-12)
    assert one.duration == pytest.approx(t[-1])
    assert len(one) == 33


def test_what_does_not_move_stays_where_it_is_beside_what_moves(compiled):
    """What reached it from its neighbors would be all of its size."""
    rng = np.random.default_rng(0)
    arrays = [1e50 * rng.normal(size=(30, 2)), np.ones((20, 2)), rng.normal(size=(30, 2)), np.zeros((4, 2))]
    arrays[2][:, 1] = 3.0
    rows = smooth_rows(Demonstrations.from_arrays(arrays), 0, 4, 10.0, 50)
    assert not rows[[1, 3]].any()
    assert not rows[2, 1].any()
    assert rows[2, 0].any()
