"""A movement's forcing term and coupling as piecewise polynomials of u: quick, whatever they are made of."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from kineme.primitives.control.plan import Plan
from kineme.validation import Array

_N_TERMS = 12
_TOLERANCE = 1e-13  # of each column's largest number
_MOST_HALVINGS = 12
_VANISHED = 1e-18
_LAST = 2.0**20  # durations after which a forcing term that has not faded is cut

_POINTS = chebyshev.chebpts1(_N_TERMS)
_FIT = np.linalg.inv(chebyshev.chebvander(_POINTS, _N_TERMS - 1))
_BETWEEN = chebyshev.chebpts2(_N_TERMS + 1)
_AT_BETWEEN = chebyshev.chebvander(_BETWEEN, _N_TERMS - 1)


class ShapeTable(NamedTuple):
    """Chebyshev coefficients on intervals ``breaks[i], breaks[i + 1]``; beyond the last break everything is 0.

    A periodic table ends at 1 and goes on as it began.
    """

    breaks: Array  # (n + 1,)
    coefficients: Array  # (n, terms, d + 1)
    periodic: bool


def shape_table(plan: Plan) -> ShapeTable:
    """Tabulate `Plan.shape`: halve intervals until the polynomials agree with it between their nodes."""
    scale = np.abs(plan.shape(np.linspace(0.0, 1.0, 4 * (plan.n_gaps + 1)))).max(axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    grid = np.linspace(0.0, 1.0, plan.n_gaps + 1)
    if not plan.periodic:
        grid = np.append(grid, _tail(plan, scale))
    pending = np.column_stack((grid[:-1], grid[1:]))
    done: list[tuple[Array, Array]] = []
    for halving in range(_MOST_HALVINGS + 1):
        coefficients = _FIT @ _at(plan, pending, _POINTS)  # (m, terms, d + 1)
        error = np.abs(_AT_BETWEEN @ coefficients - _at(plan, pending, _BETWEEN)).max(axis=1)
        fits = (error <= _TOLERANCE * scale).all(axis=1) | (halving == _MOST_HALVINGS)
        done.append((pending[fits], coefficients[fits]))
        middle = pending[~fits].mean(axis=1)
        pending = np.vstack(
            (np.column_stack((pending[~fits, 0], middle)), np.column_stack((middle, pending[~fits, 1])))
        )
        if not len(pending):
            break
    intervals, table = (np.concatenate(parts) for parts in zip(*done, strict=True))
    order = np.argsort(intervals[:, 0])
    breaks = np.append(intervals[order, 0], intervals[:, 1].max())
    return ShapeTable(breaks, np.ascontiguousarray(table[order]), plan.periodic)


def _tail(plan: Plan, scale: Array) -> Array:
    """Doubling times past 1 until everything has faded."""
    times = [2.0]
    while times[-1] < _LAST and (np.abs(plan.shape(np.array(times[-1:]))) > _VANISHED * scale).any():
        times.append(2.0 * times[-1])
    return np.array(times)


def _at(plan: Plan, intervals: Array, points: Array) -> Array:
    """`Plan.shape` at points of [-1, 1] mapped into intervals (m, 2), shape (m, points, d + 1)."""
    middle, half = intervals.mean(axis=1), 0.5 * np.diff(intervals, axis=1)
    u = middle[:, None] + half * points
    return plan.shape(u.ravel()).reshape(*u.shape, -1)
