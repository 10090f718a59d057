"""Run every representation and classifier on one draw of one data set: the numbers of all tables."""

from __future__ import annotations

import warnings
from functools import lru_cache
from typing import Any

import numpy as np
import sklearn
from numpy.typing import NDArray
from scipy.spatial.distance import pdist

from kineme.datasets.lasa import LASA_26, PAPER_LETTERS, load_lasa
from kineme.errors import DegenerateMovementWarning
from kineme.kernels import RBF, TruncatedEuclidean
from kineme.kernels.base import Kernel
from kineme.movements.trajectories.demonstrations import Demonstrations, require_labels
from kineme.validation import Array
from kineme_experiments.paper import paper
from kineme_experiments.paper.protocol import draw, nearest_neighbor_accuracy, share_at_bound, svm_accuracy
from kineme_experiments.paper.representations import READINGS, REPRESENTATIONS

#: The paper's nine letters, and its "larger datasets".
DATASETS = {"paper": PAPER_LETTERS, "lasa-26": LASA_26}


@lru_cache(maxsize=2)
def _features(dataset: str) -> tuple[dict[str, Array], Any, list[str | None]]:
    """Features of all usable recordings per representation, labels as numbers, and names of unusable recordings."""
    demos, left_out = usable(dataset)
    return *features_and_labels(demos), left_out


def usable(dataset: str) -> tuple[Demonstrations, list[str | None]]:
    """The recordings that have weights, and the names of those that have none."""
    demos = load_lasa(DATASETS[dataset])
    without = without_weights(demos)
    left_out = [name for name, missing in zip(demos.names or (), without, strict=False) if missing]
    return demos[~without], left_out


def features_and_labels(demos: Demonstrations) -> tuple[dict[str, Array], Any]:
    """Features of movements per representation, and their labels as numbers."""
    labels = np.unique(require_labels(demos), return_inverse=True)[1]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DegenerateMovementWarning)  # their effect is measured here
        return {key: representation.rows(demos) for key, representation in REPRESENTATIONS.items()}, labels


def without_weights(demos: Demonstrations) -> NDArray[np.bool_]:
    """Whether g = x0 in a dimension: w and f do not exist in the original formulation; shape (n,)."""
    x, first, last = demos.positions, demos.offsets[:-1], demos.offsets[1:] - 1
    return np.asarray((x[first] == x[last]).any(axis=1))


def run_draw(dataset: str, seed: int, index: int, svm: bool) -> dict[str, Any]:
    """All accuracies of one draw.

    Returns
    -------
    dict
        ``nearest``, ``correlation`` and ``distance`` per representation; ``left_out``, names of movements that are
        never drawn, since they have no weights; with `svm`, ``svm`` per
        "representation/kernel/widths" and ``penalty`` per "representation/kernel/C", and ``width`` per
        "representation/kernel": the mean over splits of the widths of their training rows; ``at_bound`` the same way:
        the `share_at_bound` at the smallest C.
    """
    features, labels, left_out = _features(dataset)
    chosen = draw(labels, paper.PER_CLASS, seed, index)
    rows, y = {key: X[chosen] for key, X in features.items()}, labels[chosen]
    result = run_nearest(rows, y) | {"left_out": left_out}
    if svm:
        with sklearn.config_context(skip_parameter_validation=True):
            result |= run_svm(rows, y, diagnosis=dataset == "paper")
            result["svm"] |= _run_printed(rows, y, diagnosis=dataset == "paper")
    return result


def run_nearest(rows: dict[str, Array], y: Any) -> dict[str, Any]:
    """``nearest``, ``correlation`` and ``distance`` of `run_draw`, of the features and labels of one draw."""
    return {
        "nearest": {key: nearest_neighbor_accuracy(X, y) for key, X in rows.items()},
        "correlation": {key: nearest_neighbor_accuracy(rows[key], y, "cosine") for key in ("original-w", "bio-w")},
        "distance": {key: float(np.median(pdist(X))) for key, X in rows.items()},
    }


