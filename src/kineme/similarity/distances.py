"""Squared distances of described movements in every representation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kineme.kernels.pair_distances import pair_distances
from kineme.similarity.described import Described
from kineme.validation import Array

_TILE_PAIRS = 100_000  # at a time: a pair's rotation in space has nine numbers


def squared_distances(A: Described, B: Described) -> Array:
    """Squared distances (R, n, m).

    Sample by sample they are Procrustes distances, each after a rotation of its own; pair by pair all are measured
    after the rotation that brings the positions over arc length closest.
    """
    found = np.empty((A.n_representations, len(A), len(B)))
    step = max(1, _TILE_PAIRS // max(1, len(B)))
    for start in range(0, len(A), step):
        rows = slice(start, start + step)
        _fill(A if len(A) <= step else A.take(rows), B, found[:, rows])
    return found


def _fill(A: Described, B: Described, found: Array) -> None:
    n_blocks = len(A.blocks)
    rotations = fill_by_rows(A, B, found[:n_blocks])
    if A.pairs is not None and B.pairs is not None:
        measured = pair_distances(A.pairs.shapes, B.pairs.shapes, rotations)
        found[n_blocks:] = measured[list(A.pairs.measures)]


def fill_by_rows(A: Described, B: Described, found: Array) -> NDArray[np.float32] | None:
    """Write the squared distances (R', n, m) of what is compared sample by sample; the rotations of pairs, if needed.

    See `Procrustes.align` for these.
    """
    rotations = aligned = None
    if A.pairs is not None and B.pairs is not None:
        alignment, rotations = A.procrustes.align(A.pairs.positions, B.pairs.positions)
        aligned = A.pairs.positions
    for r, (a, b) in enumerate(zip(A.blocks, B.blocks, strict=True)):
        if aligned is not None and a is aligned:
            found[r] = np.maximum(a.squares[:, None] + b.squares - 2.0 * alignment, 0.0)
        else:
            found[r] = A.procrustes.squared_distances(a, b)
    return rotations
