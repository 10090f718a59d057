"""New movements find their symbol or make a new proposal; symbols are merged and split where members say so."""

from __future__ import annotations

from importlib import import_module

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kineme
from kineme.anchoring.assignment import assign, suggest_merges, suggest_splits
from kineme.recognition.recognizer import Recognizer
from soaking import examples
from unlabeled_samples import ALL_TOGETHER, draw_kinds

quick = settings(max_examples=examples(3, 5), deadline=None, derandomize=True)
seeds = st.integers(0, 10_000)


def _old_and_new(seed, shown=5, d=2):
    """Kinds 0 to 3 shown; two more of each; then kinds 4 and 5, which are new, and one strange movement."""
    demos = draw_kinds([shown + 2] * 4 + [4, 5, 1], d, seed, spread=0.03)
    old = np.arange(len(demos)) < 4 * (shown + 2)
    known = old & (np.arange(len(demos)) % (shown + 2) < shown)
    return demos[known], demos[~known]


@pytest.mark.parametrize("shown", [3, 6])
@given(seed=seeds, d=st.sampled_from([2, 3]))
@quick
def test_new_movements_join_raise_a_kind_or_stay_unknown(shown, seed, d):
    known, new = _old_and_new(seed, shown, d)
    assignment = assign(new, known)
    joined = np.array([label is not None for label in assignment.labels])
    assert not joined[8:].any()  # nothing new joins
    assert (assignment.labels[joined] == new.labels[joined]).all()
    assert joined[:8].mean() >= 0.5  # with so few, the law of distances is an assumption
    clusters = assignment.proposals.clusters
    assert (clusters[joined] == -1).all()
    # Old movements that stay unknown are too few of a kind to be proposed.
    found = {frozenset(new.labels[one.members].tolist()) for one in assignment.proposals.proposals}
    assert found == {frozenset({"kind 04"}), frozenset({"kind 05"})}
    assert sorted(len(one) for one in assignment.proposals.proposals) == [4, 5]
    assert assignment.unknown.tolist() == [*np.flatnonzero(~joined[:8]), len(new) - 1]


def test_a_fitted_recognizer_gives_the_same_and_its_answers():
    known, new = _old_and_new(3)
    fitted = Recognizer().fit(known)
    one, other = assign(new, known), assign(new, fitted)
    assert one.labels.tolist() == other.labels.tolist() == fitted.predict_known(new).tolist()
    np.testing.assert_array_equal(one.proposals.clusters, other.proposals.clusters)
    np.testing.assert_array_equal(one.p_values, fitted.p_values(new).max(axis=1))
    assert repr(one).endswith("2 new clusters proposed, 1 unknown)")


def test_too_few_that_agree_stay_unknown():
    known, new = _old_and_new(3)
    assignment = assign(new, known, min_members=5)
    assert [len(one) for one in assignment.proposals.proposals] == [5]
    assert len(assign(new[[8, 9]], known).proposals) == 0
    assert assign(new[[8, 9]], known).unknown.tolist() == [0, 1]


def test_many_unknown_are_gathered_through_a_sample(monkeypatch):
    monkeypatch.setattr(import_module("kineme.anchoring.assignment"), "largest_clustered", lambda n_dims: 40)
    demos = draw_kinds([6, 6, 6, 40, 60], 2, 0, spread=0.03)
    assignment = assign(demos[18:], demos[:18])
    found = [demos.labels[18 + one.members] for one in assignment.proposals.proposals]
    assert [set(labels.tolist()) for labels in found] == [{"kind 04"}, {"kind 03"}]
    assert sum(map(len, found)) > 90


