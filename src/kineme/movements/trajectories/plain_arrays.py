"""Concatenate lists of arrays that need no conversion, the usual case, without a Python call for each array.

`bytes.join` copies ten thousand arrays of 160 samples in half the time of `numpy.concatenate`, which takes longer to
prepare the copy of such an array than to copy it.
"""

from __future__ import annotations

from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.validation import MIN_SAMPLES, Array

_FLOAT64 = np.dtype(np.float64)


def plain_block(arrays: list[Any]) -> tuple[Array, NDArray[np.intp]] | None:
    """Positions (total, d), read-only, and offsets (n + 1,), of contiguous float64 arrays (T_i, d).

    None if any is something else, or too short, or of another d: then each has to be checked.
    """
    strides = set(map(attrgetter("strides"), arrays)) if _are_plain(arrays, 2) else set()
    if len(strides) != 1:
        return None
    lengths = _lengths(arrays)
    joined = _joined(arrays) if lengths.min() >= MIN_SAMPLES else None
    if joined is None:
        return None
    n_dims = (
        strides.pop()[0] // _FLOAT64.itemsize
    )  # contiguous arrays of several rows with equal strides: of equal rows
    offsets = np.concatenate(([0], np.cumsum(lengths)))
    return (joined.reshape(-1, n_dims), offsets) if 0 < joined.size == offsets[-1] * n_dims else None


def plain_stamps(times: list[Any], lengths: NDArray[np.intp]) -> Array | None:
    """Time stamps (total,), read-only, of contiguous float64 arrays of those lengths; None of anything else."""
    if not _are_plain(times, 1) or (_lengths(times) != lengths).any():
        return None
    return _joined(times)


def _are_plain(arrays: list[Any], n_axes: int) -> bool:
    """Whether there are arrays, and all are float64 with that many axes."""
    return (
        set(map(type, arrays)) == {np.ndarray}
        and set(map(attrgetter("dtype"), arrays)) == {_FLOAT64}
        and set(map(attrgetter("ndim"), arrays)) == {n_axes}
    )


def _lengths(arrays: list[Any]) -> NDArray[np.intp]:
    return np.fromiter(map(len, arrays), np.intp, len(arrays))


def _joined(arrays: list[Any]) -> Array | None:
    """The numbers of all arrays, one array after the other; None if one is not contiguous."""
    try:
        return np.frombuffer(b"".join(arrays), _FLOAT64)
    except (TypeError, ValueError, BufferError):
        return None
