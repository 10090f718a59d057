"""The recognizer keeps scikit-learn's contract for classifiers: shapes, scores, searches, copies, errors."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from sklearn.base import clone, is_classifier
from sklearn.exceptions import NotFittedError
from sklearn.metrics import roc_auc_score
from sklearn.model_selection import GridSearchCV, cross_val_predict, cross_val_score

from kineme import Recognizer
from kineme.errors import SpecificationError
from movement_samples import draw_shapes

CLASSIFIERS = ["nearest", "prototype", "svm"]
ASKED_OF_MOVEMENTS = [
    "describe", "log_similarity", "decision_function", "predict", "predict_proba", "score", "recognize", "p_values",
    "predict_known", "novelty", "predict_partial",
]  # fmt: skip
ATTRIBUTES = ["classes_", "demonstrations_", "representations_", "weights_", "widths_", "n_dims_"]


@pytest.mark.parametrize("classifier", CLASSIFIERS)
def test_of_two_classes_the_decision_is_one_number_positive_for_the_second(classifier):
    demos, fresh = draw_shapes([4, 5], spread=0.6), draw_shapes([20, 20], spread=0.8)
    recognizer = Recognizer(classifier=classifier).fit(demos)
    decision, shares = recognizer.decision_function(fresh), recognizer.predict_proba(fresh)
    assert decision.shape == (40,)
    assert shares.shape == (40, 2)
    np.testing.assert_array_equal(recognizer.predict(fresh), recognizer.classes_[(decision > 0).astype(int)])
    np.testing.assert_array_equal(recognizer.predict(fresh), recognizer.classes_[shares.argmax(axis=1)])
    if classifier == "svm":
        np.testing.assert_allclose(shares[:, 1], 1.0 / (1.0 + np.exp(-decision)), rtol=1e-6)
    assert roc_auc_score(fresh.labels == recognizer.classes_[1], decision) > 0.9


@pytest.mark.parametrize("n_classes", [1, 3, 4])
@pytest.mark.parametrize("classifier", ["nearest", "nearest-each", "prototype"])
def test_of_one_class_and_of_three_the_decision_has_a_column_for_each(n_classes, classifier):
    demos = draw_shapes([3] * n_classes)
    recognizer = Recognizer(classifier=classifier).fit(demos)
    decision = recognizer.decision_function(demos)
    assert decision.shape == (3 * n_classes, n_classes)
    np.testing.assert_array_equal(recognizer.predict(demos), recognizer.classes_[decision.argmax(axis=1)])


@pytest.mark.parametrize("classifier", CLASSIFIERS)
def test_areas_under_the_curve_are_scored_for_two_classes_and_for_more(classifier):
    two, more = draw_shapes([9, 9], spread=0.4), draw_shapes([9, 9, 9], spread=0.4)
    recognizer = Recognizer(classifier=classifier)
    areas = cross_val_score(recognizer, two, two.labels, scoring="roc_auc", cv=3)
    assert (areas > 0.9).all()
    areas = cross_val_score(recognizer, more, more.labels, scoring="roc_auc_ovr", cv=3)
    assert (areas > 0.9).all()


def test_scores_out_of_sample_line_up_with_the_labels():
    demos = draw_shapes([5, 6], spread=0.4)
    decision = cross_val_predict(Recognizer(), demos, demos.labels, method="decision_function", cv=2)
    assert decision.shape == (11,)
    assert np.mean((decision > 0) == (demos.labels == demos.labels[-1])) > 0.9


@pytest.mark.parametrize("method", ASKED_OF_MOVEMENTS)
def test_what_was_not_fitted_says_so(method):
    with pytest.raises(NotFittedError, match="not fitted yet"):
        getattr(Recognizer(), method)(draw_shapes([1, 1]))


def test_what_needs_no_movements_says_so_too():
    for ask in (Recognizer().calibration, Recognizer().stream, lambda: Recognizer().spot(np.zeros((50, 2)))):
        with pytest.raises(NotFittedError, match="not fitted yet"):
            ask()
    for name in ATTRIBUTES:
        assert not hasattr(Recognizer(), name)
        with pytest.raises(NotFittedError, match="not fitted yet"):
            getattr(Recognizer(), name)


def test_a_copy_is_not_fitted_and_a_pickle_is():
    demos = draw_shapes([3, 3, 3])
    recognizer = Recognizer(mean="geometric").fit(demos)
    recognizer.calibration()
    copied, loaded = clone(recognizer), pickle.loads(pickle.dumps(recognizer))
    assert is_classifier(copied)
    assert copied.get_params() == recognizer.get_params()
    assert not hasattr(copied, "classes_")
    np.testing.assert_array_equal(loaded.p_values(demos), recognizer.p_values(demos))
    np.testing.assert_array_equal(loaded.decision_function(demos), recognizer.decision_function(demos))


def test_a_search_over_parameters_finds_the_rotation():
    demos = draw_shapes([6, 6])
    grid = {"max_angle": [0.0, 0.5], "weights": ["equal", "auto"]}
    search = GridSearchCV(Recognizer(), grid, cv=2, scoring="roc_auc")
    assert search.fit(demos, demos.labels).best_score_ > 0.9


def test_a_fit_that_is_refused_leaves_the_last_one_whole():
    demos = draw_shapes([4, 4])
    recognizer = Recognizer(classifier="svm").fit(demos)
    expected = recognizer.decision_function(demos)
    with pytest.raises(SpecificationError, match="expected movements of two or more classes for classifier='svm', got"):
        recognizer.fit(demos[:4])
    assert len(recognizer.classes_) == 2
    np.testing.assert_array_equal(recognizer.decision_function(demos), expected)