def test_new_kinds_of_handwriting():
    demos = ALL_TOGETHER.apply(kineme.load_lasa(), 0)
    shapes = np.unique(demos.labels)[:16]
    known = np.isin(demos.labels, shapes) & (np.arange(len(demos)) % 7 < 5)
    new = demos[~known]
    assignment = assign(new, demos[known])
    joined = np.array([label is not None for label in assignment.labels])
    assert (assignment.labels[joined] == new.labels[joined]).all()
    assert joined[np.isin(new.labels, shapes)].mean() > 0.85
    for one in assignment.proposals.proposals:
        assert len(set(new.labels[one.members].tolist())) == 1


@given(seed=seeds, d=st.sampled_from([1, 2, 3]))
@quick
def test_halves_of_one_kind_are_to_be_merged_and_nothing_else(seed, d):
    demos = draw_kinds([8, 6, 7, 5], d, seed, spread=0.03)
    labels = demos.labels.copy()
    labels[:4] = "kind X"
    assert {(one.first, one.second) for one in suggest_merges(demos, labels)} == {("kind 00", "kind X")}
    assert suggest_merges(demos, demos.labels) == ()


@given(seed=seeds, d=st.sampled_from([1, 2, 3]))
@quick
def test_two_kinds_of_one_name_are_to_be_split_and_nothing_else(seed, d):
    demos = draw_kinds([5, 6, 7, 5], d, seed, spread=0.03)
    labels = np.where(demos.labels == "kind 00", "kind 01", demos.labels)
    (found,) = suggest_splits(demos, labels)
    assert found.symbol == "kind 01"
    assert {tuple(part.tolist()) for part in found.parts} == {tuple(range(5)), tuple(range(5, 11))}
    assert found.overlap < 0.25
    assert found.stability > 0.75


def test_handwriting_of_several_shapes_per_name():
    demos = kineme.load_lasa(kineme.datasets.lasa.LASA_30)
    names = [f"Multi_Models_{k}" for k in range(1, 5)]
    assert sorted(one.symbol for one in suggest_splits(demos, demos.labels)) == names
    # The single shapes are told apart; some of those under several are the same as a single one.
    assert all(set(names) & {one.first, one.second} for one in suggest_merges(demos, demos.labels))


def test_one_symbol_or_one_member():
    demos = draw_kinds([6, 6], 2, 0)
    assert suggest_splits(demos, ["a"] * 12) == ()
    (split,) = suggest_splits(demos, ["a"] * 12, widths=Recognizer().fit(demos).widths_)
    assert [len(part) for part in split.parts] == [6, 6]
    assert suggest_merges(demos, ["a"] * 12) == ()
    labels = ["c", *demos.labels[1:]]
    assert [(one.first, one.second) for one in suggest_merges(demos, labels)] == [("c", "kind 00")]


@pytest.mark.soak
def test_many_members_speak_through_some(monkeypatch):
    monkeypatch.setattr("kineme.anchoring.assignment._LARGEST", 2000)  # 400 of one symbol
    demos = draw_kinds([1300, 900], 2, 0, spread=0.03)
    labels = np.where(np.arange(2200) % 2, "a", "b")
    (merge,) = suggest_merges(demos[:1300], labels[:1300])
    assert merge.overlap == pytest.approx(1.0, abs=0.05)
    widths = Recognizer(weights="equal").fit(demos[::50]).widths_
    (split,) = suggest_splits(demos, ["a"] * 2200, widths=widths)
    assert {tuple(part.tolist()) for part in split.parts} == {tuple(range(1300)), tuple(range(1300, 2200))}


def test_what_cannot_be_compared():
    demos = draw_kinds([4, 4])
    with pytest.raises(
        kineme.errors.SpecificationError, match=r"one label for each of the 8 movements, got shape \(2,\)"
    ):
        suggest_merges(demos, ["a", "b"])
    with pytest.raises(kineme.errors.SpecificationError, match="expected least to be a number above 0, got 0"):
        suggest_merges(demos, demos.labels, least=0)
    with pytest.raises(
        kineme.errors.SpecificationError, match="expected min_members to be a whole number of at least 2, got 1"
    ):
        assign(demos, demos, min_members=1)
