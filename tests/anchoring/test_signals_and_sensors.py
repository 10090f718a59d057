"""Signals and sensors without labels: profiles and recorded values tell them apart, too, as with labels."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from sklearn.metrics import adjusted_rand_score

from kineme import ActionLibrary, Demonstrations
from kineme.anchoring.proposals import propose
from kineme.recognition.classifiers import squares_beside_kernels
from kineme.similarity.describe import describe
from kineme_experiments.evaluation.data import load_data
from unlabeled_samples import draw_kinds, recovered


def at_levels(d, seed):
    """Two shapes, each recorded around two levels: four kinds, of which translation hides two."""
    demos = draw_kinds([20, 20], d=d, seed=seed)
    level = np.arange(len(demos)) % 2
    arrays = [demos[i].positions + 8 * level[i] for i in range(len(demos))]
    labels = [f"{label} at {at}" for label, at in zip(demos.labels, level, strict=True)]
    return Demonstrations.from_arrays(arrays, labels)


@pytest.mark.parametrize("d", [2, 3])
def test_paths_are_told_apart_by_the_kernels_alone(d):
    shares, squares = squares_beside_kernels(describe(at_levels(d, 0)))
    assert shares.shape == (0,)
    assert squares.shape == (0, 40, 40)


@pytest.mark.parametrize("d", [1, 5])
def test_values_are_compared_in_units_of_their_spread(d):
    """A unit of its own in each column changes nothing, and levels are what differs most."""
    demos = at_levels(d, 0)
    shares, (profiles, values) = squares_beside_kernels(describe(demos))
    assert shares.sum() < 0.5
    same = np.array([label[-1] for label in demos.labels])
    apart = same[:, None] != same
    assert values[apart].min() > 4 * values[~apart].max()
    assert 0.5 < profiles[apart].mean() / profiles[~apart].mean() < 1.5
    scaled = [demos[i].positions * np.linspace(1, 30, d) - 5 for i in range(len(demos))]
    assert_allclose(squares_beside_kernels(describe(scaled))[1][1], values, atol=1e-6)


def test_levels_tell_sensors_apart():
    """By the kernels alone 0.35: two halves of each shape by chance."""
    scores = [recovered(demos.labels, propose(demos, n_clusters=4)) for demos in (at_levels(5, k) for k in range(4))]
    assert np.mean(scores) > 0.42


def test_sensors_are_proposed_in_any_order_as_a_library_proposes_them(tmp_path):
    demos = at_levels(5, 3)
    order = np.random.default_rng(0).permutation(len(demos))
    clusters = propose(demos, n_clusters=4).clusters
    assert adjusted_rand_score(clusters[order], propose(demos[order], n_clusters=4).clusters) == 1.0
    with ActionLibrary(tmp_path, create=True) as library:
        library.learn(Demonstrations.from_arrays([demos[i].positions for i in range(len(demos))]))
        by_position = library.propose(n_clusters=4).by_position.clusters
    assert adjusted_rand_score(clusters, by_position) == 1.0


def test_exercises_at_a_wrist_are_told_apart(development_data):
    """By the kernels alone 0.25, and 0.34 where it is said that there are seven."""
    data = load_data(str(development_data / "exercises6d.npz"))
    assert recovered(data.demonstrations.labels, propose(data.demonstrations)) > 0.4
    assert recovered(data.demonstrations.labels, propose(data.demonstrations, n_clusters=7)) > 0.4
