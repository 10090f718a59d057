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
