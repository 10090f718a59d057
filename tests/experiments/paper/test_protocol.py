"""The shortcuts of the protocol against scikit-learn's own leave-one-out."""

import numpy as np
import pytest
from sklearn.model_selection import LeaveOneOut, cross_val_score
from sklearn.neighbors import KNeighborsClassifier
from sklearn.svm import SVC

from kineme_experiments.paper.protocol import draw, nearest_neighbor_accuracy, share_at_bound, svm_accuracy


@pytest.fixture(params=range(5))
def overlapping_classes(request):
    rng = np.random.default_rng(request.param)
    y = np.repeat(np.arange(5), 4)
    return rng.normal(size=(20, 3)) + 0.8 * y[:, None], y


@pytest.mark.parametrize("metric", ["euclidean", "cosine"])
def test_nearest_neighbor_is_leave_one_out(overlapping_classes, metric):
    X, y = overlapping_classes
    model = KNeighborsClassifier(1, metric=metric)
    assert nearest_neighbor_accuracy(X, y, metric) == cross_val_score(model, X, y, cv=LeaveOneOut()).mean()


def test_svm_is_leave_one_out(overlapping_classes):
    X, y = overlapping_classes
    expected = cross_val_score(SVC(C=3.0, gamma=0.5), X, y, cv=LeaveOneOut()).mean()
    gram = np.exp(-0.5 * ((X[:, None] - X[None]) ** 2).sum(-1))
    assert svm_accuracy(gram, y, penalty=3.0) == pytest.approx(expected)


def test_share_at_bound_is_of_the_class_that_lost_a_movement(overlapping_classes):
    X, y = overlapping_classes
    gram, C = np.exp(-0.5 * ((X[:, None] - X[None]) ** 2).sum(-1)), 0.8
    shares = []
    for i in range(len(y)):
        train = np.delete(np.arange(len(y)), i)
        mine = train[y[train] == y[i]]
        for other in set(y) - {y[i]}:
            pair = np.concatenate([mine, train[y[train] == other]])
            model = SVC(kernel="precomputed", C=C).fit(gram[np.ix_(pair, pair)], y[pair])
            bound = model.support_[np.isclose(np.abs(model.dual_coef_[0]), C)]
            shares.append(np.isin(np.arange(len(mine)), bound).mean())
    assert 0.1 < np.mean(shares) < 1
    assert share_at_bound(gram, y, C) == pytest.approx(np.mean(shares), abs=0.01)
    assert share_at_bound(gram, y, 1e-6) == 1.0
    assert share_at_bound(gram, y, 1e6) == 0.0


def test_a_draw_takes_equally_many_of_each_class_without_repetition():
    labels = np.repeat(list("abcd"), 7)
    chosen = draw(labels, 3, seed=1, index=2)
    assert len(set(chosen)) == 12
    assert (np.unique(labels[chosen], return_counts=True)[1] == 3).all()


def test_draws_depend_on_seed_and_index_only():
    labels = np.repeat(list("abcd"), 7)
    assert (draw(labels, 3, 1, 2) == draw(labels, 3, 1, 2)).all()
    assert (draw(labels, 3, 1, 2) != draw(labels, 3, 1, 3)).any()
    assert (draw(labels, 3, 1, 2) != draw(labels, 3, 2, 2)).any()
