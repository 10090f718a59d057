"""The density of paths under an average: proper, and of those that belong to it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from kineme import DMP
from kineme.dmp.styles.parameters import map_rows, path_matrix
from kineme.errors import SpecificationError, TrajectoryError
from kineme.styles import average


def test_it_is_the_density_of_the_gaussian_written_out(dmp, demonstrate):
    learned = dmp.learn(demonstrate(8))
    mean, asked = average(learned[:6]), learned[5:]
    paths = asked.rollout().positions.transpose(0, 2, 1).reshape(3, -1)
    center = mean.primitive.rollout().positions[0].T.ravel()
    B = map_rows(mean.factor, path_matrix(dmp, dmp.n_points)).reshape(6, -1)
    for noise in (None, 0.3):
        sigma = mean.noise if noise is None else noise
        covariance = B.T @ B + sigma**2 * np.eye(B.shape[1])
        expected = multivariate_normal(center, covariance).logpdf(paths)
        np.testing.assert_allclose(mean.log_likelihood(asked, noise), expected, rtol=1e-8)


def test_the_noise_is_what_the_others_do_not_explain(demonstrate):
    """Each demonstration against least squares on the others, written out."""
    dmp = DMP(n_basis=15, n_points=60)
    learned = dmp.learn(demonstrate(5))
    paths = learned.rollout().positions.transpose(0, 2, 1).reshape(5, -1)
    squares = []
    for i in range(5):
        others = np.delete(paths, i, axis=0)
        spanned = (others[1:] - others[0]).T
        found = np.linalg.lstsq(spanned, paths[i] - others[0], rcond=None)[0]
        squares.append(np.sum((spanned @ found - paths[i] + others[0]) ** 2))
    assert average(learned).noise == pytest.approx(np.sqrt(np.mean(squares) / (120 - 3)), rel=1e-6)


def test_the_estimated_noise_is_that_of_the_recordings(two_styles):
    """Two ways to differ and white noise: nothing else is left."""
    dmp = DMP(n_basis=60, ridge=1e-12, n_points=200)
    noisy = average(dmp.learn(two_styles(12, noise=0.05)[0]))
    share = np.sqrt(60 / 200)  # of white noise that so many basis functions follow
    assert noisy.noise == pytest.approx(0.05 * share, rel=0.2)


def test_own_movements_are_more_likely_than_others_also_when_left_out(demonstrate):
    shapes = [DMP().learn(demonstrate(1, seed).positions + 0.3 * wobble(seed)) for seed in range(3)]
    models = [average(shape[:5]) for shape in shapes]
    found = np.array([[model.log_likelihood(shape[5:]).mean() for model in models] for shape in shapes])
    assert (found.argmax(axis=1) == np.arange(3)).all()


def wobble(seed):
    """Eight smooth deviations (8, 50, 2)."""
    u = np.linspace(0, 1, 50)
    waves = np.sin(np.pi * np.arange(1, 4)[:, None] * u)
    return (np.random.default_rng(seed).normal(size=(8, 2, 3)) @ waves).transpose(0, 2, 1)


def test_conditioning_makes_likely_what_was_asked_for(two_styles):
    paths, amounts = two_styles(20)
    learned = DMP().learn(paths)
    mean = average(learned)
    chosen = int(np.argmax(amounts[:, 0]))
    point = learned[chosen].rollout(n_samples=101).positions[0, 50]
    now = mean.condition(t=0.5, position=point, std=0.05)
    assert now.noise == mean.noise
    assert now.log_likelihood(learned[chosen], 0.01)[0] > mean.log_likelihood(learned[chosen], 0.01)[0]
    other = int(np.argmin(amounts[:, 0]))
    assert now.log_likelihood(learned[other], 0.01)[0] < mean.log_likelihood(learned[other], 0.01)[0]


def test_movements_are_learned_first_and_each_is_alone(demonstrate):
    demos = demonstrate(5)
    mean = average(DMP(n_basis=15).learn(demos))
    alone = [mean.log_likelihood(demos[i : i + 1])[0] for i in range(5)]
    np.testing.assert_allclose(mean.log_likelihood(demos), alone, rtol=1e-9)
    np.testing.assert_array_equal(mean.log_likelihood(demos), mean.log_likelihood(DMP(n_basis=15).learn(demos)))


def test_what_cannot_be_is_refused(demonstrate):
    learned = DMP(n_basis=15).learn(demonstrate(5))
    for few in (learned[:1], learned[:2], learned[[0, 0, 0, 0]]):
        assert average(few).noise is None
        with pytest.raises(
            SpecificationError, match=r"expected noise, which \d demonstrations cannot tell; pass noise="
        ):
            average(few).log_likelihood(learned)
        assert np.isfinite(average(few).log_likelihood(learned, noise=0.1)).all()
    many = DMP(n_basis=4, n_points=20).learn(demonstrate(20))
    assert average(many).noise is None  # they explain every path that four basis functions can make
    mean = average(learned)
    with pytest.raises(SpecificationError, match="expected noise to be a number above 0, got 0"):
        mean.log_likelihood(learned, noise=0)
    with pytest.raises(SpecificationError, match="expected primitives of the same specification"):
        mean.log_likelihood(DMP(n_basis=12).learn(demonstrate(2)))
    with pytest.raises(SpecificationError, match="expected movements of 2 dimensions, got 3"):
        mean.log_likelihood(demonstrate(2, n_dims=3))
    with pytest.raises(TrajectoryError):
        mean.log_likelihood([])
