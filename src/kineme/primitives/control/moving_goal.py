"""The goal of a movement under control: it may change at any time, at once or gradually."""

from __future__ import annotations

import math

import numpy as np

from kineme.primitives.control.plan import Plan
from kineme.validation import Array

_ARRIVED = 1e-14  # of the target's distance from the origin: rounding


class FilteredValue:
    """Numbers that approach a target with a time constant, ``filter dx/dt = target - x``, or jump without one.

    Attributes
    ----------
    target : ndarray of shape (d,)
        What was set last.
    lag : ndarray of shape (d,) or None
        Value in force minus target; None where it has arrived.
    """

    def __init__(self, target: Array, time_constant: float | None) -> None:
        self._time_constant = time_constant
        self.target = target
        self.lag: Array | None = None

    @property
    def now(self) -> Array:
        """The value in force."""
        return self.target if self.lag is None else self.target + self.lag

    def set(self, target: Array) -> None:
        """Set a target."""
        if self._time_constant is not None:
            self.lag = self.now - target
        self.target = target

    def mean(self, dt: float) -> Array:
        """Go on by dt; returns the mean of the value in force meanwhile."""
        if self.lag is None or self._time_constant is None:
            return self.target
        passed = dt / self._time_constant
        mean = self.target + self.lag * (-math.expm1(-passed) / passed if passed > 0 else 1.0)
        self.lag = self.lag * math.exp(-passed)
        if np.abs(self.lag).max() <= _ARRIVED * np.abs(self.target).max():
            self.lag = None
        return mean


class MovingGoal(FilteredValue):
    """A goal relative to the origin, and what scale f is multiplied by for it."""

    def __init__(self, plan: Plan, target: Array, time_constant: float | None) -> None:
        super().__init__(target, time_constant)
        self._plan, self._ratio = plan, plan.ratio(target)

    def aim(self, target: Array) -> bool:
        """Set a target; False, and nothing changes, where the formulation cannot go."""
        if (target == self.target).all():
            return True
        ratio = self._plan.ratio(target)
        if not np.isfinite(ratio).all():
            return False
        self.set(target)
        self._ratio = ratio
        return True

    def follow(self, dt: float) -> tuple[Array, Array]:
        """Go on by dt; returns the mean of the goal in force meanwhile and the ratio that belongs to it."""
        if self.lag is None:
            return self.target, self._ratio
        mean = self.mean(dt)
        return mean, self._plan.ratio(mean)
