"""Similarities that are fused over representations and neighbors, and the clusters that random walks seldom leave."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.metrics import adjusted_rand_score

from kineme import Demonstrations
from kineme.anchoring import clustering
from kineme.anchoring.clustering import NEIGHBORS, components, count_by_eigengap, fuse, set_apart, spectral
from kineme.anchoring.proposals import by_shape, link_people, propose
from kineme.errors import TrajectoryError
from kineme.similarity.describe import describe, squared_distances
from kineme.similarity.specification import ROW_REPRESENTATIONS, ComparisonSpecification
from soaking import SOAK, examples, slow
from unlabeled_samples import draw_kinds, recovered

quick = settings(max_examples=examples(2, 5), deadline=None, derandomize=True)
seeds = st.integers(0, 10_000)


def squares_of(*coordinates):
    """Squared distances (R, n, n) of points at coordinates (n, d) in each representation."""
    return np.stack([((x[:, None] - x) ** 2).sum(axis=2) for x in coordinates])


def points(seed, sizes=(20, 30, 25), apart=8.0):
    """Points (n, 3) in clusters of these sizes, and the cluster of each."""
    rng = np.random.default_rng(seed)
    which = np.repeat(np.arange(len(sizes)), sizes)
    centers = apart * np.eye(3)[np.arange(len(sizes)) % 3] * (1 + np.arange(len(sizes)) // 3)[:, None]
    return centers[which] + rng.normal(size=(len(which), 3)), which


@given(seed=seeds)
@quick
def test_fused_similarities_are_symmetric_and_follow_the_order(seed):
    squares = squares_of(points(seed)[0], points(seed + 1)[0])
    order = np.random.default_rng(seed).permutation(squares.shape[1])
    similar = fuse(squares)
    np.testing.assert_array_equal(similar, similar.T)
    assert similar.min() >= 0
    assert not similar.diagonal().any()
    np.testing.assert_allclose(fuse(squares[:, order[:, None], order]), similar[order[:, None], order], rtol=1e-9)


@given(seed=seeds, factor=st.sampled_from([1e-3, 0.3, 50.0]))
@quick
def test_the_unit_of_a_representation_does_not_matter(seed, factor):
    squares = squares_of(points(seed)[0], points(seed + 1)[0])
    scaled = squares * np.array([1.0, factor**2])[:, None, None]
    np.testing.assert_allclose(fuse(scaled), fuse(squares), rtol=1e-9)


def test_a_dense_and_a_loose_cluster_are_both_found():
    """Widths are those of each neighborhood: the loose one is 30 times as wide."""
    rng = np.random.default_rng(0)
    x = np.concatenate((rng.normal(size=(40, 2)), 30 * rng.normal(size=(40, 2)) + [250.0, 0.0]))
    similar = fuse(squares_of(x, x))
    assert count_by_eigengap(similar) == 2
    assert adjusted_rand_score(np.repeat([0, 1], 40), spectral(similar, 2)) == 1.0


def test_what_is_near_in_one_representation_or_the_other_is_connected():
    """Four pieces in a ring: each representation connects other neighbors, and both together all of them."""
    rng = np.random.default_rng(0)
    piece = np.repeat(np.arange(8), 12)  # two rings of four
    ring, k = np.divmod(piece, 4)
    there = rng.normal(size=(96, 2))
    first = there + 20.0 * np.stack((k // 2, 6 * ring), axis=1)
    second = there[::-1] + 20.0 * np.stack(((k + 1) % 4 // 2, 6 * ring), axis=1)
    similar = fuse(squares_of(first, second))
    assert adjusted_rand_score(ring, spectral(similar, 2)) == 1.0


def connected(similarities, sizes):
    """Similarities of movements of as many clusters as rows: 1 to their own, and those given to others."""
    which = np.repeat(np.arange(len(sizes)), sizes)
    noise = np.random.default_rng(0).uniform(0.9, 1.1, (len(which), len(which)))
    own = which[:, None] == which
    similar = np.where(own, 1.0, np.asarray(similarities)[which[:, None], which]) * (noise + noise.T)
    np.fill_diagonal(similar, 0.0)
    return which, similar


def test_kinds_of_a_few_groups_are_counted_although_the_gap_between_groups_is_the_largest():
    """Twelve kinds in three groups: the largest gap alone merges them, as it does a hundred words."""
    group = np.repeat(np.arange(3), 4)
    near = group[:, None] == group
    which, similar = connected(np.where(near, 0.3, 1e-2), [6] * 12)
    roots = np.sqrt(similar.sum(axis=1))
    values = np.linalg.eigvalsh(similar / roots / roots[:, None])[::-1]
    gaps = values[:-1] - values[1:]
    assert gaps[2] > gaps[11] > 0.15 * gaps[2]
    assert count_by_eigengap(similar) == 12
    assert adjusted_rand_score(which, spectral(similar, 12)) == 1.0
    assert count_by_eigengap(connected(np.where(near, 0.7, 1e-2), [6] * 12)[1]) == 3


def test_gaps_below_a_share_of_the_largest_count_for_nothing(monkeypatch):
    """However compact their clusters are."""
    vectors = np.linalg.qr(np.random.default_rng(0).normal(size=(12, 12)))[0]
    monkeypatch.setattr(clustering, "_mean_silhouette", lambda _, c: len(np.unique(c)) / 12)
    monkeypatch.setattr(clustering, "_by_directions", lambda _, c: np.arange(12) % c)
    for share, count in ((0.14, 2), (0.16, 4)):
        gaps = {2: 1.0, 4: share}
        falling = -np.cumsum([0.0, 0.0, *(gaps.get(c, 0.0) for c in range(2, 12))])
        monkeypatch.setattr(clustering, "eigh", lambda *_, falling=falling: (falling[::-1], vectors))
        assert count_by_eigengap(np.ones((12, 12))) == count


def test_clusterings_into_small_clusters_or_into_people_are_not_counted():
    """Twelve of two or of six movements in three groups; of six, made by one person each, or each by two."""
    group = np.repeat(np.arange(3), 4)
    similarities = np.where(group[:, None] == group, 0.3, 1e-2)
    small = connected(similarities, [2] * 12)[1]
    assert [count_by_eigengap(small, least) for least in (2, 3)] == [12, 3]
    which, similar = connected(similarities, [6] * 12)
    assert count_by_eigengap(similar, 3, which % 4) == 3
    assert count_by_eigengap(similar, 3, np.arange(72) % 2) == 12
    assert count_by_eigengap(similar, 3, np.zeros(72, dtype=np.intp)) == 12


@pytest.mark.parametrize("c", [2, 3, 7])
def test_as_many_clusters_as_nothing_connects(c):
    which = np.repeat(np.arange(c), 6)
    similar = (which[:, None] == which) * 1.0 - np.eye(6 * c)
    assert count_by_eigengap(similar + 1e-6) == c
    assert adjusted_rand_score(which, spectral(similar + 1e-6, c)) == 1.0


@pytest.mark.parametrize("count", [1, 2, 3, 4, 6, 9])
def test_exactly_as_many_proposals_as_are_asked_for(count):
    """Although some clusters of the first cut are too small to be proposed."""
    demos = draw_kinds([9, 4, 7, 5, 8, 6], spread=0.3)
    assert len(propose(demos, n_clusters=count)) == count


@given(seed=seeds, n_clusters=st.integers(1, 12), min_members=st.integers(1, 5))
@quick
def test_exactly_as_many_clusters_as_are_asked_for(seed, n_clusters, min_members):
    """Of anything: here there are none to be found."""
    x = np.random.default_rng(seed).normal(size=(12 * 5 * 2, 3))
    found = spectral(fuse(squares_of(x)), n_clusters, min_members)
    sizes = np.bincount(found[found >= 0])
    assert len(sizes) == n_clusters
    assert sizes.min() >= min_members


@pytest.mark.parametrize("count", [8, 9, 10])
def test_kinds_too_small_to_be_divided_are_all_proposed_where_more_are_asked_for(count):
    assert len(propose(draw_kinds([4] * 8), n_clusters=count)) == 8


def test_more_proposals_than_there_are_movements_for_are_not_made():
    demos = draw_kinds([5, 6])
    assert 2 <= len(propose(demos, n_clusters=11)) <= 3


@pytest.mark.parametrize(("ratio", "n"), [(4.5, 1), (5.5, 2)])
def test_components_are_five_times_the_usual_distance_to_a_neighbor_apart(ratio, n):
    """Between neighbors it is 2 on this line: the second nearest of one inside is at 1, at its ends at 2."""
    line = np.concatenate((np.arange(10.0), 9 + ratio + np.arange(10.0)))[:, None]
    assert components(squares_of(line)).max() + 1 == n


def test_only_small_components_are_set_apart():
    similar, group = np.ones((20, 20)), np.repeat([0, 1], [13, 7])
    apart = group[:, None] != group
    found = set_apart(similar, group)
    assert (found[~apart] == 1).all()
    assert (found[apart] < 0.01).all()
    np.testing.assert_array_equal(set_apart(similar, np.repeat([0, 1], [12, 8])), similar)


def test_rare_clusters_and_single_movements_are_told_from_a_large_one():
    demos = draw_kinds([80, 3, 60, 1], spread=0.04)
    proposals = propose(demos)
    assert [len(one) for one in proposals.proposals] == [80, 60, 3]
    assert proposals.left_over.tolist() == [143]


def test_the_forcing_term_is_left_out_where_pairs_are_compared():
    demos = draw_kinds([4, 4])
    assert by_shape(describe(demos).take([0, 3, 5])).n_representations == 6
    by_rows = describe(demos, ComparisonSpecification(representations=ROW_REPRESENTATIONS))
    assert by_shape(by_rows) is by_rows


def test_representations_in_which_nothing_differs_are_left_out():
    x = points(0)[0]
    one, both = squares_of(x, x), squares_of(x, x, np.zeros_like(x))
    np.testing.assert_array_equal(fuse(both), fuse(one))
    np.testing.assert_array_equal(components(both), components(one))


def draw_people(n_classes, n_people, each, seed, own=0.15, spread=0.04):
    """Movements of people, each of whom has an own way of every class, four times as different as repetitions are."""
    rng, shape = np.random.default_rng(seed), (n_classes, n_people, each, 2, 5)
    sines = np.sin(np.pi * np.linspace(0, 1, 60) * np.arange(1, 6)[:, None])
    classes, ways, repeats = (rng.normal(size=(*shape[:k], *(1,) * (3 - k), 2, 5)) for k in (1, 2, 3))
    paths = ((classes + own * ways + spread * repeats) / np.arange(1, 6) ** 0.5) @ sines
    return Demonstrations.from_arrays(
        paths.reshape(-1, 2, 60).transpose(0, 2, 1), np.repeat(np.arange(n_classes).astype(str), n_people * each)
    )


@pytest.mark.parametrize("seed", range(3))
def test_as_many_classes_as_are_asked_for_are_found_across_people(seed):
    demos = draw_people(6, 4, 5, seed)
    assert recovered(demos.labels, propose(demos, n_clusters=6)) == 1.0


def who_of(n_classes, n_people, each):
    """Who made each of the movements of `draw_people`."""
    return np.tile(np.repeat(np.arange(n_people), each), n_classes)


@pytest.mark.parametrize("seed", [0, slow(1), slow(3)])
def test_people_who_are_named_are_linked(seed):
    """Everyone's own way is so different that each is found as a cluster, unless it is told who made it."""
    demos, who = draw_people(6, 4, 5, seed, own=0.3), who_of(6, 4, 5)
    assert len(propose(demos)) == 24
    named = propose(demos, groups=who)
    assert recovered(demos.labels, named) >= 0.9
    order = np.random.default_rng(seed).permutation(len(demos))
    again = propose(demos[order], groups=np.array(["anna", "ben", "carl", "dora"])[who[order]])
    assert adjusted_rand_score(again.clusters, named.clusters[order]) == 1.0


