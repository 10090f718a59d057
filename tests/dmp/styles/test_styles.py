"""Styles: what they explain, that they are found again, and that they do not depend on the order of things."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.decomposition import PCA

from kineme import DMP
from kineme.dmp.styles.model import METRICS
from kineme.styles import average, learn_styles

any_seed = given(seed=st.integers(0, 10**6))
each_metric = pytest.mark.parametrize("metric", METRICS)


@each_metric
@any_seed
def test_all_styles_together_reproduce_the_demonstrations(dmp, demonstrate, agree, metric, seed):
    learned = dmp.learn(demonstrate(5, seed))
    model = learn_styles(learned, 4, metric=metric)
    again = model.primitive(model.styles)
    agree(again.rollout().positions, learned.rollout().positions, 1e-8)
    agree(again.velocities, learned.velocities, 1e-8)
    agree(again.durations, learned.durations, 1e-8)


@each_metric
@any_seed
def test_what_styles_leave_over_is_the_rest_of_the_spectrum(dmp, demonstrate, metric, seed):
    """Eckart and Young (1936): the squared residuals of J styles sum to the squares of the other singular values."""
    learned = dmp.learn(demonstrate(6, seed))
    rest = []
    for J in range(1, 6):
        model = learn_styles(learned, J, metric=metric)
        rest.append(np.sum(model.style_of(learned).residuals ** 2))
        left = np.sum(model.singular_values[J:] ** 2)
        assert rest[-1] == pytest.approx(left, rel=1e-7, abs=1e-12 * np.sum(model.singular_values**2))
    assert (np.diff(rest) < 0).all()


@any_seed
def test_styles_of_paths_are_the_principal_components_of_paths(dmp, demonstrate, agree, seed):
    """A foreign witness, scikit-learn, on the generated paths themselves; up to its signs."""
    learned = dmp.learn(demonstrate(6, seed))
    model = learn_styles(learned, 3)
    paths = learned.rollout().positions.transpose(0, 2, 1)
    paths = (paths - paths[:, :, :1]).reshape(6, -1)
    pca = PCA(3).fit(paths)
    agree(model.explained_variance[:3], pca.explained_variance_ratio_, 1e-9)
    scores = pca.transform(paths)
    agree(np.abs(model.styles), np.abs(scores / np.sqrt(np.mean(scores**2, axis=0))), 1e-6)


@each_metric
@any_seed
def test_neither_sign_nor_order_depends_on_the_order_of_the_demonstrations(dmp, demonstrate, agree, metric, seed):
    learned = dmp.learn(demonstrate(6, seed))
    order = np.random.default_rng(seed).permutation(6)
    model, other = learn_styles(learned, 3, metric=metric), learn_styles(learned[order], 3, metric=metric)
    agree(other.styles, model.styles[order], 1e-6)
    agree(other.directions, model.directions, 1e-6)
    np.testing.assert_array_equal(learn_styles(learned, 3, metric=metric).styles, model.styles)
    largest = np.take_along_axis(model.directions, np.abs(model.directions).argmax(axis=1)[:, None], axis=1)
    assert (largest > 0).all()


@each_metric
@any_seed
def test_styles_are_standardized_and_uncorrelated(dmp, demonstrate, agree, metric, seed):
    model = learn_styles(dmp.learn(demonstrate(6, seed)), 4, metric=metric)
    np.testing.assert_allclose(model.styles.mean(axis=0), 0, atol=1e-10)
    agree(model.styles.T @ model.styles / 6, np.eye(4), 1e-10)


@each_metric
@any_seed
def test_a_style_is_found_again_in_its_movement(dmp, demonstrate, agree, metric, seed):
    learned = dmp.learn(demonstrate(6, seed))
    model = learn_styles(learned, 3, metric=metric)
    agree(model.style_of(learned).styles, model.styles, 1e-8)
    options = np.random.default_rng(seed).uniform(model.lowest, model.highest, (10, 3))
    found = model.style_of(model.primitive(options))
    agree(found.styles, options, 1e-8)
    assert found.residuals.max() < 1e-8 * model.singular_values[0]
    assert found.inside.all()


def test_neither_place_nor_tempo_is_style(dmp, demonstrate, agree):
    demos = demonstrate(5, 21)
    model = learn_styles(dmp.learn(demos), 2)
    offset = np.array([50.0, -7.0])
    elsewhere = type(demos).from_arrays(
        [one.positions + offset for one in demos], times=[3.0 * one.times + 5.0 for one in demos]
    )
    agree(model.style_of(elsewhere).styles, model.styles, 1e-8)


def test_known_styles_are_recovered(dmp, two_styles):
    """Movements made of two known fields: two styles explain all, and span what they were made with."""
    x, amounts = two_styles(30, 1)
    model = learn_styles(dmp.learn(x), variance=0.9999)
    assert model.n_styles == 2
    centered = amounts - amounts.mean(axis=0)
    fitted = model.styles @ np.linalg.lstsq(model.styles, centered, rcond=None)[0]
    np.testing.assert_allclose(fitted, centered, atol=1e-6)


@any_seed
def test_a_noisy_new_demonstration_shows_its_style(dmp, two_styles, seed):
    """1 % noise on the largest extent moves a style by a few hundredths; the residual says how noisy it was."""
    model = learn_styles(dmp.learn(two_styles(30, 1)[0]), 2)
    clean, noisy = two_styles(20, seed)[0], two_styles(20, seed, noise=0.03)[0]
    expected, found = model.style_of(clean), model.style_of(noisy)
    assert np.sqrt(np.mean((found.styles - expected.styles) ** 2)) < 0.08
    assert expected.residuals.max() < 1e-3
    assert 0.01 < found.residuals.mean() < 0.1


def test_the_error_of_a_recovered_style_is_proportional_to_the_noise(two_styles):
    model = learn_styles(DMP(n_basis=15).learn(two_styles(30, 1)[0]), 2)
    clean = model.style_of(two_styles(50, 2)[0]).styles
    errors = [np.abs(model.style_of(two_styles(50, 2, noise)[0]).styles - clean).mean() for noise in (0.04, 0.02, 0.01)]
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 1.0, atol=1e-6)


@any_seed
def test_interpolation_keeps_its_ends_and_mixes_paths(dmp, demonstrate, agree, seed):
    learned = dmp.learn(demonstrate(4, seed))
    model = learn_styles(learned, 3)
    between = model.interpolate(model.styles[0], model.styles[2], 5)
    ends = model.primitive(model.styles[[0, 2]])
    assert len(between) == 5
    np.testing.assert_array_equal(between[[0, 4]].scaled_weights, ends.scaled_weights)
    np.testing.assert_array_equal(between[[0, 4]].starts, ends.starts)
    np.testing.assert_array_equal(between[[0, 4]].durations, ends.durations)
    a, b = learned[[0, 2]].rollout().positions
    for share, path in zip(np.linspace(0, 1, 5), between.rollout().positions, strict=True):
        agree(path, (1 - share) * a + share * b, 1e-8)
    agree(between[2].durations, np.sqrt(learned.durations[0] * learned.durations[2]), 1e-8)


@any_seed
def test_style_zero_is_the_average(dmp, demonstrate, agree, seed):
    learned = dmp.learn(demonstrate(5, seed))
    zero, mean = learn_styles(learned, 2).primitive([0.0, 0.0]), average(learned).primitive
    for field in ("scaled_weights", "starts", "goals", "velocities", "durations", "extents"):
        agree(getattr(zero, field), getattr(mean, field), 1e-10)


def test_a_generated_style_moves_to_any_goal(dmp, demonstrate):
    model = learn_styles(dmp.learn(demonstrate(5, 22, labels=["wave"] * 5)), 2)
    some = model.primitive(model.styles[:3])
    assert list(some.labels) == ["wave"] * 3
    ends = some.rollout(goal=[4.0, 2.0], settle=1e-3).positions[:, -1]
    np.testing.assert_allclose(ends, np.tile([4.0, 2.0], (3, 1)), atol=1e-3)


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9, 0.99, 1.0])
def test_the_fewest_styles_that_explain_the_asked_share(demonstrate, share):
    model = learn_styles(DMP(n_basis=15).learn(demonstrate(8, 23)), variance=share)
    explained = np.cumsum(model.explained_variance)
    assert explained[model.n_styles - 1] >= share - 1e-9
    assert model.n_styles == 1 or explained[model.n_styles - 2] < share
