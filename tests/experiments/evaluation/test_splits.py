"""Splits are functions of labels and seed; each covers what it says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme_experiments.evaluation.splits import few_shot, folds, half_unknown, one_left_out

LABELS = np.array(list("abcd" * 3 + "ab" * 4))
seeds, indices = st.integers(0, 10**6), st.integers(0, 50)


def counts(labels):
    return dict(zip(*np.unique(labels, return_counts=True), strict=True))


def covers(split):
    return sorted([*split.train, *split.test]) == list(range(len(LABELS)))


@given(seeds, indices, st.sampled_from([1, 2]))
def test_few_shots_take_as_many_of_each_class_and_test_the_rest(seed, index, shots):
    split = few_shot(LABELS, shots, seed, index)
    assert counts(LABELS[split.train]) == dict.fromkeys("abcd", shots)
    assert covers(split)
    assert split.known.all()


@given(seeds, indices)
def test_more_shots_add_to_fewer(seed, index):
    assert set(few_shot(LABELS, 1, seed, index).train) < set(few_shot(LABELS, 2, seed, index).train)


@given(seeds)
def test_the_same_seed_repeats_and_the_index_changes(seed):
    trains = [few_shot(LABELS, 1, seed, k).train.tolist() for k in range(20)]
    assert trains == [few_shot(LABELS, 1, seed, k).train.tolist() for k in range(20)]
    assert len(set(map(tuple, trains))) > 5


def test_one_is_left_out():
    split = one_left_out(LABELS, 3)
    assert split.test.tolist() == [3]
    assert covers(split)


@given(seeds, indices, st.sampled_from([2, 3]))
def test_folds_test_everything_once_and_spread_every_class(seed, index, n):
    splits = folds(LABELS, n, seed, index)
    assert sorted(np.concatenate([one.test for one in splits])) == list(range(len(LABELS)))
    assert all(covers(one) for one in splits)
    for label in "abcd":
        sizes = [int((LABELS[one.test] == label).sum()) for one in splits]
        assert max(sizes) - min(sizes) <= 1
    sizes = [len(one.test) for one in splits]
    assert max(sizes) - min(sizes) <= 1


@given(seeds, indices)
def test_half_of_the_classes_is_unknown(seed, index):
    split = half_unknown(LABELS, 2, seed, index)
    trained = counts(LABELS[split.train])
    assert list(trained.values()) == [2, 2]
    assert covers(split)
    np.testing.assert_array_equal(split.known, np.isin(LABELS[split.test], list(trained)))


@pytest.mark.parametrize("seed", range(3))
def test_each_class_is_unknown_about_half_of_the_time(seed):
    unknown = [set("abcd") - set(LABELS[half_unknown(LABELS, 1, seed, k).train]) for k in range(200)]
    for label in "abcd":
        assert 70 <= sum(label in one for one in unknown) <= 130
