"""Measures against scikit-learn and against their words."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.metrics import roc_auc_score

from kineme_experiments.evaluation.score_split import accuracy, auroc, open_set


@given(st.integers(0, 1000), st.booleans())
def test_auroc_is_scikit_learns_with_and_without_ties(seed, tied):
    rng = np.random.default_rng(seed)
    inside, outside = rng.normal(1, 1, 30), rng.normal(0, 1, 17)
    if tied:
        inside, outside = inside.round(), outside.round()
    truth = np.repeat([1, 0], [30, 17])
    assert auroc(inside, outside) == pytest.approx(roc_auc_score(truth, np.concatenate((inside, outside))))


@given(st.integers(0, 1000))
def test_at_most_five_percent_of_the_known_are_rejected(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(5, 200))
    known, familiarity = np.arange(n + 40) < n, rng.normal(size=n + 40)
    scores = open_set(np.zeros(n + 40), np.zeros(n + 40), familiarity, known)
    rejected = 1 - scores["accuracy"]  # every class is right here
    assert rejected <= 0.05 + 1e-12
    assert rejected > 0.05 - 1 / n - 1e-12


def test_separated_scores_reject_all_unknown():
    familiarity, known = np.array([3.0, 4.0, 1.0, 2.0]), np.array([True, True, False, False])
    scores = open_set(np.array([0, 1, 0, 0]), np.array([0, 0, 7, 7]), familiarity, known)
    assert scores == {"auroc": 1.0, "rejected": 1.0, "accuracy": 0.5}


def test_one_score_for_all_tells_nothing_apart():
    scores = open_set(np.zeros(4), np.zeros(4), np.ones(4), np.array([True, True, False, False]))
    assert scores == {"auroc": 0.5, "rejected": 0.0, "accuracy": 1.0}


def test_accuracy_is_the_share_that_is_right():
    assert accuracy(np.array(["a", "b", "a"]), np.array(["a", "b", "b"])) == {"accuracy": pytest.approx(2 / 3)}
