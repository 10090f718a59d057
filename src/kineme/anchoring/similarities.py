"""How alike movements are, without labels: the recognizer's averaged kernel at widths of the movements' own."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kineme.anchoring.seen import Seen, see
from kineme.anchoring.widths import gap_widths
from kineme.comparison.similarity import AveragedSimilarity
from kineme.errors import SpecificationError
from kineme.recognition.recognizer import Recognizer
from kineme.validation import Array

_TILE_PAIRS = 500_000  # at a time: each representation's kernel is held beside the average


def similarities(movements: Any, like: Recognizer | None = None, widths: ArrayLike | None = None) -> Array:
    """The averaged kernel ``K(a, b)`` between all movements, shape (n, n), from 0 to 1 and 1 on the diagonal.

    Parameters
    ----------
    movements : Seen, or movements as `Demonstrations.of` accepts them
    like : Recognizer, optional
        Whose representations, invariances and mean to take; it need not be fitted, and its labels are not used.
    widths : array_like of shape (R,), optional
        Of each representation; by default `gap_widths`.
    """
    seen = see(movements, like)
    K = compare(averaged(seen, widths), seen, seen)
    K = 0.5 * (K + K.T)
    np.fill_diagonal(K, 1.0)
    return np.asarray(K)


def averaged(seen: Seen, widths: ArrayLike | None = None) -> AveragedSimilarity:
    """The averaged kernel at the widths given, or at those that the movements themselves suggest.

    Raises
    ------
    SpecificationError
        Not one positive width for each representation.
    """
    sigma = gap_widths(seen) if widths is None else np.asarray(widths, dtype=np.float64)
    if sigma.shape != (len(seen.views),) or not (np.isfinite(sigma).all() and (sigma > 0).all()):
        raise SpecificationError(
            f"expected widths to be {len(seen.views)} numbers above 0, one for each representation, got {widths!r}"
        )
    return AveragedSimilarity(seen.procrustes, sigma, seen.mean)


def compare(similarity: AveragedSimilarity, A: Seen, B: Seen) -> Array:
    """The averaged kernel between movements, shape (n, m)."""
    K = np.empty((len(A), len(B)))
    step = max(1, _TILE_PAIRS // max(1, len(B)))
    for start in range(0, len(A), step):
        rows = slice(start, start + step)
        K[rows] = np.exp(similarity.log_average(A.take(rows).views, B.views))
    return K
