"""One index, or the indices of several movements, out of n."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

_WAYS = "an index, a slice, a list of indices or a mask with an entry per movement"


def as_indices(index: Any, n: int) -> NDArray[np.intp]:
    """What chooses some of n movements, as indices from 0: of shape () for an integer, else (k,).

    Parameters
    ----------
    index : int, slice, list of int, or mask of n bool
        Negative integers count from the end.
    n : int

    Raises
    ------
    IndexError
        Anything else, or an index out of range; the message says what was expected.
    """
    if isinstance(index, (bool, np.bool_)):  # as ("a", "b") == "a" is
        raise IndexError(f"expected {_WAYS}, got {index}; compare an array, numpy.array(labels) == label")
    if isinstance(index, (int, np.integer)):
        if not -n <= index < n:
            raise IndexError(f"expected an index below {n}, got {index}; there are {n} movements, counted from 0")
        return np.asarray(int(index) % n)
    if isinstance(index, slice):
        return np.arange(n)[index]
    array = np.asarray(index)
    if isinstance(index, tuple) or array.ndim != 1 or (array.dtype.kind not in "iub" and array.size):
        raise IndexError(f"expected {_WAYS}, got {index!r}")
    if array.dtype.kind == "b" and len(array) != n:
        raise IndexError(f"expected a mask with an entry for each of the {n} movements, got {len(array)} entries")
    chosen = np.flatnonzero(array) if array.dtype.kind == "b" else array.astype(np.intp)
    outside = (chosen < -n) | (chosen >= n)
    if outside.any():
        raise IndexError(
            f"expected indices below {n}, got {chosen[outside][0]}; there are {n} movements, counted from 0"
        )
    return chosen % n