def run_svm(rows: dict[str, Array], y: Any, diagnosis: bool) -> dict[str, Any]:
    """``svm`` with median widths, ``penalty``, ``width`` and ``at_bound`` of `run_draw`."""
    accuracy: dict[str, float] = {}
    width: dict[str, float] = {}
    by_penalty: dict[str, float] = {}
    at_bound: dict[str, float] = {}
    for key, X in rows.items():
        if not any(key in keys for keys in READINGS.values()):
            continue
        for name, kernel, widths in (("rbf", RBF(), "sigma"), ("tre", TruncatedEuclidean(), "m")):
            fitted = fit_by_split(kernel, X)
            width[f"{key}/{name}"] = float(np.mean([getattr(one, widths) for one in fitted]))
            gram = np.stack([one(X) for one in fitted])
            accuracy[f"{key}/{name}/median"] = svm_accuracy(gram, y)
            if diagnosis and key == "original-sa":
                by_penalty |= {f"{key}/{name}/{C:g}": svm_accuracy(gram, y, C) for C in paper.PENALTIES[:-1]}
                at_bound[f"{key}/{name}"] = share_at_bound(gram, y, paper.PENALTIES[0])
    return {"svm": accuracy, "width": width, "penalty": by_penalty, "at_bound": at_bound}


def _run_printed(rows: dict[str, Array], y: Any, diagnosis: bool) -> dict[str, float]:
    """``svm`` of `run_draw` with the widths of the paper's Table 3."""
    accuracy: dict[str, float] = {}
    for row in REPRESENTATIONS.values():
        if not (diagnosis or row.key in READINGS["closest in distances"]):
            continue
        X, printed = rows[row.key], paper.KERNELS[row.formulation, row.quantity]
        accuracy[f"{row.key}/rbf/paper"] = svm_accuracy(printed.rbf(X), y)
        accuracy[f"{row.key}/tre/paper"] = svm_accuracy(printed.truncated(X), y)
    return accuracy


def fit_by_split(kernel: RBF | TruncatedEuclidean, X: Array) -> list[Kernel]:
    """``[kernel.fit(X without row i) for i in range(n)]``: widths from the training rows of each split.

    The differences of all pairs of rows are computed and sorted once. For up to about a hundred rows, for which `fit`
    uses every pair too.
    """
    first, second = np.triu_indices(len(X), 1)
    differences = np.abs(X[first] - X[second])
    if isinstance(kernel, RBF):
        distances = np.sqrt((differences**2).sum(axis=1, keepdims=True))
        return [RBF(sigma) for sigma in medians_without_each(distances, len(X))]
    return [TruncatedEuclidean(m, kernel.sigma) for m in medians_without_each(differences, len(X))]


def medians_without_each(values: Array, n: int) -> list[float]:
    """For each of n rows, the median of the positive values of all pairs without that row.

    Parameters
    ----------
    values : ndarray of shape (n (n - 1) / 2, p)
        Values of the pairs ``np.triu_indices(n, 1)``.
    """
    rank = np.full(values.size, -1)  # rank of each positive value among all of them
    order = np.argsort(values, axis=None, kind="stable")
    order = order[np.count_nonzero(values <= 0) :]
    rank[order] = np.arange(len(order))
    by_pair = rank.reshape(values.shape)
    ascending = values.reshape(-1)[order]
    first, second = np.triu_indices(n, 1)
    medians = []
    for row in range(n):
        removed = np.sort(by_pair[(first == row) | (second == row)], axis=None)
        removed = removed[removed >= 0]
        n_remaining = len(ascending) - len(removed)
        middle = np.array([(n_remaining - 1) // 2, n_remaining // 2])
        # The k-th of the remaining values has a rank that is higher by the number of removed values before it.
        middle += np.searchsorted(removed - np.arange(len(removed)), middle, side="right")
        medians.append(float(ascending[middle].mean()))
    return medians
