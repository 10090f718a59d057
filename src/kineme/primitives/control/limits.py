"""Limits of velocity and acceleration: reported where they are exceeded, never enforced."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError
from kineme.primitives.control.options import Options, numbers
from kineme.primitives.control.state import Status
from kineme.validation import Array

_NONE = Status(0)


class Limits(NamedTuple):
    """Largest velocity and acceleration (d,) of each component, or None where there is no limit."""

    velocity: Array | None
    acceleration: Array | None

    @property
    def exist(self) -> bool:
        """Whether there is any."""
        return self.velocity is not None or self.acceleration is not None

    def exceeded(self, before: Array, velocity: Array, acceleration: Array, dt: float) -> Status:
        """Which are exceeded after a step of dt from the velocity `before` it, as members of `Status`.

        The acceleration is the larger of that at the end of the step and the mean change of velocity over it.
        """
        events = _NONE
        if self.velocity is not None and (np.abs(velocity) > self.velocity).any():
            events |= Status.VELOCITY_LIMIT
        if self.acceleration is not None:
            largest = np.maximum(np.abs(acceleration), np.abs(velocity - before) / dt)
            if (largest > self.acceleration).any():
                events |= Status.ACCELERATION_LIMIT
        return events


def limits_from(options: Options, n_dims: int) -> Limits:
    """The limits of the options for d components."""
    return Limits(
        _limit("velocity_limit", options.velocity_limit, n_dims),
        _limit("acceleration_limit", options.acceleration_limit, n_dims),
    )


def _limit(name: str, value: ArrayLike | None, n_dims: int) -> Array | None:
    """A limit as positive (d,), from a number or one per dimension."""
    if value is None:
        return None
    array = numbers(name, value)
    if array.shape not in ((), (n_dims,)) or not (array > 0).all():
        raise SpecificationError(f"expected {name} to be a number above 0, or {n_dims} of them, got {value!r}")
    return np.broadcast_to(array, n_dims)
