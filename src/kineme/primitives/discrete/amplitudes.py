"""The divisions by g - x0 of the original formulation: refuse zero, warn if it is close to zero."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from kineme.errors import DegenerateMovementError, DegenerateMovementWarning
from kineme.primitives.discrete.formulations import ZERO
from kineme.validation import Array, describe

_NEAR = 1e-2  # of the extent: the division magnifies noise a hundredfold


def safe_amplitudes(amplitudes: Array, extents: Array, names: Sequence[str | None] | None, feature: str) -> Array:
    """Return `amplitudes` g - x0 (n, d) if none is zero.

    Raises
    ------
    DegenerateMovementError
        Where g = x0 in a dimension: a closed or a flat movement.

    Warns
    -----
    DegenerateMovementWarning
        Once, with a count, for movements whose g is closer to x0 than 1 % of the movement's largest extent.
    """
    relative = np.abs(amplitudes) / extents.max(axis=1, keepdims=True)
    zero = relative <= ZERO
    if zero.any():
        i, k = (int(index) for index in np.argwhere(zero)[0])
        raise DegenerateMovementError(
            f"{describe(i, names)}: expected g != x0 in every dimension, got equal start and goal in "
            f"dimension {k} ({zero.any(axis=1).sum()} of {len(zero)} movements are closed or flat); the original "
            f'formulation divides by g - x0 to get {feature}: use feature "shape-attractor", which does not, or the '
            '"bio-inspired" formulation'
        )
    near = (relative < _NEAR).any(axis=1)
    if near.any():
        warnings.warn(
            f"{near.sum()} of {len(near)} movements end within 1 % of their extent from where they start, in some "
            f"dimension (first: {describe(int(np.argmax(near)), names)}); "
            f'their {feature} are large and fragile: prefer "shape-attractor" or the "bio-inspired" formulation',
            DegenerateMovementWarning,
            stacklevel=4,
        )
    return amplitudes
