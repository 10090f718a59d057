"""Kernel widths where nobody has said which movements are of one kind."""

from __future__ import annotations

import numpy as np

from kineme.anchoring.seen import Seen
from kineme.comparison.sampling import evenly_spaced
from kineme.errors import SpecificationError
from kineme.validation import Array

_WIDTH = 0.35  # of the distance to what lies beyond the gap, as the recognizer takes of that to an impostor
_ROWS = 500  # movements whose neighbors are looked at, at most
_SAME = 1e-5  # of a movement's size: nearer ones are copies, and rounding alone says how near


def gap_widths(seen: Seen) -> Array:
    """Width sigma_r of each representation: 0.35 of the typical distance to the first movement beyond a gap.

    The recognizer takes that share of the distance to the nearest movement of another class. Without labels the class
    is told by its edge: sorted by distance, ``d_1 <= d_2 <= ...``, the neighbors of a movement of some kind are first
    its own kind, then the others, and where kinds are apart the largest ratio ``d_{k+1} / d_k`` lies between them.
    ``d_{k+1}`` stands for the nearest impostor; the median over movements forgives those whose gap lies elsewhere. k
    runs from 1 to n / 2, so neither the number of kinds nor their sizes are assumed. A fixed k would be within the
    kind for some sizes and beyond it for others.

    This is the gap by which agglomerative clusterings are cut (the largest step of merge heights), looked for around
    each movement by itself, where the scale is local.

    Returns
    -------
    ndarray of shape (R,)

    Raises
    ------
    SpecificationError
        Fewer than three movements, or all the same.
    """
    n = len(seen)
    if n < 3:
        raise SpecificationError(f"expected at least 3 movements to tell kinds apart without labels, got {n}; add some")
    chosen = evenly_spaced(n, _ROWS)
    widths = []
    for prepared in seen.views:
        squares = seen.procrustes.squared_distances(prepared.take(chosen), prepared)
        squares[np.arange(len(chosen)), chosen] = -1.0  # itself first
        beyond = _beyond_the_gap(np.sqrt(np.sort(squares, axis=1)[:, 1:]), float(np.sqrt(np.median(prepared.squares))))
        widths.append(_WIDTH * beyond)
    return np.array(widths)


def _beyond_the_gap(ordered: Array, size: float) -> float:
    """Typical first distance beyond the largest ratio, of distances (k, n - 1) in rising order."""
    ordered = np.maximum(ordered, _SAME * size)
    last = max(2, (ordered.shape[1] + 1) // 2)
    ratios = np.log(ordered[:, 1:last] / ordered[:, : last - 1])
    found = np.take_along_axis(ordered, ratios.argmax(axis=1)[:, None] + 1, axis=1)[:, 0]
    found = found[found > _SAME * size]
    if not len(found):
        raise SpecificationError("expected movements that differ, got copies of one movement; add other movements")
    return float(np.median(found))
