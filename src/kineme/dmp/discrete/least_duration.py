"""How fast a path can be moved along within limits of velocity and acceleration, also between samples."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError
from kineme.validation import Array, as_numbers

_PER_BASIS = 32  # samples for each basis function: parabolas through three of them miss a maximum by less than 1e-5
_TILE_SAMPLES = 200_000  # in one tile of movements, each with so many


def least_durations(
    movements: Any,
    durations: Array,
    finely: tuple[float, Callable[[Any, int], Any]],
    fixed_velocity: bool,
    limits: tuple[ArrayLike | None, ArrayLike | None],
) -> Array:
    """Least durations (n,) of n movements; see `Rollout.least_duration`.

    `finely` is the number of basis functions that they pass, and what gives them so many samples.
    """
    if fixed_velocity:
        raise SpecificationError(
            "expected a movement whose velocities scale with its tempo, got one with velocity=, end_velocity= or "
            "goal_velocity= other than 0: its path depends on the duration; try durations, and look at velocities "
            "and accelerations"
        )
    if all(limit is None for limit in limits):
        raise SpecificationError("expected a limit: velocity, acceleration, or both")
    n_basis, with_samples = finely
    n_samples = math.ceil(_PER_BASIS * n_basis) + 1
    factors, size = np.zeros(len(durations)), max(1, _TILE_SAMPLES // n_samples)
    for first in range(0, len(durations), size):
        chosen = slice(first, first + size)
        tile = with_samples(movements[chosen], n_samples)
        for power, name, limit in zip((1, 2), ("velocity", "acceleration"), limits, strict=True):
            if limit is not None:
                rates = tile.velocities if power == 1 else tile.accelerations
                exceeded = (_maximum(np.abs(rates)) / _largest(name, limit, rates.shape[2])).max(axis=1)
                factors[chosen] = np.maximum(factors[chosen], exceeded ** (1.0 / power))
    return np.asarray(durations * factors)


def _maximum(x: Array) -> Array:
    """The maximum of curves (n, T, d) with even samples, shape (n, d): the top of a parabola through three of them."""
    middle = x[:, 1:-1]
    slope, bend = (x[:, 2:] - x[:, :-2]) / 2, x[:, :-2] - 2 * middle + x[:, 2:]
    inside = (bend < 0) & (np.abs(slope) < -bend)
    tops = middle - slope**2 / (2 * np.where(inside, bend, -1.0))
    return np.asarray(np.maximum(x.max(axis=1), np.where(inside, tops, 0.0).max(axis=1)))


def _largest(name: str, limit: ArrayLike, n_dims: int) -> Array:
    """A limit as positive (d,)."""
    value = as_numbers(limit, name)
    if value.shape not in {(), (n_dims,)} or not (value > 0).all() or not np.isfinite(value).all():
        raise SpecificationError(f"expected {name} to be a number above 0, or {n_dims} of them, got {limit!r}")
    return np.broadcast_to(value, n_dims)
