"""Splits by person, and the measures of anchoring."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme_experiments.evaluation.data import DataSet
from kineme_experiments.evaluation.protocols import PROTOCOLS
from kineme_experiments.evaluation.score_split import clustered
from kineme_experiments.evaluation.splits import one_person_out, within_person
from kineme_experiments.evaluation.trials import Settings

LABELS = np.array(list("abcd") * 15)
PEOPLE = np.repeat(list("xyz"), 20)
seeds, draws = st.integers(0, 10**6), st.integers(0, 50)


@given(seeds, draws, st.sampled_from([1, 2, 4]), st.sampled_from("xyz"))
def test_templates_are_by_others_only(seed, draw, shots, person):
    tested = person == PEOPLE
    split = one_person_out(LABELS, tested, shots, seed, draw)
    assert not tested[split.train].any()
    assert split.test.tolist() == np.flatnonzero(tested).tolist()
    assert np.unique(LABELS[split.train], return_counts=True)[1].tolist() == [shots] * 4
    assert split.known.all()


@given(seeds, draws, st.sampled_from([1, 2, 4]), st.sampled_from("xyz"))
def test_templates_are_by_oneself_only(seed, draw, shots, person):
    tested = person == PEOPLE
    split = within_person(LABELS, tested, shots, seed, draw)
    assert tested[split.train].all()
    assert tested[split.test].all()
    assert sorted([*split.train, *split.test]) == np.flatnonzero(tested).tolist()
    assert np.unique(LABELS[split.train], return_counts=True)[1].tolist() == [shots] * 4
    fewer = within_person(LABELS, tested, 1, seed, draw)
    assert set(fewer.train) <= set(split.train)


def test_a_class_of_too_few_movements_is_left_out():
    labels, tested = np.array(list("aaabbc" + "aabb")), np.arange(10) < 6
    split = within_person(labels, tested, 2, 0, 0)
    assert set(labels[split.train]) == {"a"}
    assert set(labels[split.test]) == {"a"}
    assert set(labels[one_person_out(labels, tested, 1, 0, 0).test]) == {"a", "b"}  # nobody else made a c


@given(seeds, draws)
def test_unknown_classes_are_those_that_do_not_train(seed, draw):
    split = one_person_out(LABELS, PEOPLE == "x", 2, seed, draw, unknown=True)
    assert len(set(LABELS[split.train])) == 2
    assert len(split.test) == 20
    np.testing.assert_array_equal(split.known, np.isin(LABELS[split.test], LABELS[split.train]))


def test_people_take_turns(of_people):
    protocol = PROTOCOLS["user-independent"]
    assert protocol.n_splits(of_people, Settings(splits=10)) == 12
    assert protocol.n_splits(of_people, Settings(splits=2)) == 2
    assert [protocol.person(of_people, k) for k in range(5)] == ["ann", "bob", "cy", "ann", "bob"]
    for k in range(6):
        for trial in protocol.trials(of_people, Settings(), k):
            assert set(of_people.people[trial.split.test]) == {protocol.person(of_people, k)}
    trained = [next(iter(protocol.trials(of_people, Settings(), k))).split.train.tolist() for k in (0, 3)]
    assert trained[0] != trained[1]


def test_by_default_shots_go_up_to_eight_where_there_are_so_many(of_people):
    def shots(name):
        return [trial.condition.strength for trial in PROTOCOLS[name].trials(of_people, Settings(), 0)]

    assert shots("user-independent") == [1, 2, 3, 4, 8]
    assert shots("user-dependent") == [1, 2, 3]  # of four movements
    assert [t.condition.strength for t in PROTOCOLS["few-shot"].trials(of_people, Settings(), 0)] == [1, 3, 5]


def test_people_decide_what_runs(small, of_people):
    nobody = DataSet("small", small, {})
    for name, protocol in PROTOCOLS.items():
        chosen = name not in {"leave-one-out", "cross-validation"}
        assert protocol.runs_by_default(of_people) is (protocol.by_person and chosen)
        assert protocol.runs_by_default(nobody) is (not protocol.by_person and chosen)
        assert ("which of at least two people" in protocol.unsuitable(nobody)) is protocol.by_person


def test_clusters_are_compared_with_classes():
    labels = np.array(list("aabbcc"))
    right, left_over = np.array([2, 2, 0, 0, 1, 1]), np.array([0, 0, 1, 1, -1, -1])
    assert clustered(right, right, labels) == {"adjusted_rand": 1.0, "adjusted_rand_given": 1.0, "clusters": 1.0}
    found = clustered(left_over, right, labels)
    assert found["adjusted_rand"] < 1.0
    assert found["clusters"] == pytest.approx(2 / 3)
    apart = clustered(np.array([0, 0, 1, 1, 2, 3]), right, labels)
    assert found["adjusted_rand"] == apart["adjusted_rand"]  # what is left over counts as clusters of one
    assert set(clustered(None, right, labels)) == {"adjusted_rand_given"}
