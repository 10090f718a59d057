"""What rivals are given: what is taken out of movements before they are compared, and what is not."""

import numpy as np
import pytest

import kineme
from kineme.movements.preparation.perturbations import Perturbation
from kineme_experiments.evaluation.linear_classifiers import MiniRocket
from kineme_experiments.evaluation.neighbors import DTWNeighbor, EuclideanNeighbor, average_linkage
from kineme_experiments.evaluation.paths import paths_over_length, paths_over_time


@pytest.fixture(scope="module")
def letters():
    return kineme.load_lasa(["CShape", "GShape", "NShape"])[::3]


@pytest.mark.parametrize("paths", [paths_over_length, paths_over_time])
def test_paths_are_centered_and_of_unit_size_in_every_dimension(make_small, paths):
    for n_dims in (2, 3, 6):
        found = paths(make_small(n_dims=n_dims), 50)
        assert found.shape == (16, n_dims, 50)
        np.testing.assert_allclose(found.mean(axis=2), 0.0, atol=1e-12)
        np.testing.assert_allclose((found**2).sum(axis=1).mean(axis=1), 1.0)


def _distance(one, other):
    return float(np.sqrt(((one - other) ** 2).sum(axis=1).mean(axis=1)).mean())


def test_over_length_timing_does_not_matter_and_over_time_it_does(letters):
    warped = Perturbation(warp=0.5).apply(letters, 0)
    assert _distance(paths_over_length(warped, 100), paths_over_length(letters, 100)) < 0.02
    assert _distance(paths_over_time(warped, 100), paths_over_time(letters, 100)) > 0.2


def test_paths_over_length_are_smoothed_first_so_that_noise_adds_no_length(letters):
    noisy = Perturbation(noise=0.02).apply(letters, 0)
    assert _distance(paths_over_length(noisy, 100), paths_over_length(letters, 100)) < 0.03


def test_who_compares_over_length(letters):
    """Rivals are given the positions in which they do best, and DTW both, as recognition-beside-others.md says."""
    warped = Perturbation(warp=0.5).apply(letters, 0)

    def moved(contender):
        rows = [np.asarray(contender.describe(one)) for one in (letters, warped)]
        return np.abs(rows[0] - rows[1]).mean() / np.abs(rows[0]).mean()

    assert moved(EuclideanNeighbor()) < 0.05
    assert moved(DTWNeighbor(along_path=True)) < 0.05
    assert moved(DTWNeighbor()) > 0.1


def test_minirocket_does_not_mind_the_timing(letters):
    pytest.importorskip("aeon")
    contender = MiniRocket(0)
    contender.fit(letters)
    assert contender.classify(Perturbation(warp=0.5).apply(letters, 0))[0].tolist() == letters.labels.tolist()


def test_average_linkage_finds_what_is_apart():
    points = np.array([0.0, 0.1, 0.2, 5.0, 5.1, 9.0])
    clusters = average_linkage(np.abs(points[:, None] - points), 3)
    assert len(set(clusters[:3])) == len(set(clusters[3:5])) == 1
    assert len(set(clusters)) == 3
