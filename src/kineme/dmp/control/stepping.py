"""One step of a movement under control: plain, the definition, and compiled, from tables of the shape."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from kineme.dmp.control.plan import Influences, ObstacleAvoidance, Plan, steering
from kineme.dmp.spring_damper import NODE_WEIGHTS, NODES, transition
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.validation import Array

_N_TERMS = 12
_TOLERANCE = 1e-13  # of each column's largest number
_MOST_HALVINGS = 12
_MOST_CACHED = 100  # basis functions; the table of their terms takes up to 5 MB
_PER_GAP = 8  # intervals of one size for each gap: terms that need more differ from polynomials by rounding
_CANCELED = 10.0  # times the shape: a larger sum of weighted terms loses more than a digit
_VANISHED = 1e-18
_LAST = 2.0**20  # durations after which a forcing term that has not faded is cut

_POINTS = chebyshev.chebpts1(_N_TERMS)
_FIT = np.linalg.inv(chebyshev.chebvander(_POINTS, _N_TERMS - 1))
_BETWEEN = chebyshev.chebpts2(_N_TERMS + 1)
_AT_BETWEEN = chebyshev.chebvander(_BETWEEN, _N_TERMS - 1)

Advance = Callable[[Array, float, float, Influences], Array]

_A_LONG_LIFE = 10**12  # operations: a controller is made to run for many steps, however small each of them is


def stepper(plan: Plan, avoidance: ObstacleAvoidance) -> Advance:
    """The function ``advance(state, u, du, influences)`` for this plan; what compiling it costs is spent here."""
    return _compiled(plan, avoidance) if use_compiled(_A_LONG_LIFE) else partial(advance, plan, avoidance)


def _compiled(plan: Plan, avoidance: ObstacleAvoidance) -> Advance:
    compiled = compiled_module("kineme.dmp.control._compiled")
    table, d = tuple(shape_table(plan)), plan.n_dims
    spring = (plan.K, plan.D, plan.intervals)
    steering = (float(avoidance.gamma), float(avoidance.beta), avoidance.fading, plan.rounding)

    def advance(state: Array, u: float, du: float, influences: Influences) -> Array:
        motion = np.empty((3, d))
        # Numba takes a plain tuple apart faster than a named one.
        compiled.advance(spring, table, steering, state, u, du, tuple(influences), motion)
        return motion

    row, nowhere = np.zeros(d), np.zeros((0, plan.n_positions))
    advance(np.zeros((2, d)), 0.0, 0.0, Influences(row, row, row, row, nowhere, nowhere))
    return advance


class ShapeTable(NamedTuple):
    """Chebyshev coefficients on intervals ``breaks[i], breaks[i + 1]``; 0 beyond the last break, if not periodic."""

    breaks: Array  # (n + 1,)
    coefficients: Array  # (n, terms, d + 1)
    periodic: bool


def shape_table(plan: Plan) -> ShapeTable:
    """Tabulate `Plan.shape` from the table of its terms, except where large weights cancel and magnify its errors."""
    if plan.dmp.n_basis <= _MOST_CACHED and (terms := _terms_table(plan.dmp, plan.n_gaps, plan.periodic)) is not None:
        coefficients = terms.coefficients @ plan.mixing
        means = np.abs(terms.coefficients[:, 0]) @ np.abs(plan.mixing)
        if (means.max(axis=0) <= _CANCELED * np.abs(coefficients[:, 0]).max(axis=0)).all():
            return terms._replace(coefficients=coefficients)
    table = _tabulated(plan.shape, plan.n_gaps, plan.periodic, math.inf)
    assert table is not None
    return table


@lru_cache(maxsize=8)
def _terms_table(dmp: Any, n_gaps: int, periodic: bool) -> ShapeTable | None:
    """Tabulate the terms of a specification; None where rounding hides whether the polynomials agree with them."""
    return _tabulated(dmp.terms, n_gaps, periodic, _PER_GAP * (n_gaps + 1))


def _tabulated(
    shape: Callable[[Array], Array], n_gaps: int, periodic: bool, most_intervals: float
) -> ShapeTable | None:
    """Halve intervals until the polynomials agree with `shape` between their nodes; None with too many intervals."""
    scale = np.abs(shape(np.linspace(0.0, 1.0, 4 * (n_gaps + 1)))).max(axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    grid = np.linspace(0.0, 1.0, n_gaps + 1)
    if not periodic:
        times = [2.0]  # doubling times past 1 until everything has faded
        while times[-1] < _LAST and (np.abs(shape(np.array(times[-1:]))) > _VANISHED * scale).any():
            times.append(2.0 * times[-1])
        grid = np.append(grid, times)

    def at(intervals: Array, points: Array) -> Array:
        """Evaluate `shape` at points of [-1, 1] mapped into intervals (m, 2), shape (m, points, columns)."""
        u = intervals.mean(axis=1)[:, None] + 0.5 * np.diff(intervals, axis=1) * points
        return shape(u.ravel()).reshape(*u.shape, -1)

    pending = np.column_stack((grid[:-1], grid[1:]))
    done: list[tuple[Array, Array]] = []
    for halving in range(_MOST_HALVINGS + 1):
        coefficients = _FIT @ at(pending, _POINTS)  # (m, terms, columns)
        error = np.abs(_AT_BETWEEN @ coefficients - at(pending, _BETWEEN)).max(axis=1)
        fits = (error <= _TOLERANCE * scale).all(axis=1) | (halving == _MOST_HALVINGS)
        done.append((pending[fits], coefficients[fits]))
        middle = pending[~fits].mean(axis=1)
        pending = np.vstack(
            (np.column_stack((pending[~fits, 0], middle)), np.column_stack((middle, pending[~fits, 1])))
        )
        if not len(pending):
            break
        if len(pending) > most_intervals:
            return None
    intervals, table = (np.concatenate(parts) for parts in zip(*done, strict=True))
    order = np.argsort(intervals[:, 0])
    breaks = np.append(intervals[order, 0], intervals[:, 1].max())
    return ShapeTable(breaks, np.ascontiguousarray(table[order]), periodic)


def advance(
    plan: Plan, avoidance: ObstacleAvoidance, state: Array, u: float, du: float, influences: Influences
) -> Array:
    """Carry position and dx/du, a state (2, d) relative to the origin, from u to u + du, and add x'' there: (3, d).

    All that is held over the step is exact, for any du. Obstacles enter by the midpoint rule: their term, held over a
    first half step, gives the state in the middle, whose term is held over the whole; so the error falls as du^2.
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
    """Position and dx/du (2, d) at u + du, under a constant push, by way of ``y = x - goal``."""
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
    """Return what carries a state over h (2, 2), and what an acceleration at each quadrature node adds to it (8, 2)."""
    carry = np.array(transition(stiffness, damping, h)).reshape(2, 2)
    _, s01, _, s11 = transition(stiffness, damping, h * (1.0 - NODES))
    return carry, np.column_stack((s01, s11)) * (h * NODE_WEIGHTS)[:, None]


def _forcing(plan: Plan, u: Array, aims: Array, influences: Influences, push: Array) -> Array:
    """Return what acts besides spring and damper at u (T,), with the goals (T, d) then; shape (T, d)."""
    shape = plan.shape(u)
    return shape[:, :-1] * influences.ratio + shape[:, -1:] * aims + push


def _with_acceleration(
    plan: Plan, state: Array, step: tuple[float, float], influences: Influences, push: Array
) -> Array:
    u, du = step
    aim = influences.goal + du * influences.goal_rate
    forcing = _forcing(plan, np.array([u + du]), aim, influences, push)
    return np.vstack((state, plan.K * (aim - state[0]) - plan.D * state[1] + forcing))
