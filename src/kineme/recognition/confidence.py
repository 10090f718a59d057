"""How likely each known class is, from the distances to the nearest demonstrations of each."""

from __future__ import annotations

import numpy as np

from kineme.recognition.left_out import LEAST, distances
from kineme.validation import Array

#: Power of the ratio of distances. The right classes of 20 gestures in space by five people, one to four demonstrations
#: of each, are most likely at 14.3 with demonstrations by the same person and at 15.7 with those by others
#: (``python -m bench --only open_set``).
EXPONENT = 15.0


def class_probabilities(similar: Array) -> Array:
    """Probability of each class for movements that are of one of them, (n, C); rows sum to 1.

    ``P(c) = d_c^(-15) / sum_j d_j^(-15)`` with d_c the distance to the nearest demonstration of class c, or to the
    nearest in each representation, in kernel widths: of two classes, the odds are the ratio of the distances to the
    power of 15. This is the estimate of densities by nearest neighbors, ``1 / d^m`` in m dimensions; only m is fitted.

    Parameters
    ----------
    similar : ndarray of shape (n, C)
        Log similarity to each class, by which its label is chosen.
    """
    logs = -EXPONENT * np.log(np.maximum(distances(similar), LEAST))
    shares = np.exp(logs - logs.max(axis=1, keepdims=True))
    return np.asarray(shares / shares.sum(axis=1, keepdims=True))
