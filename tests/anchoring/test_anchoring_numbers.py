"""Decisions that the documentation of anchoring states: each falls here if it is changed."""

from __future__ import annotations

from importlib import import_module

import numpy as np
import pytest
from sklearn.utils import Bunch

from kineme import DMP, Demonstrations, Recognizer
from kineme.anchoring import assignment as merge_split
from kineme.anchoring import clustering
from kineme.anchoring.assignment import Split, agreement, suggest_merges, suggest_splits
from kineme.anchoring.clustering import count_clusters
from kineme.anchoring.proposals import largest_clustered, radii, subsample
from kineme.anchoring.space import ConceptualSpace, conceptual_space, morph
from kineme.similarity.describe import describe
from unlabeled_samples import draw_kinds


def _space(ab, ac, cb):
    return ConceptualSpace(("a", "b", "c"), np.array([[0.0, ab, ac], [ab, 0.0, cb], [ac, cb, 0.0]]))


@pytest.mark.parametrize(
    ("ac", "cb", "found"),
    [
        (0.6, 0.6, True),
        (0.62, 0.62, True),  # a detour of 0.24
        (0.63, 0.63, False),  # of 0.26
        (1.05, 0.1, False),  # a small detour, but beyond b
        (0.1, 1.05, False),
        (0.99, 0.2, True),
    ],
)
def test_between_is_a_small_detour_and_nearer_to_each_than_they_are(ac, cb, found):
    assert [one.symbol for one in _space(1.0, ac, cb).between("a", "b")] == ["c"] * found


def test_however_large_a_detour_may_be_what_is_farther_is_not_between():
    assert _space(1.0, 1.2, 0.5).between("a", "b", eps=1.0) == ()
    assert len(_space(1.0, 0.9, 0.9).between("a", "b", eps=1.0)) == 1


def test_a_kind_reaches_as_far_as_its_members_and_at_least_as_far_as_most_members_of_all():
    """Of a tight and a loose kind, the tight one takes in what the loose one shows to be usual."""
    n = 20
    clusters = np.repeat([0, 1], n)
    K = np.zeros((2 * n, 2 * n))
    K[:n, :n] = 0.9  # 0.1 to the nearest neighbor
    K[n:, n:] = 0.7
    K[-1, n:] = K[n:, -1] = 0.4  # one at the rim
    kinds = [Bunch(members=np.flatnonzero(clusters == k)) for k in (0, 1)]
    tight, loose = radii(K, Bunch(clusters=clusters, proposals=kinds))
    assert loose == pytest.approx(0.6)
    assert tight == pytest.approx(0.3)  # the 95 % of all members


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5, 1.0])
def test_half_way_to_a_moved_turned_and_larger_copy_is_half_of_each(share, make_movement):
    """The center moves evenly, the angle grows evenly, the size by equal factors, the duration too."""
    x = make_movement(3)[1]
    c, s = np.cos(0.6), np.sin(0.6)
    turned = 2.0 * x @ np.array([[c, s], [-s, c]]) + [5.0, -3.0]
    learned = DMP(n_basis=20, fit="trajectory").learn(
        Demonstrations.from_arrays([x, turned], times=[np.linspace(0, end, len(x)) for end in (1.0, 4.0)])
    )
    made = morph(learned[0], learned[1], share)
    paths = [one.rollout().positions[0] for one in (learned[0], learned[1], made)]
    centers = [path.mean(axis=0) for path in paths]
    np.testing.assert_allclose(centers[2], centers[0] + share * (centers[1] - centers[0]), atol=2e-2)
    c, s = np.cos(0.6 * share), np.sin(0.6 * share)
    expected = 2.0**share * (paths[0] - centers[0]) @ np.array([[c, s], [-s, c]]) + centers[2]
    np.testing.assert_allclose(paths[2], expected, atol=2e-2)
    np.testing.assert_allclose(made.durations, 4.0**share)


def test_distances_of_symbols_go_on_growing():
    """``sqrt(mean_r d_r^2 / sigma_r^2)``, sigma_r the median distance in each representation."""
    demos = draw_kinds([1] * 6)
    described = describe(demos)
    squares = np.stack([described.procrustes.squared_distances(one, one) for one in described.blocks])
    pairs = ~np.eye(6, dtype=bool)
    sigmas = np.sqrt([np.median(one[pairs]) for one in squares])
    expected = np.sqrt(np.mean(squares / sigmas[:, None, None] ** 2, axis=0))
    space = conceptual_space(list("abcdef"), described)
    np.testing.assert_allclose(space.distances[pairs], expected[pairs], rtol=1e-4)


