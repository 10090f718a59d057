"""Evenly spaced subsets, where all would take too long, and runs of samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def evenly_spaced(n: int, most: int) -> NDArray[np.intp]:
    """At most `most` of the indices 0 to n - 1, evenly spaced, the first and (from two on) the last among them."""
    return np.unique(np.linspace(0, n - 1, most).astype(np.intp))


def runs(mask: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the runs of True in a mask (T,): rows (n, 2), first index and one past the last."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return edges.reshape(-1, 2)
