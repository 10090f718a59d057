"""Variants of a primitive: its weights changed by numbers that a search draws, and how much they change the path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kineme.primitives.discrete.dmp import Primitives
from kineme.primitives.improvement.methods import Search
from kineme.validation import Array


def variants(primitive: Primitives, factor: Array, z: Array) -> Primitives:
    """One primitive n times, its weights changed by z (n, d r) times the factor (r, N) of one dimension."""
    n, d = len(z), primitive.n_dims
    changes = (z.reshape(n * d, -1) @ factor).reshape(n, d, -1)
    repeated = primitive[np.zeros(n, dtype=int)]
    return replace(repeated, scaled_weights=repeated.scaled_weights + changes)


def largest_deviation(search: Search, responses: Array) -> float:
    """Standard deviation of the paths where it is largest, over dimensions and time; 1 at the start.

    `responses` (r, T) are what each of the r numbers of a dimension adds to its path.
    """
    r = len(responses)
    blocks = search.covariance.reshape(-1, r, search.covariance.shape[0] // r, r)
    variances = [np.einsum("ru,rs,su->u", responses, blocks[k, :, k], responses).max() for k in range(len(blocks))]
    return float(search.size * np.sqrt(max(variances)))