def test_a_sample_leaves_out_no_rare_kind():
    """Four movements of 604, in a sample of 80: drawn evenly, they would be missed every other time."""
    described = describe(draw_kinds([60] * 10 + [4], spread=0.02))
    for seed in range(8):
        sample, _ = subsample(described, 80, seed)
        assert len(sample) == 80
        assert (sample >= 600).any(), seed


@pytest.mark.parametrize(("stability", "found"), [(0.96, 3), (0.94, 2)])
def test_of_numbers_of_kinds_as_stable_as_the_most_stable_the_best_fit_is_taken(stability, found, monkeypatch):
    """As stable: within 0.05 of the adjusted Rand index."""
    stable, fitting = {2: 1.0, 3: stability, 4: 0.5}, {2: 0.4, 3: 0.6, 4: 0.9}
    monkeypatch.setattr(
        clustering, "mean_silhouettes", lambda _, clusterings: np.array([fitting[c.max() + 1] for c in clusterings])
    )
    monkeypatch.setattr(clustering, "_agreement", lambda *given: np.array([stable[c] for c in given[2]]))
    points = np.random.default_rng(0).uniform(size=8)
    assert count_clusters(np.abs(points[:, None] - points)) == found


@pytest.mark.parametrize(("stability", "n"), [(0.74, 0), (0.76, 1)])
def test_a_symbol_is_split_into_parts_with_a_stability_of_three_quarters(stability, n, monkeypatch):
    def in_two(name, described, places, widths):
        return Split(name, (places[:2], places[2:]), 0.1, stability)

    monkeypatch.setattr(merge_split, "_in_two", in_two)
    assert len(suggest_splits(draw_kinds([4, 1]), [0, 0, 0, 0, 1])) == n


def test_symbols_shown_once_agree_up_to_six_tenths_of_the_way_to_the_nearest_other():
    known = Recognizer().fit(draw_kinds([1] * 6), list("abcdef"))
    K = np.exp(known.log_similarity(known.demonstrations_))
    np.fill_diagonal(K, 0.0)
    away = np.sqrt(-2.0 * np.log(K.max(axis=1)))
    assert agreement(known.comparison_, known.references_) == pytest.approx(
        np.exp(-0.5 * (0.6 * np.median(away)) ** 2), rel=1e-3
    )


def _similar(within, between, sizes=(3, 3)):
    """Similarities of symbols of these sizes: those of different members, and those between symbols."""
    member = np.repeat(np.arange(len(sizes)), sizes)
    K = np.where(member[:, None] == member, np.asarray(within)[member], between)
    np.fill_diagonal(K, 1.0)
    return K


def test_symbols_agree_up_to_half_way_from_their_own_members_to_the_nearest_other(monkeypatch):
    known = Recognizer().fit(draw_kinds([3, 3, 3]), list("aaabbbccc"))
    K = _similar([0.9, 0.8, 0.6], 0.2, (3, 3, 3))
    monkeypatch.setattr(import_module("kineme.anchoring.assignment"), "compare", lambda *_: K.copy())
    assert agreement(known.comparison_, known.references_) == pytest.approx(0.5 * (0.8 + 0.2))


@pytest.mark.parametrize(("overlap", "n"), [(0.49, 0), (0.51, 1)])
def test_symbols_that_overlap_by_half_could_be_merged(overlap, n, monkeypatch):
    monkeypatch.setattr(merge_split, "similarities", lambda *_, **__: _similar([0.8, 0.8], 0.8 * overlap))
    assert len(suggest_merges(draw_kinds([3, 3]), list("aaabbb"))) == n


def test_a_symbol_with_one_member_is_as_cohesive_as_the_others_typically_are(monkeypatch):
    monkeypatch.setattr(merge_split, "similarities", lambda *_, **__: _similar([0.5, 0.0], 0.3, (3, 1)))
    (merge,) = suggest_merges(draw_kinds([3, 1]), list("aaab"))
    assert merge.overlap == pytest.approx(0.3 / 0.5)


def test_in_space_fewer_movements_are_all_compared():
    """A pair costs a decomposition there; the page of `propose` names the numbers."""
    assert [largest_clustered(d) for d in (1, 2, 3, 4)] == [5000, 5000, 800, 5000]
