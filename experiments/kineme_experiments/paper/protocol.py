"""The paper's protocol: three demonstrations per class, leave one out, by 1-NN and by SVM.

The recordings of the paper (150 samples, 30 movements) are an earlier release that no package contains. So the
experiment is repeated on many random draws from the seven recordings per class of today, and the range is reported.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.model_selection import LeaveOneOut
from sklearn.neighbors import NearestNeighbors
from sklearn.svm import SVC

from kineme_experiments.paper import paper


def draw(labels: NDArray[Any], per_class: int, seed: int, index: int) -> NDArray[np.intp]:
    """Indices of `per_class` random movements of each class; draw `index` of the sequence `seed`."""
    rng = np.random.default_rng([seed, index])
    chosen = [rng.choice(np.flatnonzero(labels == label), per_class, replace=False) for label in np.unique(labels)]
    return np.concatenate(chosen)


def nearest_neighbor_accuracy(rows: NDArray[Any], labels: NDArray[Any], metric: str = "euclidean") -> float:
    """Leave-one-out accuracy of 1-NN; `kneighbors` of the training rows excludes each row itself."""
    nearest = NearestNeighbors(n_neighbors=1, metric=metric).fit(rows).kneighbors(return_distance=False)[:, 0]
    return float(np.mean(labels[nearest] == labels))


def svm_accuracy(gram: NDArray[Any], labels: NDArray[Any], penalty: float = paper.PENALTY) -> float:
    """Leave-one-out accuracy of an SVM.

    Parameters
    ----------
    gram : ndarray of shape (n, n), or (n, n, n)
        One Gram matrix for all splits; or one per split, of a kernel whose widths come from its training rows.
    labels : ndarray of shape (n,)
    """
    right = [model.predict(gram_of_test)[0] == label for model, gram_of_test, label in _left_out(gram, labels, penalty)]
    return float(np.mean(right))


def share_at_bound(gram: NDArray[Any], labels: NDArray[Any], penalty: float = paper.PENALTY) -> float:
    """Share of the multipliers at their bound C, in the class that the test movement was taken from.

    Parameters as of `svm_accuracy`.
    """
    shares = []
    for model, _, label in _left_out(gram, labels, penalty):
        stops = np.cumsum(model.n_support_)  # support vectors are ordered by class
        c = int(np.flatnonzero(model.classes_ == label)[0])
        own = np.abs(model.dual_coef_[:, stops[c] - model.n_support_[c] : stops[c]])  # a row per other class
        members = np.count_nonzero(labels == label) - 1
        shares.append(np.count_nonzero(own >= penalty * (1 - 1e-9)) / (len(own) * members))
    return float(np.mean(shares))


def _left_out(gram: NDArray[Any], labels: NDArray[Any], penalty: float) -> Iterator[tuple[SVC, NDArray[Any], Any]]:
    """Of each split the SVM, the similarities of the test row to the training rows, and its label."""
    n = len(labels)
    for (train, test), similar in zip(LeaveOneOut().split(labels), np.broadcast_to(gram, (n, n, n)), strict=True):
        model = SVC(kernel="precomputed", C=penalty).fit(similar[np.ix_(train, train)], labels[train])
        yield model, similar[np.ix_(test, train)], labels[test[0]]
