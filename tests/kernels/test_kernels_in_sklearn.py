"""Kernels as the ``kernel`` of scikit-learn's estimators."""

import numpy as np
import pytest
from kernel_samples import ALL, NAMED
from sklearn.base import clone
from sklearn.decomposition import KernelPCA
from sklearn.model_selection import GridSearchCV, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

from kineme.errors import SpecificationError
from kineme.kernels import RBF, TruncatedEuclidean, averaged


@pytest.fixture
def two_classes():
    rng = np.random.default_rng(0)
    y = np.repeat([0, 1], 20)
    return rng.normal(size=(40, 6)) + 3 * y[:, None] + 1, y


@pytest.mark.parametrize("kernel", ALL.values(), ids=ALL)
def test_cross_validation(kernel, two_classes):
    assert cross_val_score(SVC(kernel=kernel), *two_classes, cv=4).mean() > 0.9


def test_grid_search_over_kernels(two_classes):
    grid = {"svc__kernel": [*NAMED.values(), averaged(RBF(), 3, "geometric")], "svc__C": [1.0, 10.0]}
    search = GridSearchCV(make_pipeline(StandardScaler(), SVC()), grid, cv=3).fit(*two_classes)
    assert search.best_score_ > 0.9
    assert search.best_params_["svc__kernel"] in grid["svc__kernel"]


def test_parallel_grid_search(two_classes):
    search = GridSearchCV(SVC(), {"kernel": [RBF(1.0), TruncatedEuclidean()]}, cv=3, n_jobs=2)
    assert search.fit(*two_classes).best_score_ > 0.9


def test_clone_keeps_the_kernel():
    estimator = SVC(kernel=RBF(3.0))
    assert clone(estimator).kernel == RBF(3.0)


def test_prediction_uses_the_width_of_the_training_rows(two_classes):
    X, y = two_classes
    chosen, fixed = SVC(kernel=RBF()).fit(X, y), SVC(kernel=RBF().fit(X)).fit(X, y)
    far = X[:4] * 50
    assert np.array_equal(chosen.decision_function(far), fixed.decision_function(far))


def test_rbf_is_that_of_the_classifier(two_classes):
    X, y = two_classes
    ours, theirs = SVC(kernel=RBF(2.0)).fit(X, y), SVC(kernel="rbf", gamma=1 / 8).fit(X, y)
    np.testing.assert_allclose(ours.decision_function(X), theirs.decision_function(X), atol=1e-3)


def test_models_that_ask_pair_by_pair_are_given_the_matrix():
    rows = np.random.default_rng(0).random((8, 3))
    with pytest.raises(SpecificationError, match=r"kernel='precomputed' and the matrix kernel.fit\(X\)\(X\)"):
        KernelPCA(2, kernel=RBF()).fit(rows)
    kernel = RBF().fit(rows)
    assert KernelPCA(2, kernel="precomputed").fit(kernel(rows)).transform(kernel(rows[:3], rows)).shape == (3, 2)
