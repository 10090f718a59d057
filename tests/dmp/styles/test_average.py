"""The average: its path is the mean path, and its spread that of the demonstrations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme import DMP
from kineme.errors import TrajectoryError
from kineme.styles import average, average_by_label, learn_styles

any_seed = given(seed=st.integers(0, 10**6))


def covariance(factor):
    rows = factor.reshape(len(factor), -1)
    return rows.T @ rows


@any_seed
def test_the_average_of_one_movement_shown_again_and_again_is_that_movement(dmp, demonstrate, seed):
    one = dmp.learn(demonstrate(1, seed))
    mean = average(one[[0, 0, 0, 0, 0]])
    for field in ("scaled_weights", "starts", "goals", "durations"):
        np.testing.assert_array_equal(getattr(mean.primitive, field), getattr(one, field))
    np.testing.assert_allclose(mean.primitive.velocities, one.velocities, rtol=1e-14)
    np.testing.assert_allclose(mean.primitive.extents, np.ptp(one.rollout().positions, axis=1), rtol=1e-12)
    assert not mean.factor.any()
    assert not mean.tempo_factor.any()
    assert not mean.deviation(20).any()


@any_seed
def test_its_path_is_the_mean_of_the_paths(dmp, demonstrate, agree, seed):
    learned = dmp.learn(demonstrate(6, seed, n_dims=3))
    weights = np.random.default_rng(seed).uniform(0, 1, 6)
    for given_weights in (None, weights):
        mean = average(learned, given_weights).primitive
        moved = learned.rollout(n_samples=33)
        shares = np.ones(6) / 6 if given_weights is None else weights / weights.sum()
        agree(mean.rollout(n_samples=33).positions[0], np.tensordot(shares, moved.positions, 1), 1e-10)
        tangents = moved.velocities * learned.durations[:, None, None]
        agree(mean.rollout(n_samples=33).velocities[0] * mean.durations[0], np.tensordot(shares, tangents, 1), 1e-10)
        assert mean.durations[0] == pytest.approx(np.exp(shares @ np.log(learned.durations)), rel=1e-12)


def test_averaging_w_instead_would_miss_the_mean_path_of_the_original_formulation(make_movement):
    """One of three movements ends close to where it starts: its w are large, its path is not."""
    x = [make_movement(seed, n_samples=60)[1] for seed in (1, 2, 3)]
    x[2] = x[2] - 0.99 * np.linspace(0, 1, 60)[:, None] * (x[2][-1] - x[2][0])
    learned = DMP("original", n_basis=15, n_points=60).learn(x)
    expected = learned.rollout().positions.mean(axis=0)
    mean = average(learned).primitive
    w = learned.weights.mean(axis=0).T  # (d, N)
    naive = replace(mean, scaled_weights=((mean.goals - mean.starts)[:, :, None] * w))
    assert np.abs(mean.rollout().positions[0] - expected).max() < 1e-9
    assert np.abs(naive.rollout().positions[0] - expected).max() > 0.5 * np.ptp(expected)


def test_one_shape_in_several_sizes_has_one_w_and_the_average_keeps_it(make_movement, agree):
    x = make_movement(4)[1]
    learned = DMP("original", n_basis=15).learn([factor * x for factor in (0.5, 1.0, 3.0)])
    agree(average(learned).primitive.weights[0], learned.weights[1], 1e-8)


@any_seed
def test_averaging_commutes_with_translation(dmp, demonstrate, agree, seed):
    demos = demonstrate(5, seed)
    offset = np.random.default_rng(seed).normal(scale=10, size=2)
    moved = type(demos).from_arrays([one.positions + offset for one in demos], times=[one.times for one in demos])
    here, there = average(dmp.learn(demos)), average(dmp.learn(moved))
    agree(there.primitive.rollout().positions, here.primitive.rollout().positions + offset, 1e-9)
    agree(covariance(there.factor), covariance(here.factor), 1e-8)


@any_seed
def test_its_spread_is_that_of_the_demonstrations(dmp, demonstrate, agree, seed):
    """np.cov and the standard deviation of the rollouts are the witnesses; they never see a factor."""
    learned = dmp.learn(demonstrate(7, seed))
    shares = np.random.default_rng(seed).uniform(0.1, 1, 7)
    mean, weighted = average(learned), average(learned, shares)
    rows = learned.scaled_weights.reshape(7, -1)
    agree(covariance(mean.factor[:, :, :-3]), np.cov(rows.T), 1e-10)
    agree(covariance(weighted.factor[:, :, :-3]), np.cov(rows.T, aweights=shares), 1e-10)
    moved = learned.rollout(n_samples=41)
    agree(mean.deviation(41), moved.positions.std(axis=0, ddof=1), 1e-9)
    tau, per_tau = mean.primitive.durations[0], learned.durations[:, None, None]
    agree(mean.deviation(41, of="velocity"), (moved.velocities * per_tau).std(axis=0, ddof=1) / tau, 1e-9)
    agree(mean.deviation(41, of="acceleration"), (moved.accelerations * per_tau**2).std(axis=0, ddof=1) / tau**2, 1e-9)


def test_many_demonstrations_keep_a_factor_no_taller_than_wide(agree):
    rng = np.random.default_rng(5)
    x = np.cumsum(rng.normal(size=(60, 40, 1)), axis=1)
    learned = DMP(n_basis=5).learn(x)
    mean = average(learned)
    assert mean.factor.shape == (9, 1, 8)  # d (N + 3) + 1 for the tempo
    agree(covariance(mean.factor[:, :, :-3]), np.cov(learned.scaled_weights[:, 0].T), 1e-10)


def test_the_band_holds_as_many_movements_as_gaussian_theory_says(dmp, demonstrate):
    """Learned from one Gaussian sample, checked on another: 68.3 % within one deviation, 95.4 % within two."""
    truth = average(dmp.learn(demonstrate(5, 6)))
    learned, fresh = average(truth.sample(2000, 1)), truth.sample(2000, 2)
    away = np.abs(fresh.rollout(n_samples=50).positions - learned.primitive.rollout(n_samples=50).positions)
    for width, share in ((1.0, 0.6827), (2.0, 0.9545)):
        inside = (away <= width * learned.deviation(50)).mean(axis=0)
        assert np.abs(inside - share).max() < 0.05
        assert abs(inside.mean() - share) < 0.015


def test_the_covariance_of_samples_converges_with_the_root_of_their_number(demonstrate):
    mean = average(DMP(n_basis=10, n_points=60).learn(demonstrate(6, 7)))
    expected = covariance(mean.factor[:, :, :-3])
    sizes = np.array([100, 400, 1600, 6400])
    errors = np.zeros(len(sizes))
    for seed in range(8):
        rows = mean.sample(int(sizes[-1]), seed).scaled_weights.reshape(sizes[-1], -1)
        errors += [np.linalg.norm(np.cov(rows[:n].T) - expected) for n in sizes]
    order = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert -0.6 < order < -0.4
    assert errors[-1] / 8 < 0.05 * np.linalg.norm(expected)


def test_samples_are_repeatable_movements_with_tempi_of_their_own(demonstrate):
    learned = DMP(n_basis=10).learn(demonstrate(6, 8, labels=["wave"] * 6))
    mean = average(learned)
    some, same = mean.sample(500, 3), mean.sample(500, np.random.default_rng(3))
    np.testing.assert_array_equal(some.scaled_weights, same.scaled_weights)
    assert not np.array_equal(some.scaled_weights, mean.sample(500, 4).scaled_weights)
    assert set(some.labels) == {"wave"}
    assert some.rollout(n_samples=20).positions.shape == (500, 20, 2)
    assert np.log(some.durations).std() == pytest.approx(np.log(learned.durations).std(ddof=1), rel=0.1)


def test_the_average_is_an_ordinary_primitive(dmp, demonstrate):
    mean = average(dmp.learn(demonstrate(4, 9))).primitive
    assert len(mean) == 1
    assert mean.labels is None
    assert mean.shape_attractor(30).shape == (1, 30, 2)
    ends = mean.rollout(goal=[[3.0, 1.0], [9.0, -4.0]], settle=1e-3).positions[:, -1]
    np.testing.assert_allclose(ends, [[3.0, 1.0], [9.0, -4.0]], atol=1e-3)


def test_weights_choose_and_ignore(dmp, demonstrate, agree):
    learned = dmp.learn(demonstrate(4, 10))
    weights = np.array([0.0, 2.0, 0.0, 0.0])
    weights.setflags(write=False)
    only = average(learned, weights)
    agree(only.primitive.rollout().positions, learned[1].rollout().positions, 1e-12)
    assert only.factor.shape[0] == 0
    assert not only.deviation(5).any()
    some, both = average(learned, [1, 0, 1, 0]), average(learned[[0, 2]])
    agree(some.primitive.scaled_weights, both.primitive.scaled_weights, 1e-12)
    agree(covariance(some.factor), covariance(both.factor), 1e-10)


@pytest.mark.parametrize("names", [["b", "a", "b", "a", "b"], [7, 3, 7, 3, 7]])
def test_one_average_for_each_label(demonstrate, names):
    learned = DMP(n_basis=10).learn(demonstrate(5, 11, labels=names))
    found = average_by_label(learned)
    assert list(found) == sorted(set(names))
    for label, mean in found.items():
        alone = average(learned[np.array(names) == label])
        np.testing.assert_array_equal(mean.primitive.scaled_weights, alone.primitive.scaled_weights)
        np.testing.assert_array_equal(mean.factor, alone.factor)
        assert mean.primitive.labels == [label]


def test_errors_say_what_came(demonstrate):
    learned = DMP(n_basis=10).learn(demonstrate(3, 12))
    with pytest.raises(TrajectoryError, match=r"one weight for each of the 3 primitives, got weights of shape \(2,\)"):
        average(learned, [1.0, 2.0])
    with pytest.raises(TrajectoryError, match=r"weights of 0 or more, got -2 for primitive 1"):
        average(learned, [1.0, -2.0, 1.0])
    with pytest.raises(TrajectoryError, match=r"got nan for primitive 2"):
        average(learned, [1.0, 2.0, np.nan])
    with pytest.raises(TrajectoryError, match=r"one weight above 0, got 3 zeros"):
        average(learned, [0.0, 0.0, 0.0])
    with pytest.raises(TrajectoryError, match=r"at least one primitive to average, got none"):
        average(learned[[]])
    with pytest.raises(TrajectoryError, match=r"expected labeled primitives, got none with a label"):
        average_by_label(learned)
    with pytest.raises(ValueError, match=r"of to be one of \['position', 'velocity', 'acceleration'\], got 'jerk'"):
        average(learned).deviation(10, of="jerk")
    with pytest.raises(ValueError, match=r"n_samples to be a whole number of at least 2, got 1"):
        average(learned).deviation(1)
    with pytest.raises(ValueError, match=r"n to be a whole number of at least 1, got 0"):
        average(learned).sample(0, 0)


def test_movements_are_learned_by_the_default_specification(demonstrate):
    demonstrations = demonstrate(4, 31)
    learned = DMP().learn(demonstrations)
    np.testing.assert_array_equal(average(demonstrations).factor, average(learned).factor)
    np.testing.assert_array_equal(learn_styles(demonstrations, 2).mean, learn_styles(learned, 2).mean)
