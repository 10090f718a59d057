"""How fast a path can be moved along within limits of velocity and acceleration, in closed form."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError
from kineme.validation import Array, as_numbers


def least_durations(
    durations: Array,
    fixed_velocity: bool,
    motion: tuple[Array, Array],
    limits: tuple[ArrayLike | None, ArrayLike | None],
) -> Array:
    """Least durations (n,) for velocities and accelerations (n, T, d); see `Rollout.least_duration`."""
    if fixed_velocity:
        raise SpecificationError(
            "expected a movement whose velocities scale with its tempo, got one with velocity=, end_velocity= or "
            "goal_velocity= other than 0: its path depends on the duration; try durations, and look at velocities "
            "and accelerations"
        )
    if all(limit is None for limit in limits):
        raise SpecificationError("expected a limit: velocity, acceleration, or both")
    factors = np.zeros(len(durations))
    for power, name, rates, limit in zip((1, 2), ("velocity", "acceleration"), motion, limits, strict=True):
        if limit is not None:
            largest = _largest(name, limit, rates.shape[2])
            exceeded = (np.abs(rates).max(axis=1) / largest).max(axis=1)
            factors = np.maximum(factors, exceeded ** (1.0 / power))
    return np.asarray(durations * factors)


def _largest(name: str, limit: ArrayLike, n_dims: int) -> Array:
    """A limit as positive (d,)."""
    value = as_numbers(limit, name)
    if value.shape not in {(), (n_dims,)} or not (value > 0).all() or not np.isfinite(value).all():
        raise SpecificationError(f"expected {name} to be a number above 0, or {n_dims} of them, got {limit!r}")
    return np.broadcast_to(value, n_dims)
