"""The paper's protocol: three demonstrations per class, leave one out, by 1-NN and by SVM.

The recordings of the paper (150 samples, 30 movements) are an earlier release that no package carries. So
the experiment is repeated on many random draws from today's seven per class, and its spread reported.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.model_selection import LeaveOneOut
from sklearn.neighbors import NearestNeighbors
from sklearn.svm import SVC

from kineme.reproduction.choices import PENALTY


def draw(labels: NDArray[Any], per_class: int, seed: int, index: int) -> NDArray[np.intp]:
    """Indices of `per_class` random movements of each class; draw `index` of the sequence `seed`."""
    rng = np.random.default_rng([seed, index])
    chosen = [rng.choice(np.flatnonzero(labels == label), per_class, replace=False) for label in np.unique(labels)]
    return np.concatenate(chosen)


def nearest_neighbor_accuracy(rows: NDArray[Any], labels: NDArray[Any], metric: str = "euclidean") -> float:
    """Leave-one-out accuracy of 1-NN: scikit-learn's neighbors of the training rows leave each row itself out."""
    nearest = NearestNeighbors(n_neighbors=1, metric=metric).fit(rows).kneighbors(return_distance=False)[:, 0]
    return float(np.mean(labels[nearest] == labels))


def svm_accuracy(gram: NDArray[Any], labels: NDArray[Any], penalty: float = PENALTY) -> float:
    """Leave-one-out accuracy of an SVM.

    Parameters
    ----------
    gram : ndarray of shape (n, n), or (n, n, n)
        One Gram matrix for all splits; or one per split, of a kernel whose widths come from its training rows.
    labels : ndarray of shape (n,)
    """
    n = len(labels)
    right = 0
    for (train, test), similar in zip(LeaveOneOut().split(labels), np.broadcast_to(gram, (n, n, n)), strict=True):
        model = SVC(kernel="precomputed", C=penalty).fit(similar[np.ix_(train, train)], labels[train])
        right += int(model.predict(similar[np.ix_(test, train)])[0] == labels[test[0]])
    return right / n
