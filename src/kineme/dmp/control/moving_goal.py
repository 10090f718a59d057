"""The goal of a movement under control: it may change at any time, at once or gradually."""

from __future__ import annotations

import math

import numpy as np

from kineme.dmp.control.plan import Plan
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
    """A goal relative to the origin, at rest or with a velocity, and what scale f is multiplied by for it.

    A goal that moves would be trailed by D / K of its velocity. So what enters the equation is ahead of it,

        x'' = (K + coupling(u)) (g + D / K g') + scale f - K x - D x'  =  K (g - x) + D (g' - x') + ...,

    which is the moving target of J. Kober, K. Mulling, O. Kromer, C. H. Lampert, B. Scholkopf, J. Peters, "Movement
    Templates for Learning of Hitting and Batting", ICRA 2010, the paper's reference [3]: there too what draws
    to the target is weighted by 1 - s, so that it begins without a jump, wherever the formulation does so with goals.
    Scale f belongs to where the goal will be at the end.

    Attributes
    ----------
    velocity : ndarray of shape (d,) or None
        Per second; None at rest.
    """

    def __init__(self, plan: Plan, target: Array, time_constant: float | None) -> None:
        super().__init__(target, time_constant)
        self.velocity: Array | None = None
        self._plan, self._ratio, self._arrival = plan, plan.ratio(target), target

    def aim(self, target: Array, velocity: Array | None = None, remaining: float = 0.0) -> bool:
        """Set a target and its velocity, `remaining` [s] before the end; False, and no change, where it cannot go."""
        if velocity is None and self.velocity is None and (target == self.target).all():
            return True
        arrival = target if velocity is None else target + remaining * velocity
        ratio = self._plan.ratio(arrival)
        if not np.isfinite(ratio).all():
            return False
        self.set(target)
        self.velocity, self._ratio, self._arrival = velocity, ratio, arrival
        return True

    def ahead(self, goal: Array, rate: Array) -> Array:
        """The goal that is followed without a lag where it moves by `rate` per unit of u."""
        return goal + self._plan.D / self._plan.K * rate

    def follow(self, dt: float) -> tuple[Array, Array]:
        """Go on by dt; returns the goal in force at the start of it and the ratio that belongs to it.

        Of a goal on its way to a target, the mean distance from it meanwhile counts.
        """
        start = self.target
        if self.lag is None:
            ratio = self._ratio
        else:
            start = self.mean(dt)
            ratio = self._plan.ratio(start - self.target + self._arrival)
        if self.velocity is not None:
            self.target = self.target + dt * self.velocity
        return start, ratio
