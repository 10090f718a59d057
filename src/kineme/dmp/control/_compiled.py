"""Compiled twin of `stepping.advance`: the shape comes from a table, everything else is the same."""

from __future__ import annotations

import math

import numpy as np

from kineme.dmp.control.plan import AHEAD
from kineme.dmp.spring_damper import NODE_WEIGHTS, NODES, transition
from kineme.runtime.compiled import jit

_transition = jit(transition)


@jit
def advance(spring, table, avoidance, state, u, du, influences, motion):  # type: ignore[no-untyped-def]
    """Write position, dx/du and x'' at u + du into `motion` (3, d); `stepping` passes the rest, in this order."""
    K, D, _ = spring
    goal, ratio, rate, push, obstacles, velocities = influences
    d = len(goal)
    shape, total, end = np.empty(d + 1), push.copy(), motion[:2]
    if len(obstacles):
        _steer(avoidance, state, obstacles, velocities, 0.0, total)
        _carry(spring, table, state, u, 0.5 * du, goal, rate, ratio, total, shape, end)
        total = push.copy()  # a slice would compile its error message, for seconds
        _steer(avoidance, end, obstacles, velocities, 0.5 * du, total)
    _carry(spring, table, state, u, du, goal, rate, ratio, total, shape, end)
    total = push.copy()
    _steer(avoidance, end, obstacles, velocities, du, total)
    _look_up(table, u + du, shape)
    for k in range(d):
        aim = goal[k] + du * rate[k]
        forcing = shape[k] * ratio[k] + shape[d] * aim + total[k]
        motion[2, k] = K * (aim - motion[0, k]) - D * motion[1, k] + forcing


@jit
def _carry(spring, table, state, u, du, goal, rate, ratio, push, shape, end):  # type: ignore[no-untyped-def]
    """Position and dx/du at u + du; an interval of quadrature never contains u = 1."""
    K, D, per_u = spring
    d = len(goal)
    impulse = np.empty((len(NODES), 2))
    for k in range(d):
        end[0, k], end[1, k] = state[0, k] - goal[k], state[1, k] - rate[k]
    to_end = min(max(1.0 - u, 0.0), du)
    for begin, length in ((u, to_end), (u + to_end, du - to_end)):
        n = math.ceil(per_u * length)
        if n <= 0:
            continue
        h = length / n
        c00, c01, c10, c11 = _transition(K, D, h)
        for q in range(len(NODES)):
            _, s01, _, s11 = _transition(K, D, h * (1.0 - NODES[q]))
            impulse[q, 0], impulse[q, 1] = h * NODE_WEIGHTS[q] * s01, h * NODE_WEIGHTS[q] * s11
        for i in range(n):
            for k in range(d):
                x, v = end[0, k], end[1, k]
                end[0, k], end[1, k] = c00 * x + c01 * v, c10 * x + c11 * v
            for q in range(len(NODES)):
                now = begin + h * (i + NODES[q])
                _look_up(table, now, shape)
                for k in range(d):
                    aim = goal[k] + (now - u) * rate[k]
                    forcing = shape[k] * ratio[k] + shape[d] * aim + push[k] - D * rate[k]
                    end[0, k] += impulse[q, 0] * forcing
                    end[1, k] += impulse[q, 1] * forcing
    for k in range(d):
        end[0, k] += goal[k] + du * rate[k]
        end[1, k] += rate[k]


@jit
def _look_up(table, u, shape):  # type: ignore[no-untyped-def]
    """`ShapeTable` at u: each Chebyshev polynomial once, for all columns."""
    breaks, coefficients, periodic = table
    n_columns = len(shape)
    low, high = 0, len(breaks) - 1
    if periodic:
        u -= math.floor(u)
    if u >= breaks[high]:
        shape[:] = 0.0
        return
    while high - low > 1:
        middle = (low + high) // 2
        if u < breaks[middle]:
            high = middle
        else:
            low = middle
    x = 2.0 * (u - breaks[low]) / (breaks[low + 1] - breaks[low]) - 1.0
    terms = coefficients[low]
    before, polynomial = 1.0, x
    for k in range(n_columns):
        shape[k] = terms[0, k]
    for j in range(1, len(terms)):
        for k in range(n_columns):
            shape[k] += polynomial * terms[j, k]
        before, polynomial = polynomial, 2.0 * x * polynomial - before


@jit
def _steer(avoidance, state, obstacles, velocities, passed, push):  # type: ignore[no-untyped-def]
    """Add the terms of all obstacles to `push`; twin of `plan.steering`, with the obstacles `passed` later."""
    gamma, beta, fading, rounding = avoidance
    d = obstacles.shape[1]  # the leading dimensions
    r, heading = np.empty(d), np.empty(d)
    for i in range(len(obstacles)):
        speed, distance = 0.0, 0.0
        for k in range(d):
            r[k] = obstacles[i, k] + passed * velocities[i, k] - state[0, k]
            heading[k] = state[1, k] - velocities[i, k]
            speed += heading[k] ** 2
            distance += r[k] ** 2
        speed, distance = math.sqrt(speed), math.sqrt(distance)
        if not speed > 0:
            continue
        along = 0.0
        for k in range(d):
            heading[k] /= speed
            along += r[k] * heading[k]
        offset = 0.0
        for k in range(d):
            r[k] -= along * heading[k]  # from here on only what lies across
            offset += r[k] ** 2
        offset = math.sqrt(offset)
        phi = math.atan2(offset, along)
        if phi < AHEAD or distance <= rounding:
            phi, offset = AHEAD, 1.0
            _write_side(heading, r)
        strength = gamma * speed * phi * math.exp(-beta * phi - fading * distance)
        for k in range(d):
            push[k] -= strength * r[k] / (offset if offset > rounding else 1.0)


@jit
def _write_side(heading, across):  # type: ignore[no-untyped-def]
    """The opposite of `plan._side`, where the obstacle is taken to lie."""
    if len(heading) == 2:
        across[0], across[1] = heading[1], -heading[0]
        return
    axis = np.argmin(np.abs(heading))
    norm = math.sqrt(1.0 - heading[axis] ** 2)
    for k in range(len(heading)):
        across[k] = heading[axis] * heading[k] / norm
    across[axis] -= 1.0 / norm