def test_one_person_is_as_good_as_none():
    demos = draw_kinds([5, 6, 4])
    np.testing.assert_array_equal(propose(demos, groups=[3] * 15).clusters, propose(demos).clusters)


def test_classes_that_one_of_two_people_never_made_stay_apart():
    demos, who = draw_people(8, 2, 6, 0), who_of(8, 2, 6)
    classes = np.unique(demos.labels, return_inverse=True)[1]
    made = np.flatnonzero((who == classes % 2) | (classes < 4))  # four by both, two by each alone
    part = demos[made]
    assert recovered(part.labels, propose(part, groups=who[made])) == 1.0


def test_groups_hold_where_a_subsample_is_clustered():
    demos, who = draw_people(4, 3, 20, 0, own=0.3), who_of(4, 3, 20)
    named, nameless = (propose(demos, n_clusters=4, groups=one, max_clustered=150) for one in (who, None))
    assert recovered(demos.labels, named) >= 0.8
    assert recovered(demos.labels, nameless) <= 0.7


@given(seed=seeds)
@quick
def test_links_are_between_people_and_mutual(seed):
    rng, people = np.random.default_rng(seed), np.repeat([0, 1, 2], [6, 4, 2])
    near = rng.random((12, 12))
    near += near.T
    added = link_people(np.ones((12, 12)), near, people) - 1
    assert not added[people[:, None] == people].any()
    np.testing.assert_allclose(added, added.T)
    assert added.sum() == pytest.approx(0.5 * 144)
    pairs = [(a, b) for a in range(6) for b in range(6, 10)]
    best = [(a, b) for a, b in pairs if near[a, 6:10].max() == near[a, b] and near[:6, b].max() == near[a, b]]
    assert all(added[a, b] == added.max() for a, b in best)  # each is the other's nearest of that person
    assert best


