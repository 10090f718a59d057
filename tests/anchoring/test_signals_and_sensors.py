"""Signals and sensors without labels: profiles and recorded values tell them apart, too, as with labels."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from sklearn.metrics import adjusted_rand_score

from kineme import ActionLibrary, Demonstrations
from kineme.anchoring import clustering
from kineme.anchoring.proposals import by_shape, own_order, propose
from kineme.recognition.classifiers import squares_beside_kernels
from kineme.similarity.describe import describe
from kineme.similarity.similarity import averaged, similarities
from kineme.similarity.specification import POSITIONS, ComparisonSpecification, Representation
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
    scaled = [demos[i].positions * np.linspace(30, 2, d) - 5 for i in range(len(demos))]
    assert_allclose(squares_beside_kernels(describe(scaled))[1][1], values, atol=1e-6)


@pytest.mark.parametrize(("d", "n_beside"), [(1, 2), (2, 0), (3, 0), (5, 2)])
def test_profiles_and_values_are_fused_with_what_is_compared_else(monkeypatch, d, n_beside):
    fused = []

    def fuse(squares, weights):
        fused.append((squares, weights))
        return clustering.fuse(squares, weights)

    monkeypatch.setattr("kineme.anchoring.proposals.clustering", SimpleNamespace(**vars(clustering) | {"fuse": fuse}))
    demos = at_levels(d, 0)
    propose(demos)
    (squares, weights), shape = fused[0], by_shape(describe(demos))
    assert len(squares) == len(weights) == shape.n_representations + n_beside
    assert weights.sum() == pytest.approx(1.0)
    assert weights[len(weights) - n_beside :].tolist() == [0.25, 0.15][:n_beside]
    ratio = weights[: shape.n_representations] / shape.own_weights
    assert_allclose(ratio, ratio[0])
    if n_beside:
        order = own_order(similarities(describe(demos), widths=averaged(describe(demos)).widths))
        assert_allclose(squares[-2:], squares_beside_kernels(describe(demos).take(order))[1], atol=1e-9)


@pytest.mark.parametrize("name", ["elastic", "turning", "cloud"])
def test_what_weighs_nothing_of_signals_leaves_them_proposed(name):
    """Of what is compared in detail only elastic paths weigh something; profiles are of the details all the same."""
    like = ComparisonSpecification((POSITIONS, Representation("elastic"), Representation(name, detailed=True)))
    demos = draw_kinds([8, 8], d=1)
    assert recovered(demos.labels, propose(demos, n_clusters=2, like=like)) == 1.0


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
    """By the kernels alone 0.25, and 0.24 where it is said that there are seven."""
    data = load_data(str(development_data / "exercises6d.npz"))
    assert recovered(data.demonstrations.labels, propose(data.demonstrations)) > 0.4
    assert recovered(data.demonstrations.labels, propose(data.demonstrations, n_clusters=7)) > 0.4
