"""The search among shards gives what comparing all gives, whatever shards there are."""

from __future__ import annotations

import math
import threading
from dataclasses import replace

import numpy as np
import pytest
import shard_samples as samples
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from kineme.errors import SpecificationError, TrajectoryError
from kineme.kernels.rotation import RotationPrior
from kineme.pieces import scan as scanning
from kineme.pieces.scan import best_of, plan_of, scan_plain
from kineme.pieces.search import open_shards
from kineme.runtime.compiled import compiled_module
from kineme.similarity.bounds import ReducedFeatures, log_bounds
from kineme.similarity.similarity import AveragedSimilarity
from kineme.similarity.specification import ComparisonSpecification
from soaking import some

K = 40
COMPARISONS = {
    "signals": (1, {}),
    "plane, prior": (2, {}),
    "plane, limit": (2, {"max_angle": 0.4}),
    "plane, upright": (2, {"max_angle": 0.0}),
    "space, prior": (3, {}),
    "space, vertical": (3, {"rotation_prior": RotationPrior(vertical=(0, 0, 1))}),
    "space, limit": (3, {"max_angle": 1.0}),
    "space, geometric mean": (3, {"mean": "geometric"}),
    "four joints": (4, {}),
}


@pytest.fixture(scope="module", params=some(COMPARISONS, 0, 1, 2, 4, 8), ids=str)
def searched(request, tmp_path_factory):
    """Shards of 900 movements, in three; and movements to ask for."""
    n_dims, recognizer = COMPARISONS[request.param]
    folder = tmp_path_factory.mktemp("search")
    reduction = samples.reduction_of(samples.library(folder / "library", n_dims, **recognizer))
    paths, labels = samples.movements(900, n_dims, seed=4)
    paths[500:520] = paths[:20]  # the same recordings once more
    opened = open_shards(samples.shards(folder / "three", reduction, paths, labels=labels))
    return opened, paths, samples.movements(6, n_dims, seed=8)[0], folder


def _all_scores(opened, query):
    """The bound of every row, in the order of shards: by `log_bounds`, in double precision."""
    plan, chosen = opened.plan
    columns = [opened.reduction.columns()[r] for r in chosen]
    reduced = np.concatenate([block for shard in opened.shards for block in shard.numbers["reduced"]])
    rows = np.concatenate([reduced[:, column] for column in columns], axis=1)
    asked, stored = plan.features(query.reduced[None]), plan.features(rows)
    return log_bounds(plan.similarity, asked, stored)[0].astype(np.float32)


def _numbers(opened, candidates):
    """Which rows of all these are."""
    first = np.concatenate(([0], np.cumsum([len(shard) for shard in opened.shards])))
    return first[candidates.shards] + candidates.rows


@pytest.mark.parametrize("k", [1, K, 300, 5000])
def test_candidates_are_those_of_comparing_all(searched, k):
    opened, paths, asked, _ = searched
    _, queries = opened.described(np.concatenate((asked, paths[:3])))
    for query, candidates in zip(queries, opened.candidates(queries, k), strict=True):
        scores = _all_scores(opened, query)
        names = [(f"file {i // 3:04d}.csv", str(i % 3)) for i in range(len(scores))]
        expected = sorted(range(len(scores)), key=lambda i: (-scores[i], names[i]))[:k]
        assert set(_numbers(opened, candidates).tolist()) == set(expected)
        np.testing.assert_array_equal(np.sort(candidates.scores), np.sort(scores[expected]))


def test_scores_bound_the_similarity_of_the_rows(searched):
    opened, _, asked, _ = searched
    comparison = opened.reduction.comparison
    by_rows = len(comparison.specification.by_rows)
    described, queries = opened.described(asked)
    some = comparison.similarity.by_rows(by_rows)
    for i, candidates in enumerate(opened.candidates(queries, K)):
        others = comparison.prepared(opened._rows(candidates)).select(range(by_rows))
        logs = some.log_average(described.take(slice(i, i + 1)).select(range(by_rows)), others)[0]
        assert (candidates.scores >= logs - 1e-4).all()


def test_ranked_by_all_representations(searched):
    opened, paths, asked, _ = searched
    comparison = opened.reduction.comparison
    logs = comparison.similarity.log_average(
        comparison.describe(comparison.checked(asked)), comparison.describe(comparison.checked(paths))
    )
    for own, nearest in zip(logs, opened.nearest(asked, 5, candidates=900), strict=True):
        assert [near.similarity for near in nearest] == pytest.approx(np.exp(np.sort(own)[::-1][:5]), rel=2e-3)
        numbers = [3 * int(near.path[5:9]) + int(near.place) for near in nearest]
        np.testing.assert_allclose(own[numbers], np.sort(own)[::-1][:5], atol=2e-3)


