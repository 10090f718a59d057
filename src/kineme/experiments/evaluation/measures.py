"""Measures: accuracy, and how well known movements are told from unknown ones."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.validation import Array

FALSE_REJECTION = 0.05  # of known movements


def accuracy(predicted: NDArray[Any], labels: NDArray[Any]) -> dict[str, float]:
    """Share of movements whose class is right."""
    return {"accuracy": float(np.mean(predicted == labels))}


def open_set(
    predicted: NDArray[Any], labels: NDArray[Any], familiarity: Array, known: NDArray[np.bool_]
) -> dict[str, float]:
    """Area under the ROC curve of known against unknown, and what a threshold at 5 % false rejection gives.

    The threshold is the lowest familiarity that at most 5 % of the known test movements stay below: it measures
    the ranking, not the choice of a threshold.

    Returns
    -------
    dict
        ``auroc``; ``rejected``, the share of unknown movements below the threshold; ``accuracy``, the share of known
        movements above it and given the right class.
    """
    inside, outside = np.sort(familiarity[known]), familiarity[~known]
    threshold = inside[int(np.floor(FALSE_REJECTION * len(inside)))]
    right = (predicted[known] == labels[known]) & (familiarity[known] >= threshold)
    return {"auroc": auroc(inside, outside), "rejected": float(np.mean(outside < threshold))} | {
        "accuracy": float(np.mean(right))
    }


def auroc(inside: Array, outside: Array) -> float:
    """Probability that a known movement is more familiar than an unknown one; ties count half (Mann and Whitney)."""
    order = np.sort(outside)
    below = np.searchsorted(order, inside, side="left") + np.searchsorted(order, inside, side="right")
    return float(below.mean() / (2.0 * len(order)))


def clustered(found: NDArray[Any] | None, given: NDArray[Any], labels: NDArray[Any]) -> dict[str, float]:
    """Adjusted Rand index of clusters, with the number of classes given, and with it found and how it was found.

    Parameters
    ----------
    found, given : ndarray of shape (n,)
        Cluster of each movement, -1 for none; such movements count as clusters of one, but not in the number. `found`
        is None for a method that must be given the number.
    labels : ndarray of shape (n,)
    """
    values = {} if found is None else {"adjusted_rand": _adjusted_rand(found, labels)}
    values["adjusted_rand_given"] = _adjusted_rand(given, labels)
    if found is not None:
        values["clusters"] = len(np.unique(found[found >= 0])) / len(np.unique(labels))
    return values


def _adjusted_rand(clusters: NDArray[Any], labels: NDArray[Any]) -> float:
    from sklearn.metrics import adjusted_rand_score

    alone = clusters < 0
    separate = np.where(alone, clusters.max(initial=0) + np.cumsum(alone), clusters)
    return float(adjusted_rand_score(labels.astype(str), separate))
