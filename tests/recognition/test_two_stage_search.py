"""Two stages give the answer of one: the search dismisses nothing that an exhaustive comparison would have named."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kineme import Demonstrations, Recognizer
from kineme.errors import SpecificationError
from kineme.recognition import two_stage_search
from kineme.recognition.two_stage_search import TwoStageSearch
from kineme.similarity import comparison as references
from kineme.similarity.bounds import fit_bases, reduce_features
from kineme.similarity.comparison import StoredReferences
from kineme.similarity.describe import feature_rows
from kineme.similarity.specification import ROW_REPRESENTATIONS
from movement_samples import draw_shapes
from soaking import examples


def _two_stages(recognizer, order=None, n_reduced=12, blocks=2):
    """The same recognizer, its movements stored in any order and in several blocks."""
    demos = recognizer.demonstrations_
    order = np.arange(len(demos)) if order is None else order  # row of the features -> movement
    features = feature_rows(demos[order], recognizer.comparison_.specification)
    features = tuple(block.astype(np.float32) for block in features)
    by_rows = features[: len(recognizer.comparison_.specification.by_rows)]  # details have no bounds
    bases = fit_bases(by_rows, demos.n_dims, n_reduced)
    reduced = reduce_features(bases, by_rows, demos.n_dims)
    cuts = np.linspace(0, len(demos), blocks + 1).astype(int)
    parts = tuple(tuple(one.take(slice(a, b)) for one in reduced) for a, b in pairwise(cuts))
    asked = []

    def fetch(rows):
        asked.append(len(rows))
        return tuple(block[rows] for block in features)

    first = recognizer.references_.first
    references = StoredReferences(
        bases,
        parts,
        np.argsort(order),
        first,
        recognizer.comparison_.specification,
        fetch,
        lambda rows: demos[order[rows]],
    )
    return TwoStageSearch(recognizer.comparison_, recognizer.calibration(), recognizer.classes_, references), asked


def _same(ours, theirs, places):
    assert ours.label == theirs.label
    assert ours.ranked[0] == theirs.ranked[0]
    for name, p in ours.p_values.items():
        assert p == pytest.approx(theirs.p_values[name], abs=1e-5)
    assert [places[one.index] for one in ours.nearest] == [one.index for one in theirs.nearest][: len(ours.nearest)]
    np.testing.assert_allclose(ours.transform.matrix, theirs.transform.matrix, rtol=1e-5, atol=1e-7)
    for look, share in ours.responsibilities.items():
        assert share == pytest.approx(theirs.responsibilities[look], abs=1e-4)


@pytest.mark.parametrize("d", [1, 2, 3, 4])
@settings(max_examples=examples(2))
@given(seed=st.integers(0, 1000), n_reduced=st.integers(1, 20))
def test_where_everything_is_compared_the_answer_is_the_ordinary_one(d, seed, n_reduced):
    counts = np.random.default_rng(seed).integers(1, 5, 8)
    recognizer = Recognizer(classifier="nearest", weights="equal").fit(draw_shapes(counts, d, seed))
    order = np.random.default_rng(seed).permutation(counts.sum())
    two, _ = _two_stages(recognizer, order, n_reduced)
    asked = draw_shapes([1] * 8, d, seed, spread=0.3)
    for ours, theirs in zip(two.recognize(asked), recognizer.recognize(asked), strict=True):
        _same(ours, theirs, order)
        assert set(ours.p_values) == set(theirs.p_values)
        assert ours.ranked == theirs.ranked
        assert ours.confidence == pytest.approx(theirs.confidence, abs=1e-5)


@pytest.mark.parametrize(("d", "n_classes"), [(2, 40), (3, 10)])
@given(seed=st.integers(0, 1000))
def test_a_few_comparisons_give_the_label_and_the_p_values_of_all(d, n_classes, seed):
    recognizer = Recognizer(classifier="nearest", weights="equal").fit(draw_shapes([6] * n_classes, d, seed))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(two_stage_search, "_BEST", 3)
        patch.setattr(two_stage_search, "_CLASSES", n_classes // 4)
        two, fetched = _two_stages(recognizer, blocks=3)
        asked = draw_shapes([1] * n_classes, d, seed, spread=0.25)[:8]
        for ours, theirs in zip(two.recognize(asked), recognizer.recognize(asked), strict=True):
            assert ours.label == theirs.label
            assert ours.ranked[0] == theirs.ranked[0]
            assert ours.p_values == pytest.approx({name: theirs.p_values[name] for name in ours.p_values}, abs=1e-5)
    assert sum(fetched) < 0.6 * len(asked) * len(recognizer.references_.labels)


@given(seed=st.integers(0, 1000))
def test_the_nearest_movement_is_always_compared(seed):
    recognizer = Recognizer(ROW_REPRESENTATIONS).fit(draw_shapes([5] * 30, 2, seed))
    two, _ = _two_stages(recognizer, n_reduced=3)
    asked = draw_shapes([1] * 30, 2, seed + 1)
    described = recognizer.describe(asked)
    exact = recognizer.comparison_.similarity.log_average(described, recognizer.references_.described)
    bounds = two.stored.bounds(recognizer.comparison_.similarity, two.reduced(described))
    for i in range(30):
        places, logs, _ = two.compare(described.take(slice(i, i + 1)), bounds[i])
        assert exact[i].argmax() in places
        np.testing.assert_allclose(logs, exact[i, places], atol=1e-4)
        nearest = np.maximum.reduceat(exact[i], recognizer.references_.first)
        for c in np.unique(places // 5):
            assert logs[places // 5 == c].max() == pytest.approx(nearest[c], abs=1e-4)


@given(seed=st.integers(0, 1000))
def test_whoever_could_be_nearer_is_compared_too(seed):
    """However few the reduced features, and however few are compared first."""
    recognizer = Recognizer(ROW_REPRESENTATIONS).fit(draw_shapes([5] * 30, 2, seed, spread=0.3))
    asked = draw_shapes([1] * 30, 2, seed, spread=0.3)
    with pytest.MonkeyPatch.context() as patch:
        for name in ("_LEADING", "_BEST", "_CLASSES"):
            patch.setattr(two_stage_search, name, 1)
        answers = _two_stages(recognizer, n_reduced=2)[0].recognize(asked)
    nearest = recognizer.log_similarity(asked).argmax(axis=1)
    assert [one.nearest[0].index for one in answers if one.label == one.ranked[0]] == [
        k for k, one in zip(nearest, answers, strict=True) if one.label == one.ranked[0]
    ]
    assert [one.ranked[0] for one in answers] == recognizer.references_.labels[nearest].tolist()


def test_the_order_of_questions_and_of_stored_movements_does_not_matter():
    recognizer = Recognizer(classifier="nearest").fit(draw_shapes([6] * 12, 2, 3))
    asked = draw_shapes([2] * 12, 2, 3, spread=0.3)
    order = np.random.default_rng(0).permutation(72)
    plain, mixed = _two_stages(recognizer)[0], _two_stages(recognizer, order, blocks=5)[0]
    backwards = mixed.recognize(asked[::-1])[::-1]
    for a, b in zip(plain.recognize(asked), backwards, strict=True):
        assert a.label == b.label
        assert a.p_values == pytest.approx(b.p_values, abs=1e-9)
        assert [one.index for one in a.nearest] == [order[one.index] for one in b.nearest]


def test_doubt_is_bounded():
    """Among copies every bound is as good as any other: no more than a limit are compared."""
    one = draw_shapes([1], 2, 0)
    copies = Demonstrations.from_arrays([one[0].positions] * 300 + [one[0].positions[::-1]] * 3, [0] * 300 + [1] * 3)
    recognizer = Recognizer(classifier="nearest", weights="equal").fit(copies)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(two_stage_search, "_MOST", 20)
        patch.setattr(two_stage_search, "_OF_CLASSES", 10)
        two, fetched = _two_stages(recognizer, n_reduced=2)
        assert two.recognize(one)[0].label == 0
    assert fetched[-1] <= 30


def test_an_error_rate_is_a_share():
    two, _ = _two_stages(Recognizer().fit(draw_shapes([2, 2], 2, 0)))
    with pytest.raises(SpecificationError, match=r"error_rate below 1, got 1\.5"):
        two.recognize(draw_shapes([1], 2, 0), error_rate=1.5)


def test_what_many_questions_share_is_read_once():
    recognizer = Recognizer(classifier="nearest").fit(draw_shapes([6] * 12, 2, 3))
    two, fetched = _two_stages(recognizer)
    asked = draw_shapes([4] * 12, 2, 5, spread=0.3)
    fetched.clear()
    two.recognize(asked)
    assert sum(fetched) <= len(recognizer.references_)


@pytest.mark.parametrize("held", [1, 40])
def test_answers_do_not_depend_on_how_many_references_are_held(held, monkeypatch):
    recognizer = Recognizer(classifier="nearest").fit(draw_shapes([6] * 12, 2, 3))
    asked = draw_shapes([2] * 12, 2, 3, spread=0.3)
    plain = _two_stages(recognizer)[0].recognize(asked)
    monkeypatch.setattr(references, "_HELD", held)
    for a, b in zip(plain, _two_stages(recognizer)[0].recognize(asked), strict=True):
        assert (a.label, a.p_values, a.ranked, a.nearest) == (b.label, b.p_values, b.ranked, b.nearest)
        np.testing.assert_array_equal(a.transform.matrix, b.transform.matrix)