def test_a_movement_of_the_archive_is_the_nearest_to_itself(searched):
    opened, paths, _, _ = searched
    first, second = opened.nearest(paths[[100, 5]], 2)
    assert (first[0].path, first[0].place, first[0].start, first[0].duration) == ("file 0033.csv", "1", 100.0, 1.5)
    assert first[0].similarity == pytest.approx(1.0, abs=1e-4)
    assert first[0].label.startswith("class ")
    # Of two that are the same, the first by name.
    assert [(near.path, near.place) for near in second] == [("file 0001.csv", "2"), ("file 0168.csv", "1")]


@pytest.mark.parametrize(("n_shards", "order"), [(1, None), (7, None), (3, [2, 0, 1])])
def test_the_answer_is_the_same_for_any_number_of_shards_in_any_order(searched, n_shards, order):
    opened, paths, asked, folder = searched
    labels = samples.movements(900, paths.shape[2], seed=4)[1]
    name = f"{n_shards} {order}"
    others = open_shards(samples.shards(folder / name, opened.reduction, paths, n_shards, order, labels))
    others = replace(others, most=200)
    others.prepare()
    assert len(others.groups) == (1 if n_shards == 1 else n_shards)
    both = np.concatenate((asked, paths[:4]))
    assert others.nearest(both, 10, K) == opened.nearest(both, 10, K)


@pytest.mark.parametrize("threads", [1, 4])
def test_the_answer_is_the_same_alone_and_among_others(searched, threads, monkeypatch):
    opened, _, asked, _ = searched
    monkeypatch.setenv("KINEME_NUM_THREADS", str(threads))
    every = opened.nearest(asked, 10, K)
    assert [opened.nearest(movement[None], 10, K)[0] for movement in asked] == every


def test_both_twins_give_the_same(searched):
    opened, paths, asked, _ = searched
    plan, _ = opened.plan
    _, queries = opened.described(np.concatenate((asked, paths[:2])))
    compiled = compiled_module("kineme.pieces._compiled")
    for query in queries:
        for _, group in opened.groups:
            plain, fast = best_of(K), best_of(K)
            scan_plain(plan, group.rows, query, plain, 5)
            compiled.scan(tuple(map(np.asarray, group.rows)), tuple(query), plan.numbers, *fast, 5)
            np.testing.assert_allclose(np.sort(fast.scores), np.sort(plain.scores), rtol=1e-6, atol=1e-6)
            least = np.partition(plain.scores, 0)[0]
            clear = {row for row, score in zip(plain.rows, plain.scores, strict=True) if score > least + 1e-5}
            assert clear <= set(fast.rows.tolist())


@pytest.mark.parametrize("choice", ["always", "never"])
def test_either_twin_may_be_chosen(searched, choice, monkeypatch):
    opened, _, asked, _ = searched
    monkeypatch.setenv("KINEME_COMPILED", choice)
    _, queries = opened.described(asked)
    every = opened.candidates(queries, K)
    monkeypatch.setenv("KINEME_COMPILED", "auto")
    for chosen, others in zip(every, opened.candidates(queries, K), strict=True):
        assert set(_numbers(opened, chosen).tolist()) == set(_numbers(opened, others).tolist())


