"""One step in plain NumPy: the definition, for every formulation, phase and basis there is."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from kineme.primitives.control.obstacles import ObstacleAvoidance, steering
from kineme.primitives.control.plan import Influences, Plan
from kineme.primitives.spring_damper import NODE_WEIGHTS, NODES, transition
from kineme.validation import Array


def advance(
    plan: Plan, avoidance: ObstacleAvoidance, state: Array, u: float, du: float, influences: Influences
) -> Array:
    """Carry position and dx/du from u to u + du, and add x'' there.

    Spring, damper, forcing term and all that is held over the step are exact, for any du. Obstacles enter by
    the midpoint rule: their term, held over a first half step, gives the state in the middle, whose term is held over
    the whole; so the error falls as du^2.

    Parameters
    ----------
    state : ndarray of shape (2, d)
        Relative to the origin.

    Returns
    -------
    ndarray of shape (3, d)
    """
    with np.errstate(all="ignore"):  # the caller looks at the result
        push = influences.push
        if not len(influences.obstacles):
            return _with_acceleration(plan, _carry(plan, state, u, du, influences, push), (u, du), influences, push)
        turn = _turn(plan, avoidance, state, 0.0, influences)
        middle = _carry(plan, state, u, 0.5 * du, influences, push + turn)
        turn = _turn(plan, avoidance, middle, 0.5 * du, influences)
        end = _carry(plan, state, u, du, influences, push + turn)
        turn = _turn(plan, avoidance, end, du, influences)
        return _with_acceleration(plan, end, (u, du), influences, push + turn)


def _turn(plan: Plan, avoidance: ObstacleAvoidance, state: Array, passed: float, influences: Influences) -> Array:
    """The terms of the obstacles (d,) when `passed` of the step is over."""
    velocities = influences.obstacle_velocities
    n_positions = velocities.shape[1]
    turn = np.zeros(state.shape[1])
    obstacles = influences.obstacles + passed * velocities
    turn[:n_positions] = steering(avoidance, state[:, :n_positions], obstacles, velocities, plan.rounding)
    return turn


def _carry(plan: Plan, state: Array, u: float, du: float, influences: Influences, push: Array) -> Array:
    """Position and dx/du (2, d) at u + du, under a constant push."""
    """In the frame of the goal, which the spring pulls to and which moves on: ``y = x - goal``."""
    rate = influences.goal_rate
    y = np.vstack((state[0] - influences.goal, state[1] - rate))
    to_end = min(max(1.0 - u, 0.0), du)  # an ungated forcing term has a kink at u = 1
    for begin, length, passed in ((u, to_end, 0.0), (u + to_end, du - to_end, to_end)):
        if length > 0:
            y = _carry_smoothly(plan, y, (begin, length, passed), influences, push)
    return np.vstack((y[0] + influences.goal + du * rate, y[1] + rate))


def _carry_smoothly(
    plan: Plan, y: Array, part: tuple[float, float, float], influences: Influences, push: Array
) -> Array:
    u, du, passed = part
    n = math.ceil(plan.intervals * du)
    h = du / n
    carry, impulse = step_matrices(plan.K, plan.D, h)
    nodes = (h * (np.arange(n)[:, None] + NODES)).ravel()
    aims = influences.goal + (passed + nodes)[:, None] * influences.goal_rate
    forcing = _forcing(plan, u + nodes, aims, influences, push - plan.D * influences.goal_rate)
    for driven in np.einsum("qz,kqd->kzd", impulse, forcing.reshape(n, len(NODES), -1)):
        y = carry @ y + driven
    return y


@lru_cache(maxsize=64)
def step_matrices(stiffness: float, damping: float, h: float) -> tuple[Array, Array]:
    """What carries a state over h (2, 2), and what an acceleration at each quadrature node adds to it (8, 2)."""
    carry = np.array(transition(stiffness, damping, h)).reshape(2, 2)
    _, s01, _, s11 = transition(stiffness, damping, h * (1.0 - NODES))
    return carry, np.column_stack((s01, s11)) * (h * NODE_WEIGHTS)[:, None]


def _forcing(plan: Plan, u: Array, aims: Array, influences: Influences, push: Array) -> Array:
    """What acts besides spring and damper at u (T,), with the goals (T, d) then; shape (T, d)."""
    shape = plan.shape(u)
    return shape[:, :-1] * influences.ratio + shape[:, -1:] * aims + push


def _with_acceleration(
    plan: Plan, state: Array, step: tuple[float, float], influences: Influences, push: Array
) -> Array:
    u, du = step
    aim = influences.goal + du * influences.goal_rate
    forcing = _forcing(plan, np.array([u + du]), aim, influences, push)
    return np.vstack((state, plan.K * (aim - state[0]) - plan.D * state[1] + forcing))
