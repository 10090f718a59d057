"""Proposals find the kinds again, whatever the order, place, size and direction of the movements."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.cluster import AgglomerativeClustering

import kineme
from kineme.anchoring.proposals import describe_clusters, extend, propose
from kineme.errors import SpecificationError
from kineme.movements.preparation.perturbations import Perturbation
from kineme.recognition.recognizer import Recognizer
from kineme.similarity.describe import describe, describe_rows, feature_rows
from kineme.similarity.similarity import averaged, similarities
from kineme.similarity.specification import ComparisonSpecification
from movement_samples import draw_shapes
from soaking import SOAK, examples, slow, some
from unlabeled_samples import ALL_TOGETHER, draw_kinds, partition, recovered

METHODS = ("spectral", "agglomerative", "hdbscan")
seeds = st.integers(0, 10_000)
quick = settings(max_examples=examples(2, 5), deadline=None, derandomize=True)


@pytest.mark.parametrize("method", some(METHODS, 0))
def test_handwriting_without_labels(method):
    demos = kineme.load_lasa()
    assert recovered(demos.labels, propose(demos, method)) >= 0.95


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(2))
def test_handwriting_with_everything_perturbed(method, seed):
    demos = ALL_TOGETHER.apply(kineme.load_lasa(), seed)
    assert recovered(demos.labels, propose(demos, method)) >= 0.9


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("n_kinds", [5, 10, 15])
@pytest.mark.parametrize("seed", range(2))
def test_handwriting_in_part_and_unequal(n_kinds, seed):
    rng, demos = np.random.default_rng([seed, n_kinds]), kineme.load_lasa()
    shapes = rng.choice(np.unique(demos.labels), n_kinds, replace=False)
    chosen = [rng.choice(np.flatnonzero(demos.labels == one), rng.integers(3, 8), replace=False) for one in shapes]
    part = ALL_TOGETHER.apply(demos[np.concatenate(chosen)], seed)
    assert recovered(part.labels, propose(part)) >= 0.9


@pytest.mark.parametrize("method", METHODS)
@given(seed=seeds, d=st.sampled_from([1, 2, 3, 5] if SOAK else [1, 2, 3]))  # each d is compiled apart
@quick
def test_kinds_clearly_apart_are_found_exactly(method, d, seed):
    demos = draw_kinds([5, 4, 7, 6], d, seed, spread=0.02)
    proposals = propose(demos, method)
    assert recovered(demos.labels, proposals) == 1.0
    assert [len(one) for one in proposals.proposals] == [7, 6, 5, 4]
    assert all(one.stability > 0.75 for one in proposals.proposals)


@pytest.mark.parametrize("method", METHODS)
@given(seed=seeds, d=st.sampled_from([1, 2, 3]))
@quick
def test_the_order_of_the_movements_does_not_matter(method, seed, d):
    demos = ALL_TOGETHER.in_dimensions(d).apply(draw_kinds([5, 3, 6, 4], d, seed, spread=0.1), seed)
    order = np.random.default_rng(seed).permutation(len(demos))
    there, here = propose(demos[order], method), propose(demos, method)
    assert {frozenset(order[list(one)].tolist()) for one in partition(there)} == partition(here)
    assert {int(order[one.medoid]) for one in there.proposals} == {one.medoid for one in here.proposals}
    both = [sorted(one.stability for one in found.proposals) for found in (there, here)]
    np.testing.assert_allclose(*both)


@pytest.mark.parametrize("method", METHODS)
@given(seed=seeds, copied=st.integers(0, 17))
@quick
def test_copies_join_their_original(method, seed, copied):
    demos = draw_kinds([5, 3, 6, 4], 2, seed)
    proposals = propose(demos[[*range(18), copied, copied]], method)
    assert len(set(proposals.clusters[[copied, 18, 19]].tolist())) == 1


@given(seed=seeds, d=st.sampled_from([2, 3]))
@quick
def test_place_size_and_direction_do_not_matter(seed, d):
    """Two movements differ by up to twice the angle by which each is turned: 30 degrees stay within the 60."""
    demos = draw_kinds([5, 4, 6], d, seed, spread=0.03)
    turned = Perturbation(shift=3.0, scale=2.0, rotation=math.radians(30)).apply(demos, seed)
    assert partition(propose(turned)) == partition(propose(demos))


@given(seed=seeds)
@quick
def test_the_clusters_are_those_of_scikit_learn(seed):
    demos = draw_kinds([5, 4, 6, 3], 2, seed, spread=0.2)
    model = AgglomerativeClustering(n_clusters=5, metric="precomputed", linkage="average")
    expected = model.fit_predict(1.0 - similarities(demos))
    found = propose(demos, "agglomerative", n_clusters=5, min_members=2)
    large = {frozenset(np.flatnonzero(expected == k).tolist()) for k in range(5)}
    assert partition(found) == {one for one in large if len(one) >= 2}


def test_what_a_proposal_says():
    demos = draw_kinds([5, 4, 6], 2, 1)
    proposals, K = propose(demos), similarities(demos)
    between = np.array(
        [[K[np.ix_(a.members, b.members)].mean() for b in proposals.proposals] for a in proposals.proposals]
    )
    np.fill_diagonal(between, -1)
    for k, one in enumerate(proposals.proposals):
        inside = K[np.ix_(one.members, one.members)]
        assert one.cohesion == pytest.approx(inside[~np.eye(len(one), dtype=bool)].mean())
        assert one.medoid == one.members[inside.sum(axis=1).argmax()]
        assert (one.nearest, one.nearness) == (between[k].argmax(), pytest.approx(between[k].max()))
        assert set(proposals.clusters[one.members].tolist()) == {k}


def test_a_strange_movement_is_left_over():
    demos = draw_kinds([5, 6, 1, 7, 1], 2, 3, spread=0.03)
    proposals = propose(demos)
    assert proposals.left_over.tolist() == [11, 19]
    assert repr(proposals) == "Proposals(3 clusters among 20 movements, 2 left over)"
    assert repr(propose(demos[:5], n_clusters=1)) == "Proposals(1 cluster among 5 movements, 0 left over)"
    assert repr(proposals[0]).startswith("Proposal(7 movements, medoid 1")


@pytest.mark.parametrize("d", [1, 2, 3])
def test_stored_feature_rows_say_the_same(d):
    demos = draw_kinds([4, 5, 3], d, 0)
    blocks = feature_rows(demos, ComparisonSpecification())
    rows = describe_rows(np.concatenate(blocks, axis=1).astype(np.float32), d)
    np.testing.assert_array_equal(similarities(rows), similarities(demos))
    assert partition(propose(rows)) == partition(propose(demos))


@pytest.mark.soak
@pytest.mark.parametrize("d", [slow(1), 2])
def test_more_movements_than_are_compared_at_once(d):
    demos = draw_kinds([60, 90, 40, 70, 3, 1], d, 5, spread=0.04)
    whole, sampled = propose(demos), propose(demos, max_clustered=120)
    assert recovered(demos.labels, whole) > 0.98
    assert recovered(demos.labels, sampled) > 0.93
    assert 263 in sampled.left_over  # the strange one has no kind to join
    assert [len(one) for one in sampled.proposals] == sorted((len(one) for one in sampled.proposals), reverse=True)
    for k, one in enumerate(sampled.proposals):
        assert one.medoid in one.members
        assert np.array_equal(one.members, np.flatnonzero(sampled.clusters == k))


def test_what_was_not_sampled_joins_its_kind_or_none():
    demos = draw_kinds([12, 10, 1, 1], 2, 3, spread=0.03)
    described, sample = describe(demos), np.r_[0:8, 12:19]
    some = described.take(sample)
    similarity = averaged(some)
    K = similarities(some, widths=similarity.widths)
    clusters = np.repeat([0, 1], [8, 7])
    found = describe_clusters(K, clusters, np.ones(2), similarity.widths)
    joined = extend(described, sample, K, found, similarity)
    assert joined.clusters.tolist() == [0] * 12 + [1] * 10 + [-1, -1]
    assert [len(one) for one in joined.proposals] == [12, 10]
    assert [one.nearest for one in joined.proposals] == [1, 0]


def test_the_averaged_kernel_is_the_recognizers():
    """At the recognizer's widths and with equal weights it is the recognizer's, entry by entry."""
    demos = draw_kinds([4, 4, 4], 2, 0)
    fitted = Recognizer(weights="equal").fit(demos)
    ours = similarities(describe(demos), widths=fitted.widths_)
    np.testing.assert_allclose(ours, np.exp(fitted.log_similarity(fitted.demonstrations_)), atol=1e-5)


def test_widths_without_labels_are_near_those_with_labels():
    demos = draw_kinds([5, 6, 4, 7, 5], 2, 0, spread=0.03)
    found, told = propose(demos).widths, Recognizer().fit(demos).widths_
    np.testing.assert_allclose(found, told, rtol=0.25)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"method": "k-means"}, r"method to be one of \['spectral', 'agglomerative', 'hdbscan'\], got 'k-means'"),
        ({"min_members": 1}, "expected min_members to be a whole number of at least 2, got 1"),
        ({"n_clusters": 0}, "expected n_clusters to be a whole number of at least 1, got 0"),
        ({"n_clusters": 13}, "expected n_clusters of at most 12, the number of movements, got 13"),
        ({"n_clusters": 3, "method": "hdbscan"}, "expected no n_clusters with method='hdbscan', got 3"),
        ({"max_clustered": 2}, "expected max_clustered to be a whole number of at least 3, got 2"),
    ],
)  # fmt: skip
def test_parameters_out_of_range(wrong, message):
    with pytest.raises(kineme.errors.SpecificationError, match=message):
        propose(draw_kinds([4, 4, 4]), **wrong)


def test_movements_that_cannot_be_told_apart():
    demos = draw_kinds([4, 4])
    with pytest.raises(kineme.errors.SpecificationError, match=r"expected at least 3 movements .* got 2"):
        propose(demos[:2])
    with pytest.raises(kineme.errors.SpecificationError, match="got copies of one movement"):
        propose(demos[[0, 0, 0, 0]])
    for movement in range(len(demos)):  # also where rounding tells copies apart
        with pytest.raises(kineme.errors.SpecificationError, match="got copies of one movement"):
            propose(demos[[movement] * 20])
    with pytest.raises(
        kineme.errors.SpecificationError, match=r"expected widths to be 7 numbers above 0.* got \[1.0, -1.0\]"
    ):
        similarities(demos, widths=[1.0, -1.0])
    with pytest.raises(
        kineme.errors.TrajectoryError, match=r"expected feature rows of shape \(n, 534\).* got shape \(8, 5\)"
    ):
        describe_rows(np.zeros((8, 5)), 2)
    with pytest.raises(IndexError, match="one of 2 proposals, got 2"):
        propose(demos)[2]


def test_movements_that_do_not_move_are_one_cluster_or_refused():
    still = [np.full((30, 3), float(i)) for i in range(8)]
    moving = [one.positions for one in draw_shapes([2] * 2, 3)]
    with pytest.raises(SpecificationError, match="got copies of one movement"):
        propose(still)
    assert len(set(propose(still + moving).clusters[:8].tolist())) == 1
