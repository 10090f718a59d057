"""The most similar movement: the same as by comparing all, with few pairs compared."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kineme
from kineme.kernels.pair_distances import ElasticSpec
from kineme.similarity import scores as module
from kineme.similarity.describe import describe
from kineme.similarity.scores import most_similar, nearest_above
from kineme.similarity.similarity import AveragedSimilarity
from kineme.similarity.specification import DEFAULT_REPRESENTATIONS, DETAILED_ELASTIC, ComparisonSpecification
from movement_samples import draw_shapes
from soaking import examples

N = len(DEFAULT_REPRESENTATIONS)


def by_all(similarity, A, B):
    return similarity.log_average(A, B).argmax(axis=1)


@settings(max_examples=examples(12, 40), deadline=None)
@given(
    d=st.integers(1, 4),
    seed=st.integers(0, 10**6),
    width=st.floats(1e-3, 10.0),
    spread=st.floats(0.0, 1.0),
    weights=st.none() | st.lists(st.sampled_from([0.0, 0.1, 1.0]), min_size=N, max_size=N).filter(any),
    representations=st.lists(st.integers(1, N - 1), unique=True),
    mean=st.sampled_from(["arithmetic", "geometric"]),
)
def test_it_is_the_one_that_comparing_all_finds(d, seed, width, spread, weights, representations, mean):
    how = ComparisonSpecification(mean=mean)
    stored = describe(draw_shapes([4] * 5, d=d, seed=seed, spread=spread), how)
    stored = stored.take(np.r_[:20, :3])  # some twice: the first is found
    asked = describe(draw_shapes([4] * 8, d=d, seed=seed + 1, spread=spread), how)
    asked.put(0, stored.take(slice(5, 9)))
    kept = [0, *sorted(representations)]  # positions over arc length give the rotation
    rng, chosen = np.random.default_rng(seed), None if weights is None else np.array(weights)[kept]
    if chosen is not None and not chosen.any():
        chosen = None
    similarity = AveragedSimilarity(
        stored.procrustes,
        width * rng.uniform(0.5, 2.0, len(kept)),
        mean,
        None if chosen is None else chosen / chosen.sum(),
    )
    A, B = asked.select(kept), stored.select(kept)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_LEAST_PAIRS", 1)
        np.testing.assert_array_equal(most_similar(similarity, A, B), by_all(similarity, A, B))


@settings(max_examples=examples(12, 40), deadline=None)
@given(
    d=st.integers(1, 4),
    seed=st.integers(0, 10**6),
    width=st.floats(0.1, 3.0),
    shares=st.lists(st.floats(0.0, 1.0), min_size=5, max_size=5),
    weights=st.none() | st.lists(st.floats(0.05, 1.0), min_size=N, max_size=N),
    many=st.sampled_from([0.0, 1.0]),
)
def test_what_reaches_the_bar_is_known_and_nothing_else_seems_to(d, seed, width, shares, weights, many):
    """With bars among the similarities, bounds by rows alone and bounds by pairs."""
    how = ComparisonSpecification()
    stored = describe(draw_shapes([4] * 5, d=d, seed=seed), how)
    asked = describe(draw_shapes([4] * 5, d=d, seed=seed, spread=0.1), how)
    widths = width * np.random.default_rng(seed).uniform(0.5, 2.0, N) * np.where(np.arange(N) < 2, 5.0, 0.3)
    given = None if weights is None else np.array(weights) / sum(weights)
    similarity = AveragedSimilarity(stored.procrustes, widths, "arithmetic", given)
    first = np.array([0, 4, 6, 12, 13])
    exact = np.maximum.reduceat(similarity.log_average(asked, stored), first, axis=1)
    logs = np.array([np.quantile(column, share) for column, share in zip(exact.T, shares, strict=True)])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_LEAST_PAIRS", 1)
        patch.setattr(module, "_MANY", many)
        found = nearest_above(similarity, asked, stored, first, np.exp(logs))
    reached = exact >= logs
    np.testing.assert_allclose(found[reached], exact[reached], rtol=1e-12)
    assert (found[~reached] < np.broadcast_to(logs, exact.shape)[~reached]).all()
    assert (found >= exact - 1e-5).all()


@pytest.mark.parametrize(("bar", "bounded"), [(0.3, 0), (0.5, 2), (0.9, 0)])
def test_pairs_are_bounded_only_where_that_may_rule_some_out(bar, bounded, monkeypatch):
    """Both point clouds have 0.4 of the weights, and are not compared for a bound; what is far by rows has below 0.85.

    Where they are bounded, they are so as they are rotated, and in detail.
    """
    stored, asked = (describe(draw_shapes([1] * 40, seed=seed, spread=1.0)) for seed in (1, 2))
    weights = np.array([one.weight for one in DEFAULT_REPRESENTATIONS])
    widths = np.array([1e-3, 1e-3, 1.0, 1.0, 1.0, 1.0, 1.0])
    similarity = AveragedSimilarity(stored.procrustes, widths, "arithmetic", weights / weights.sum())
    inner, calls = module.pair_bounds, []
    monkeypatch.setattr(module, "pair_bounds", lambda *given, **options: calls.append(1) or inner(*given, **options))
    nearest_above(similarity, asked, stored, np.arange(0, 40, 2), np.full(20, bar))
    assert len(calls) == bounded


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("choice", ["never", "always"])
@pytest.mark.parametrize("classifier", ["auto", "nearest", "prototype"])
def test_few_pairs_are_compared_completely(choice, classifier, monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", choice)
    demos = kineme.load_lasa()
    recognizer = kineme.Recognizer(classifier=classifier).fit(demos[::7])
    others = demos[np.flatnonzero(np.arange(len(demos)) % 7)][::3]
    expected = recognizer.decision_function(others).argmax(axis=1)
    listed, pairs = module.listed_distances, {}

    def counted(A, B, first, second, rotations):
        pairs.setdefault(A.elastic.n_segments, []).append(len(first))
        return listed(A, B, first, second, rotations)

    monkeypatch.setattr(module, "listed_distances", counted)
    np.testing.assert_array_equal(recognizer.predict(others), recognizer.classes_[expected])
    assert pairs[ElasticSpec().n_segments] == pairs[DETAILED_ELASTIC.n_segments]  # each pair once, and once in detail
    for each in pairs.values():
        assert len(others) <= sum(each) <= 0.06 * len(others) * len(recognizer.classes_)


@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_no_other_pair_may_be_in_doubt(d):
    stored = draw_shapes([1] * 40, d=d, spread=0.0)
    recognizer = kineme.Recognizer(classifier="nearest").fit(stored)
    np.testing.assert_array_equal(recognizer.predict(stored), stored.labels)


def test_bounds_that_are_too_small_for_single_precision_decide_nothing(monkeypatch):
    monkeypatch.setattr(module, "_LEAST_PAIRS", 1)
    stored, asked = (describe(draw_shapes([1] * 20, seed=seed, spread=1.0)).select([0, 2]) for seed in (1, 2))
    for width in np.geomspace(0.02, 0.2, 60):
        similarity = AveragedSimilarity(stored.procrustes, np.full(2, width))
        np.testing.assert_array_equal(most_similar(similarity, asked, stored), by_all(similarity, asked, stored))
