"""Compiled twin of `plain.advance`: the shape comes from a table, everything else is the same."""

from __future__ import annotations

import math

import numpy as np

from kineme.compiled import jit
from kineme.control.obstacles import AHEAD
from kineme.control.spring import NODE_WEIGHTS, NODES


@jit
def advance(
    K, D, per_u, breaks, table, gamma, beta, fading, state, u, du, goal, ratio, push, obstacles, velocities, motion
):  # type: ignore[no-untyped-def]
    """Write position, dx/du and x'' at u + du into `motion` (3, d); see `plain.advance`."""
    d = len(goal)
    spring, shape, held = (K, D, per_u), np.empty(d + 1), push.copy()
    end = motion[:2]
    if len(obstacles):
        _steer(gamma, beta, fading, state, obstacles, velocities, 0.0, held)
        _carry(spring, breaks, table, state, u, 0.5 * du, goal, ratio, held, shape, end)
        held[:] = push
        _steer(gamma, beta, fading, end, obstacles, velocities, 0.5 * du, held)
    _carry(spring, breaks, table, state, u, du, goal, ratio, held, shape, end)
    held[:] = push
    _steer(gamma, beta, fading, end, obstacles, velocities, du, held)
    _look_up(breaks, table, u + du, shape)
    for k in range(d):
        forcing = shape[k] * ratio[k] + shape[d] * goal[k] + held[k]
        motion[2, k] = K * (goal[k] - motion[0, k]) - D * motion[1, k] + forcing


@jit
def _carry(spring, breaks, table, state, u, du, goal, ratio, push, shape, end):  # type: ignore[no-untyped-def]
    """Position and dx/du at u + du; an interval of quadrature never contains u = 1."""
    K, D, per_u = spring
    d = len(goal)
    for k in range(d):
        end[0, k], end[1, k] = state[0, k] - goal[k], state[1, k]
    to_end = min(max(1.0 - u, 0.0), du)
    for begin, length in ((u, to_end), (u + to_end, du - to_end)):
        n = math.ceil(per_u * length)
        if n <= 0:
            continue
        h = length / n
        c00, c01, c10, c11 = _transition(K, D, h)
        impulse = np.empty((len(NODES), 2))
        for q in range(len(NODES)):
            _, impulse[q, 0], _, impulse[q, 1] = _transition(K, D, h * (1.0 - NODES[q]))
        for i in range(n):
            for k in range(d):
                x, v = end[0, k], end[1, k]
                end[0, k], end[1, k] = c00 * x + c01 * v, c10 * x + c11 * v
            for q in range(len(NODES)):
                _look_up(breaks, table, begin + h * (i + NODES[q]), shape)
                for k in range(d):
                    forcing = h * NODE_WEIGHTS[q] * (shape[k] * ratio[k] + shape[d] * goal[k] + push[k])
                    end[0, k] += impulse[q, 0] * forcing
                    end[1, k] += impulse[q, 1] * forcing
    for k in range(d):
        end[0, k] += goal[k]


@jit
def _look_up(breaks, table, u, shape):  # type: ignore[no-untyped-def]
    """`ShapeTable` at u by Clenshaw's recurrence, all columns at once."""
    n_columns = len(shape)
    low, high = 0, len(breaks) - 1
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
    c = table[low]
    for k in range(n_columns):
        later, latest = 0.0, 0.0
        for j in range(len(c) - 1, 0, -1):
            later, latest = c[j, k] + 2.0 * x * later - latest, later
        shape[k] = c[0, k] + x * later - latest


@jit
def _transition(stiffness, damping, h):  # type: ignore[no-untyped-def]
    """Twin of `spring.transition`."""
    a = 0.5 * damping
    square = stiffness - a * a
    b = math.sqrt(abs(square))
    if b * h < 1e-8:
        C = math.exp(-a * h)
        S = C * h
    elif square > 0:
        decay = math.exp(-a * h)
        C, S = decay * math.cos(b * h), decay * math.sin(b * h) / b
    else:
        slow, ratio = math.exp(-stiffness / (a + b) * h), math.exp(-2.0 * b * h)
        C, S = 0.5 * slow * (1.0 + ratio), -0.5 * slow * math.expm1(-2.0 * b * h) / b
    return C + a * S, S, -stiffness * S, C - a * S


@jit
def _steer(gamma, beta, fading, state, obstacles, velocities, passed, push):  # type: ignore[no-untyped-def]
    """Add the terms of all obstacles to `push`; twin of `obstacles.steering`, with the obstacles `passed` later."""
    d = len(push)
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
        if phi < AHEAD or distance == 0:
            phi, offset = AHEAD, 1.0
            _write_side(heading, r)
        strength = gamma * speed * phi * math.exp(-beta * phi - fading * distance)
        for k in range(d):
            push[k] -= strength * r[k] / (offset if offset > 0 else 1.0)


@jit
def _write_side(heading, across):  # type: ignore[no-untyped-def]
    """The opposite of `obstacles._side`, where the obstacle is taken to lie."""
    if len(heading) == 2:
        across[0], across[1] = heading[1], -heading[0]
        return
    axis = np.argmin(np.abs(heading))
    norm = math.sqrt(1.0 - heading[axis] ** 2)
    for k in range(len(heading)):
        across[k] = heading[axis] * heading[k] / norm
    across[axis] -= 1.0 / norm
