"""What the user's cost function returns, checked."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError
from kineme.validation import Array, as_numbers


def checked_costs(costs: ArrayLike, n: int, update: int) -> Array:
    """The costs (n,) of the movements of an update, as a copy.

    Raises
    ------
    SpecificationError
        Another number of costs, or costs that are NaN or infinite; with the number of the movement.
    """
    found = as_numbers(costs, "cost", f"{n} numbers, the cost of each movement")
    if found.shape != (n,):
        raise SpecificationError(
            f"expected the cost to return {n} numbers, one for each movement of the rollout, got shape {found.shape}; "
            "reduce over samples and dimensions, axis=(1, 2)"
        )
    if not np.isfinite(found).all():
        i = int(np.argmin(np.isfinite(found)))
        raise SpecificationError(
            f"expected finite costs, got {found[i]:g} for movement {i} of update {update}; "
            "give a movement that fails a large cost"
        )
    return found.copy()