def test_rows_as_good_as_the_last_one_are_chosen_by_name(tmp_path):
    """More copies of one movement than there are candidates: the first by path and place are taken."""
    reduction = samples.reduction_of(samples.library(tmp_path / "library"))
    paths, _ = samples.movements(300, seed=4)
    paths[20:280] = paths[7]
    opened = open_shards(samples.shards(tmp_path / "shards", reduction, paths, 3, order=[2, 1, 0]))
    for twin in ("always", "never"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("KINEME_COMPILED", twin)
            nearest = opened.nearest(paths[7][None], 12, 12)[0]
        numbers = [3 * int(near.path[5:9]) + int(near.place) for near in nearest]
        assert numbers == [7, *range(20, 31)]


def test_few_rows_are_compared(tmp_path):
    """Of movements of some classes, blocks and rows of other classes are passed over."""
    reduction = samples.reduction_of(samples.library(tmp_path / "library"))
    paths, _ = samples.movements(4000, seed=4, n_classes=4)
    opened = open_shards(samples.shards(tmp_path / "shards", reduction, paths, 1))
    _, queries = opened.described(paths[:5])
    for query in queries:
        best = best_of(10)
        scanning.scan(opened.plan[0], opened.groups[0][1].rows, query, best, 0)
        assert best.state[2] < 0.25 * len(paths)


values = st.floats(-3, 3, width=32)


@given(
    arrays(np.float32, (40, 8), elements=values),
    st.sampled_from(["arithmetic", "quadratic", "geometric", "harmonic", "min"]),
    st.sampled_from([(1, 0.0, None), (2, 0.0, None), (2, 0.7, None), (2, math.pi, 0.1), (4, 0.0, None)]),
    st.integers(1, 40),
)
def test_any_rows_under_any_mean(numbers, mean, how, k):
    d, angle, concentration = how
    specification = ComparisonSpecification(
        max_angle=angle if concentration is None else None,
        prior=RotationPrior() if concentration is None else RotationPrior(concentration),
    )
    similarity = AveragedSimilarity(specification.procrustes(d), np.array([1.0, 0.4]), mean)
    parts = []
    for half in (numbers[:, :4], numbers[:, 4:]):
        residual = np.abs(half[:, 0]) / 2
        parts += [half, ((half**2).sum(axis=1) + residual**2)[:, None], residual[:, None]]
    reduced = np.concatenate(parts, axis=1)
    plan, _ = plan_of(similarity, [4 // d] * 2)
    index, order = plan.index(reduced[1:])
    for rows in index:  # as those of a file: others are compiled apart
        rows.flags.writeable = False
    query = plan.queries(reduced[:1])[0]
    features = [ReducedFeatures(part[:, :-2], part[:, -2], part[:, -1])
                for part in (reduced.astype(float)[:, :6], reduced.astype(float)[:, 6:])]  # fmt: skip
    queries, stored = (tuple(each.take(rows) for each in features) for rows in (slice(0, 1), slice(1, None)))
    scores = np.sort(log_bounds(similarity, queries, stored)[0].astype(np.float32))[::-1][:k]
    for choice in ("always", "never"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("KINEME_COMPILED", choice)
            best = best_of(k)
            scanning.scan(plan, index, query, best, 0)
        np.testing.assert_allclose(np.sort(best.scores)[::-1][: len(scores)], scores, rtol=2e-6, atol=2e-6)
    assert sorted(order.tolist()) == list(range(39))


@given(st.lists(st.integers(0, 5), min_size=30, max_size=200), st.integers(1, 20))
def test_rows_as_good_as_the_last_one_are_reported(kinds, k):
    """Of rows of a few kinds, whether one that is as good as the last one of the best had no place."""
    similarity = AveragedSimilarity(ComparisonSpecification(max_angle=0.0).procrustes(2), np.ones(1))
    values = np.array(kinds, np.float32)[:, None] * np.float32([1, 0, 0, 0])
    reduced = np.column_stack((values, (values**2).sum(axis=1), np.zeros(len(kinds)))).astype(np.float32)
    plan, _ = plan_of(similarity, [2])
    index, _ = plan.index(reduced)
    for rows in index:
        rows.flags.writeable = False
    query = plan.queries(np.zeros((1, 6), np.float32))[0]
    places = sorted(kinds)
    for choice in ("always", "never"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("KINEME_COMPILED", choice)
            best, every = best_of(k), best_of(len(kinds))
            scanning.scan(plan, index, query, best, 0)
            scanning.scan(plan, index, query, every, 0)
        np.testing.assert_array_equal(np.sort(best.scores), np.sort(every.scores)[-k:])
        assert (best.state[1] == best.scores.min()) == (places[k - 1] == places[k])


def test_marks_are_never_farther_apart_than_rows(searched):
    opened, _, asked, _ = searched
    plan, _ = opened.plan
    _, queries = opened.described(asked)
    group = opened.groups[0][1]
    ends = np.cumsum([0, *plan.n_marks])
    marks = plan.marks(group.rows.reduced)
    for query in queries:
        stored = plan.features(group.rows.reduced)
        for r, (a, b) in enumerate(zip(plan.features(query.reduced[None]), stored, strict=True)):
            some = AveragedSimilarity(plan.procrustes, np.ones(1))
            points = plan.procrustes.by_points
            pair = ((each._replace(values=points(each.values)),) for each in (a, b))
            squares = -2.0 * log_bounds(some, *pair)[0]
            apart = ((marks[:, ends[r] : ends[r + 1]] - query.marks[ends[r] : ends[r + 1]]) ** 2).sum(axis=1)
            assert (apart <= squares + 1e-5 * (a.squares + b.squares)).all()


def test_points_that_turn_together(tmp_path):
    """Two hands in space: marks are norms over both."""
    reduction = samples.reduction_of(samples.library(tmp_path / "library", 6, points=2))
    paths, _ = samples.movements(400, 6, seed=4)
    opened = open_shards(samples.shards(tmp_path / "shards", reduction, paths))
    assert opened.plan[0].kind == 3
    assert opened.plan[0].procrustes.n_points == 2
    _, queries = opened.described(paths[:4])
    for query, candidates in zip(queries, opened.candidates(queries, K), strict=True):
        plan, columns = opened.plan[0], opened.reduction.columns()
        reduced = np.concatenate([block for shard in opened.shards for block in shard.numbers["reduced"]])
        rows = np.concatenate([reduced[:, columns[r]] for r in opened.plan[1]], axis=1)
        points = plan.procrustes.by_points
        asked = tuple(each._replace(values=points(each.values)) for each in plan.features(query.reduced[None]))
        scores = log_bounds(plan.similarity, asked, plan.features(rows))[0].astype(np.float32)
        np.testing.assert_allclose(np.sort(candidates.scores), np.sort(scores)[-K:], rtol=1e-6, atol=1e-6)


def test_indexes_are_kept_and_made_again_when_shards_change(tmp_path):
    reduction = samples.reduction_of(samples.library(tmp_path / "library"))
    paths, _ = samples.movements(90, seed=4)
    folder = samples.shards(tmp_path / "shards", reduction, paths[:60], 2)
    before = open_shards(folder).nearest(paths[70][None], 1)[0][0]
    kept = set(folder.glob("search-*"))
    assert len(kept) == 1
    marks = next(iter(kept)) / "marks.npy"
    written = marks.stat().st_mtime_ns
    open_shards(folder).nearest(paths[:1], 1)
    assert marks.stat().st_mtime_ns == written
    samples.shards(folder, reduction, paths, 3)
    opened = open_shards(folder)
    opened.prepare()
    after = opened.nearest(paths[70][None], 1)[0][0]
    assert before.similarity < 0.9999 < after.similarity
    assert len(set(folder.glob("search-*"))) == 1
    assert not kept & set(folder.glob("search-*"))


@pytest.mark.parametrize("damage", ["truncated", "empty", "pointers"])
def test_a_damaged_index_is_made_again(tmp_path, damage):
    reduction = samples.reduction_of(samples.library(tmp_path / "library"))
    paths, _ = samples.movements(90, seed=4)
    folder = samples.shards(tmp_path / "shards", reduction, paths)
    expected = open_shards(folder).nearest(paths[:3], 4)
    index = next(folder.glob("search-*"))
    if damage == "pointers":
        np.save(index / "places.npy", np.full(90, 10**9))
    else:
        data = (index / "reduced.npy").read_bytes()
        (index / "reduced.npy").write_bytes(data[: len(data) // 2] if damage == "truncated" else b"")
    assert open_shards(folder).nearest(paths[:3], 4) == expected


def test_without_a_place_to_write_the_index_is_in_memory(tmp_path, monkeypatch):
    reduction = samples.reduction_of(samples.library(tmp_path / "library"))
    paths, _ = samples.movements(90, seed=4)
    folder = samples.shards(tmp_path / "shards", reduction, paths)

    def refuse(*_):
        raise PermissionError("read only")

    monkeypatch.setattr("kineme.pieces.search.whole_folder", refuse)
    assert open_shards(folder).nearest(paths[:1], 1)[0][0].similarity > 0.9999
    assert not list(folder.glob("search-*"))


def test_threads_may_share_shards(searched):
    opened, _, asked, _ = searched
    expected, answers = opened.nearest(asked, 5, K), []
    threads = [threading.Thread(target=lambda: answers.append(opened.nearest(asked, 5, K))) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert answers == [expected] * 3


def test_what_is_asked_wrongly_is_refused(searched):
    opened, paths, asked, _ = searched
    with pytest.raises(SpecificationError, match="n to be"):
        opened.nearest(asked, 0)
    with pytest.raises(SpecificationError, match="candidates to be"):
        opened.nearest(asked, 10, candidates=9)
    with pytest.raises(TrajectoryError, match="dimensions"):
        opened.nearest(np.zeros((2, 20, paths.shape[2] + 1)) + np.arange(20)[:, None], 1)
