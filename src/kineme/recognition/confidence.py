"""How likely each known class is, from the distances to the nearest demonstrations of each."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from kineme.recognition.left_out import LEAST, distances
from kineme.sampling import evenly_spaced
from kineme.validation import Array

#: Power of the ratio of distances before anything is known of it. The right classes of 20 gestures in space by five
#: people, one to four demonstrations of each, are most likely at 14.3 with demonstrations by the same person and at
#: 15.7 with those by others (``python -m bench --only open_set``).
EXPONENT = 15.0
#: By how much the logarithms of the power differ between sets of movements, about: 5 to 36 were most likely on seven.
_SPREAD = 0.35
_BOUNDS = (2.0, 60.0)
_ROWS = 2000  # demonstrations that the power is fitted to, at most, evenly spaced


def class_probabilities(similar: Array, exponent: float = EXPONENT) -> Array:
    """Probability of each class for movements that are of one of them, (n, C); rows sum to 1.

    ``P(c) = d_c^(-m) / sum_j d_j^(-m)`` with d_c the distance to the nearest demonstration of class c, or to the
    nearest in each representation, in kernel widths, and m the exponent: of two classes, the odds are the ratio of the
    distances to the power of m. This is the estimate of densities by nearest neighbors, ``1 / d^m`` in m dimensions;
    only m is fitted, see `fit_exponent`.

    Parameters
    ----------
    similar : ndarray of shape (n, C)
        Log similarity to each class, by which its label is chosen.
    exponent : float
    """
    logs = _log_odds(distances(similar), exponent)
    shares = np.exp(logs)
    return np.asarray(shares / shares.sum(axis=1, keepdims=True))


def fit_exponent(away: Array, classes: NDArray[np.intp]) -> float:
    """The exponent by which demonstrations are most likely of their own classes.

    It maximizes ``sum_i log P(c_i) - (log(m / 15) / 0.35)^2 / 2``, each demonstration left out of what it is compared
    with; the last term is a log-normal prior. Without demonstrations it is 15.

    Parameters
    ----------
    away : ndarray of shape (n, C)
        Distance of each demonstration to the nearest other one of each class; infinite where there is none.
    classes : ndarray of shape (n,)
        The class of each.
    """
    if not len(away):
        return EXPONENT
    chosen = evenly_spaced(len(away), _ROWS)
    away, classes = away[chosen], classes[chosen]
    rows = np.arange(len(away))

    def loss(log_exponent: float) -> float:
        logs = _log_odds(away, math.exp(log_exponent))
        likelihood = logs[rows, classes] - np.log(np.exp(logs).sum(axis=1))
        return 0.5 * ((log_exponent - math.log(EXPONENT)) / _SPREAD) ** 2 - float(likelihood.sum())

    low, high = (math.log(bound) for bound in _BOUNDS)
    return math.exp(_golden_section(loss, low, high))


def _golden_section(loss: Callable[[float], float], low: float, high: float) -> float:
    """The argument with the least loss, to 1e-4: golden-section search (Kiefer 1953).

    `scipy.optimize` finds the same; its import takes as long as recognizing hundreds of recordings.
    """
    ratio = (math.sqrt(5) - 1) / 2
    left, right = high - ratio * (high - low), low + ratio * (high - low)
    left_loss, right_loss = loss(left), loss(right)
    while high - low > 1e-4:
        if left_loss <= right_loss:
            high, right, right_loss = right, left, left_loss
            left = high - ratio * (high - low)
            left_loss = loss(left)
        else:
            low, left, left_loss = left, right, right_loss
            right = low + ratio * (high - low)
            right_loss = loss(right)
    return (low + high) / 2


def _log_odds(away: Array, exponent: float) -> Array:
    """Logarithms of ``d^(-m)``, less the largest of each row."""
    logs = -exponent * np.log(np.maximum(away, LEAST))
    return np.asarray(logs - logs.max(axis=1, keepdims=True))
