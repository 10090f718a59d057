"""Everything about a controlled movement that no step changes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import SpecificationError
from kineme.validation import Array, check_number

SHORTEST = 1e-12  # durations; shorter steps are lost in rounding
_ROUNDING = 64 * np.finfo(np.float64).eps


class Influences(NamedTuple):
    """What acts on the movement during one step, held constant over it; in normalized time, relative to the origin."""

    goal: Array  # (d,), at the start of the step; ahead of a goal that moves, see `MovingGoal`
    ratio: Array  # (d,), what scale f is multiplied by
    goal_rate: Array  # (d,), with which the goal goes on during the step
    push: Array  # (d,), an external acceleration
    obstacles: Array  # (m, n_positions), at the start of the step
    obstacle_velocities: Array  # (m, n_positions); with these the obstacles go on during the step


#: Of the extent of a movement: farther from a via point is said.
MISSED = 1e-2


class ViaPlaces(NamedTuple):
    """Where a movement is to be at k times, relative to the origin."""

    times: Array  # (k,), normalized
    points: Array  # (k, n_positions), or (k, d) of a movement without positions; NaN where a dimension is free
    tolerance: float  # distance from one that is said


@dataclass(frozen=True, eq=False)
class Plan:
    """The equation of one movement and where it begins, whatever kind of primitive it comes from.

    In normalized time u, with positions and goals relative to the origin,

        x'' = K (g - x) - D x' + ratio scale_f(u) + coupling(u) g,        ' = d/du.

    Attributes
    ----------
    K, D : float
        Stiffness and damping.
    shape : callable
        At normalized times u (T,): scale f of each dimension, then the coupling; shape (T, d + 1).
    n_gaps : int
        Gaps between the centers of basis functions in [0, 1]: how finely `shape` is to be sampled.
    ratio : callable
        What scale f is multiplied by for a goal (d,); not finite where the formulation cannot go.
    origin : ndarray of shape (d,)
        From where positions and goals count; x0 of a discrete movement.
    goal : ndarray of shape (d,)
        The first goal.
    state : ndarray of shape (2, d)
        The first position and dx/du.
    duration : float
        Of u = 1 [s].
    settle : float
        Distance within which the movement has settled, by default.
    n_positions : int
        The leading dimensions that are coordinates of one point, in which obstacles lie.
    begin : float
        u of the first state.
    periodic : bool
        Whether `shape` repeats itself after u = 1; then the movement never settles.
    longest_step : float
        At most so many durations in one step.
    via : ViaPlaces, optional
        Its via points, which obstacles, goals and measurements may lead it away from.
    """

    K: float
    D: float
    shape: Callable[[Array], Array]
    n_gaps: int
    ratio: Callable[[Array], Array]
    origin: Array
    goal: Array
    state: Array
    duration: float
    settle: float
    n_positions: int
    begin: float = 0.0
    periodic: bool = False
    longest_step: float = 1.0
    via: ViaPlaces | None = None

    @property
    def n_dims(self) -> int:
        """Number of dimensions d."""
        return len(self.origin)

    @cached_property
    def rounding(self) -> float:
        """Distance that rounding leaves between equal positions, once the origin is subtracted from them."""
        return float(_ROUNDING * max(np.abs(one).max() for one in (self.origin, self.goal, self.state[0])))

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
