"""A controlled movement: what no step changes, its via points, and the goal that it follows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import SpecificationError
from kineme.validation import Array, check_number

_ARRIVED = 1e-14  # of the target's distance from the origin: rounding

SHORTEST = 1e-12  # durations; shorter steps are lost in rounding
_ROUNDING = 64 * np.finfo(np.float64).eps


class Influences(NamedTuple):
    """Influences on the movement during one step, held constant over it; in normalized time, relative to the origin."""

    goal: Array  # (d,), at the start of the step; ahead of a goal that moves, see `MovingGoal`
    ratio: Array  # (d,), what scale f is multiplied by
    goal_rate: Array  # (d,), with which the goal goes on during the step
    push: Array  # (d,), an external acceleration
    obstacles: Array  # (m, n_positions), at the start of the step
    obstacle_velocities: Array  # (m, n_positions); with these the obstacles go on during the step


#: Of the extent of a movement: farther from a via point is said.
MISSED = 1e-2


class ViaPlaces(NamedTuple):
    """Places of a movement at k times, relative to the origin."""

    times: Array  # (k,), normalized
    points: Array  # (k, n_positions), or (k, d) of a movement without positions; NaN where a dimension is free
    tolerance: float  # distance from one that is said


@dataclass(frozen=True, eq=False)
class Plan:
    """The equation of one movement and where it begins, whatever kind of primitive it comes from.

    In normalized time u, with positions and goals relative to the origin,

        x'' = K (g - x) - D x' + ratio scale_f(u) + coupling(u) g,        ' = d/du.

    - `mixing` (N + 1, d + 1): from the terms of the specification, its basis functions and the coupling, to `shape`.
    - `ratio`: what scale f is multiplied by for a goal (d,); not finite where the formulation cannot go.
    """

    dmp: Any  # the specification: stiffness, damping, and the terms from which `shape` is mixed
    mixing: Array
    ratio: Callable[[Array], Array]
    origin: Array  # (d,), from where positions and goals count; x0 of a discrete movement
    goal: Array  # (d,), the first goal
    state: Array  # (2, d), the first position and dx/du
    duration: float  # of u = 1 [s]
    settle: float  # distance within which the movement has settled, by default
    n_positions: int  # the leading dimensions that are coordinates of one point, in which obstacles lie
    begin: float = 0.0  # u of the first state
    periodic: bool = False  # whether `shape` repeats itself after u = 1; then the movement never settles
    longest_step: float = 1.0  # at most so many durations in one step
    via: ViaPlaces | None = None  # its via points, which obstacles, goals and measurements may lead it away from

    @cached_property
    def K(self) -> float:
        """Stiffness."""
        return float(self.dmp.K)

    @cached_property
    def D(self) -> float:
        """Damping."""
        return float(self.dmp.D)

    @property
    def n_gaps(self) -> int:
        """Gaps between the centers of basis functions in [0, 1]: how finely `shape` is to be sampled."""
        return int(self.dmp.n_basis) - (not self.periodic)

    def shape(self, u: Array) -> Array:
        """Scale f of each dimension, then the coupling, at normalized times u (T,); shape (T, d + 1)."""
        return np.asarray(self.dmp.terms(u) @ self.mixing)

    @property
    def n_dims(self) -> int:
        """Number of dimensions d."""
        return len(self.origin)

    @cached_property
    def rounding(self) -> float:
        """Distance that rounding leaves between equal positions, once the origin is subtracted from them."""
        return float(_ROUNDING * max(np.abs(place).max() for place in (self.origin, self.goal, self.state[0])))

    @cached_property
    def intervals(self) -> float:
        """Quadrature intervals per unit of u: two between neighboring centers, and as many as the spring is fast."""
        return max(2.0 * self.n_gaps, math.sqrt(self.K), 0.5 * self.D)


def passed(via: ViaPlaces, begin: float, end: float, du: float, periodic: bool) -> Iterator[tuple[float, Array]]:
    """Yield the via points whose times lie in a step of du, after `begin` and not after `end`, and how far ahead."""
    after, before = via.times > begin, via.times <= end
    within = after & before if not periodic or (begin <= end and du < 1.0) else (after | before) | (du >= 1.0)
    for time, point in zip(via.times[within].tolist(), via.points[within], strict=True):
        yield time - begin if time > begin else time - begin + 1.0, point


def check_controlled(plan: Any, dt: Any) -> None:
    """Refuse what is no plan, and steps that are too long or too short for it."""
    if not isinstance(plan, Plan):
        raise SpecificationError(
            f"expected the plan of one movement, got {type(plan).__name__}; write primitives[0].controller(dt)"
        )
    check_number("dt", dt, above=0.0)
    if not SHORTEST * plan.duration <= dt <= plan.longest_step * plan.duration:
        most = "the duration," if plan.longest_step == 1.0 else f"{plan.longest_step:g} periods of"
        raise SpecificationError(f"expected dt of at most {most} {plan.duration:g} s, got {dt!r} s")


class FilteredValue:
    """Numbers that approach a target with a time constant, ``filter dx/dt = target - x``, or jump without one.

    - `target` (d,): what was set last.
    - `lag` (d,) or None: value in force minus target; None where it has arrived.
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

    `velocity` (d,) or None: per second; None at rest.
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
