"""Measures: accuracy, and how well known movements are told from unknown ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.validation import Array

FALSE_REJECTION = 0.05  # of known movements
_OVERLAP = 0.5  # of the union of two stretches, from which on they count as one


class Stretch(NamedTuple):
    """A movement within a recording: from when to when [s], and its class."""

    start: float
    end: float
    label: Any


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


def spotted(found: Sequence[Sequence[Stretch]], true: Sequence[Sequence[Stretch]]) -> dict[str, float]:
    """Precision and recall of stretches found in several recordings.

    A found stretch is right if a true one of its class overlaps it by at least half of their union; no true one counts
    twice. Where nothing is found, precision is 0.
    """
    right = sum(_right(*both) for both in zip(found, true, strict=True))
    n_found, n_true = sum(map(len, found)), sum(map(len, true))
    return {"precision": right / n_found if n_found else 0.0, "recall": right / n_true}


def _right(found: Sequence[Stretch], true: Sequence[Stretch]) -> int:
    """Number of found stretches that are right; above half of the union, no two of either can overlap the same one."""
    left = list(true)
    for one in found:
        matching = (k for k, other in enumerate(left) if one.label == other.label and _overlap(one, other) >= _OVERLAP)
        if (k := next(matching, None)) is not None:
            del left[k]
    return len(true) - len(left)


def _overlap(one: Stretch, other: Stretch) -> float:
    """Length of the intersection over that of the union."""
    union = max(one.end, other.end) - min(one.start, other.start)
    return max(min(one.end, other.end) - max(one.start, other.start), 0.0) / union


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
