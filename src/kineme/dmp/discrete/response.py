"""The spring-damper's exact response to each part of the forcing term: the decode matrix."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from kineme.dmp.discrete.basis import GaussianBasis
from kineme.dmp.discrete.formulations import Formulation
from kineme.dmp.spring_damper import NODE_WEIGHTS, NODES, transitions
from kineme.validation import Array

_NUMBERS_AT_ONCE = 500_000  # of the forcing term at a time; a limit on memory
_STEPS_PER_BASIS = 2  # quadrature intervals between two neighboring centers, at least


class Response(NamedTuple):
    """Positions, velocities and accelerations at T normalized times as linear maps of (W, g - x0, v0, g').

    ``x - x0 = Phi[0] W + goal[0] (g - x0) + velocity[0] v0 + moving_goal[0] g'``; index 1 gives dx/du and index 2 its
    derivative in the same way. W are the weights times the formulation's scale, v0 is dx/du at the start, g is the goal
    at the start and g' its dg/du, 0 of a goal at rest; what draws is ``g + (u + D / K) g'``, see `MovingGoal`.
    """

    Phi: Array  # (3, T, N)
    goal: Array  # (3, T)
    velocity: Array  # (3, T)
    moving_goal: Array  # (3, T)


def spring_damper_response(
    basis: GaussianBasis, formulation: Formulation, stiffness: float, damping: float, u: Array
) -> Response:
    """Solve ``x'' = K (g - x) - D x' + F(u)`` for every basis function, the goal and the initial velocity.

    The state is propagated from one time to the next by the matrix exponential, which is exact for any step; the
    forcing enters by Gauss-Legendre quadrature of the convolution integral with 8 nodes per interval, of order 16.

    Parameters
    ----------
    u : ndarray of shape (T,)
        Even normalized times from 0.
    """
    n_steps = max(1, math.ceil(_STEPS_PER_BASIS * (basis.n_basis - 1) * (u[1] - u[0])))
    h = (u[1] - u[0]) / n_steps
    nodes = h * NODES
    carry = transitions(stiffness, damping, np.array([h]))[0]
    # An acceleration at a node reaches the end of the step through the second column.
    impulse = transitions(stiffness, damping, h - nodes)[:, :, 1] * (h * NODE_WEIGHTS)[:, None]  # (8, 2)
    starts = u[0] + np.arange((len(u) - 1) * n_steps) * h
    driven = np.empty((len(starts), 2, basis.n_basis + 2))  # the term that each step adds to (x, x')
    for some in np.array_split(np.arange(len(starts)), max(1, len(starts) * basis.n_basis // _NUMBERS_AT_ONCE)):
        forcing = _forcing(basis, formulation, (stiffness, damping), (starts[some, None] + nodes).ravel())
        driven[some] = np.einsum("qz,kqf->kzf", impulse, forcing.reshape(len(some), len(nodes), -1))
    at_end = np.flatnonzero((starts < 1.0) & (starts + h > 1.0))
    for k in at_end:  # one step at most: an ungated f has a kink at u = 1, where quadrature must be split
        driven[k] = 0.0
        for left, right in ((starts[k], 1.0), (1.0, starts[k] + h)):
            inside = left + (right - left) * NODES
            weighted = transitions(stiffness, damping, starts[k] + h - inside)[:, :, 1] * NODE_WEIGHTS[:, None]
            driven[k] += (right - left) * weighted.T @ _forcing(basis, formulation, (stiffness, damping), inside)
    states = np.zeros((len(u), 3, basis.n_basis + 3))
    states[0, 1, -1] = 1.0
    state = states[0, :2]
    for done, added in enumerate(driven, start=1):
        state = carry @ state
        state[:, :-1] += added
        if done % n_steps == 0:
            states[done // n_steps, :2] = state
    states[:, 2] = -stiffness * states[:, 0] - damping * states[:, 1]
    states[:, 2, :-1] += _forcing(basis, formulation, (stiffness, damping), u)
    return _parts(states)


def response_between(
    grid: Response, basis: GaussianBasis, formulation: Formulation, stiffness: float, damping: float, u: Array
) -> Response:
    """The same at any normalized times u (k,) in [0, 1], from the response at even times that are close enough.

    Each state is carried on from the last even time before it, in one step.
    """
    n_steps = grid.goal.shape[1] - 1
    before = np.minimum(np.floor(u * n_steps).astype(np.intp), n_steps)
    h = np.maximum(u - before / n_steps, 0.0)[:, None]
    carry = transitions(stiffness, damping, h[:, 0])
    impulse = transitions(stiffness, damping, (h * (1.0 - NODES)).ravel())[:, :, 1].reshape(len(u), -1, 2)
    times = before[:, None] / n_steps + h * NODES
    forcing = _forcing(basis, formulation, (stiffness, damping), times.ravel()).reshape(*times.shape, -1)
    states = np.empty((len(u), 3, basis.n_basis + 3))
    there = np.dstack((grid.Phi, grid.goal, grid.moving_goal, grid.velocity))[:2, before].transpose(1, 0, 2)
    states[:, :2] = carry @ there
    states[:, :2, :-1] += np.einsum("kqz,kq,kqf->kzf", impulse, h * NODE_WEIGHTS, forcing)
    states[:, 2] = -stiffness * states[:, 0] - damping * states[:, 1]
    states[:, 2, :-1] += _forcing(basis, formulation, (stiffness, damping), u)
    return _parts(states)


def _parts(states: Array) -> Response:
    """States (T, 3, N + 3) as the response to weights, goal, velocity of the goal and initial velocity."""
    by_part = states.transpose(1, 0, 2)
    goal, moving_goal, velocity = (by_part[:, :, k].copy() for k in (-3, -2, -1))
    return Response(np.ascontiguousarray(by_part[:, :, :-3]), goal, velocity, moving_goal)


def _forcing(basis: GaussianBasis, formulation: Formulation, spring: tuple[float, float], u: Array) -> Array:
    """Accelerations besides spring and damper, per unit of each W, of g - x0 and of g', shape (T, N + 2)."""
    stiffness, damping = spring
    goal = stiffness + formulation.coupling(stiffness, basis.phase(u))
    return np.column_stack((basis.design(u), goal, (u + damping / stiffness) * goal))