def test_people_without_mutual_neighbors_are_not_linked():
    """There is one person: no similarity changes."""
    similar = np.random.default_rng(0).random((6, 6))
    np.testing.assert_array_equal(link_people(similar, similar, np.zeros(6, dtype=int)), similar)


def test_a_group_for_each_movement():
    with pytest.raises(TrajectoryError, match="expected groups to be one name or number for each of the 8 movements"):
        propose(draw_kinds([4, 4]), groups=["anna"] * 7)


def test_representations_count_by_their_weights():
    """At weights far apart the fused similarities are nearly those of one alone; equal ones are the default."""
    x, y = points(0)[0], points(1)[0][::-1]
    squares = squares_of(x, y, np.ones_like(x))
    np.testing.assert_allclose(fuse(squares, [3.0, 3.0, 1.0]), fuse(squares))
    first, second = (fuse(squares, weights) for weights in ([1e6, 1.0, 1.0], [1.0, 1e6, 1.0]))
    assert np.abs(first - second).max() > 0.1 * first.max()
    weights = by_shape(describe(draw_kinds([4, 4]))).own_weights
    assert weights == (2.0, 2.0, 1.0, 2.0, 2.0, 2.0)  # in detail as their twins


@pytest.mark.soak
def test_solids_of_five_people_are_told_apart_by_who_drew_them(gestures):
    """0.69 unless it is said who drew what."""
    demos, people = gestures
    solids = np.flatnonzero(~np.char.isdigit(np.asarray(demos.labels, dtype=str)))
    named = propose(demos[solids], groups=people[solids])
    assert 9 <= len(named) <= 11
    assert recovered(demos.labels[solids], named) >= 0.9


@pytest.mark.soak
def test_digits_of_five_people_are_ten_clusters(digits):
    """By themselves one more or less: one digit may be two; all right if ten are asked for."""
    demos, _ = digits
    proposals = propose(demos)
    assert 9 <= len(proposals) <= 11
    assert recovered(demos.labels, proposals) >= 0.97
    if SOAK:
        assert recovered(demos.labels, propose(demos, n_clusters=10)) >= 0.99


@pytest.mark.soak
def test_digits_of_one_person_are_ten_clusters(digits):
    demos, people = digits
    for person in np.unique(people):
        own = demos[np.flatnonzero(people == person)]
        assert recovered(own.labels, propose(own)) >= 0.95


def test_neighborhoods_are_few_and_many():
    """Few alone split people, and many alone merge small classes; the page of `fuse` names the numbers."""
    assert NEIGHBORS == (7, 15)
    squares = squared_distances(*(2 * (by_shape(describe(draw_kinds([4, 5, 3]))),)))
    assert fuse(squares).shape == (12, 12)
