"""Compiled best products over rotations in space: the twin of ``rotation.best_products``, several pairs at once.

Each pair has its own vector lane and goes through the same steps whatever its company: a lane that has converged keeps
its number while others go on. S is diagonalized by rotations of two axes at a time (Jacobi), which turn z with it;
every sweep squares the error.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from kineme.kernels.rotation import CLOSE, LEAST_STEP, STEPS
from kineme.runtime.compiled import jit

_LANES = 32  # pairs at once: with fewer the processor waits for roots and divisions
_SWEEPS = 5  # of Jacobi's, at most; after three or four, nothing is left off the diagonal in practice
_NOTHING = 1e-18  # of the covariance's largest entry: a turn by it changes no digit


class _Lanes(NamedTuple):
    """Numbers of each pair, the last axis of every array."""

    squares: Any  # (3, lanes), of z
    gaps: Any  # (3, lanes), below the largest eigenvalue
    top: Any  # (lanes,), that eigenvalue
    trace: Any
    x: Any  # the root, above `top`
    moving: Any  # 1 where Newton's steps go on, else 0
    inside: Any  # 1 where the best rotation is within the limit, else 0
    at_limit: Any  # the best product at the limit


@jit
def fill_best_products(products, c, s, best):  # type: ignore[no-untyped-def]
    """``best[i, j]`` of the covariance ``products[3 i : 3 i + 3, 3 j : 3 j + 3]``, c and s of half the limit."""
    n_pairs, n_columns = best.size, best.shape[1]
    S, z, scale, six = np.empty((3, 3, _LANES)), np.empty((3, _LANES)), np.empty(_LANES), np.empty((6, _LANES))
    lanes = _Lanes(z, np.empty((3, _LANES)), six[0], six[1], six[2], six[3], six[4], six[5])
    for first in range(0, n_pairs, _LANES):
        width = min(_LANES, n_pairs - first)
        for lane in range(_LANES):
            i, j = divmod(first + min(lane, width - 1), n_columns)
            for k in range(3):
                for h in range(3):
                    S[k, h, lane] = products[3 * i + k, 3 * j + h]
        _prepare(S, z, lanes.trace, scale)
        for _ in range(_SWEEPS):
            _turn(S, z, 0, 1, 2)
            _turn(S, z, 0, 2, 1)
            _turn(S, z, 1, 2, 0)
            if _is_diagonal(S):
                break
        _take_gaps(S, lanes)
        _solve(lanes, c, s)
        for lane in range(width):
            i, j = divmod(first + lane, n_columns)
            within = lanes.top[lane] + lanes.x[lane]
            best[i, j] = scale[lane] * (within if lanes.inside[lane] > 0.0 else lanes.at_limit[lane])


@jit
def _solve(lanes, c, s):  # type: ignore[no-untyped-def]
    """The root at the limit; then, where the best rotation is within it, the root there."""
    _start_at_limit(lanes, c / s)
    for _ in range(STEPS):
        if not _step_at_limit(lanes, c / s):
            break
    _finish_at_limit(lanes, c, s)
    for lane in range(_LANES):  # a slice would compile its error message, for seconds
        lanes.moving[lane] = lanes.inside[lane]
    for _ in range(STEPS):
        if not _step_within(lanes):
            break


@jit
def _prepare(S, z, trace, scale):  # type: ignore[no-untyped-def]
    """From covariances to S and z, divided by the largest entry, which is `scale`; NaN where one is not finite."""
    for lane in range(_LANES):
        largest, not_finite = 0.0, 0.0
        for k in range(3):
            for h in range(3):
                size = abs(S[k, h, lane])
                largest = size if size > largest else largest
                not_finite += S[k, h, lane] - S[k, h, lane]
        scale[lane] = largest + not_finite
        per = 1.0 / (largest if largest > 0.0 else 1.0)
        a, b, d = S[0, 0, lane] * per, S[1, 1, lane] * per, S[2, 2, lane] * per
        trace[lane] = a + b + d
        z[0, lane] = (S[2, 1, lane] - S[1, 2, lane]) * per
        z[1, lane] = (S[0, 2, lane] - S[2, 0, lane]) * per
        z[2, lane] = (S[1, 0, lane] - S[0, 1, lane]) * per
        S[0, 1, lane] = (S[0, 1, lane] + S[1, 0, lane]) * per
        S[0, 2, lane] = (S[0, 2, lane] + S[2, 0, lane]) * per
        S[1, 2, lane] = (S[1, 2, lane] + S[2, 1, lane]) * per
        S[0, 0, lane], S[1, 1, lane], S[2, 2, lane] = a - b - d, b - a - d, d - a - b


@jit
def _turn(S, z, first, second, third):  # type: ignore[no-untyped-def]
    """Turn two axes so that their entry of S, of which the upper half is kept, vanishes."""
    p, q, off = S[first, first], S[second, second], S[first, second]
    a, b = S[min(first, third), max(first, third)], S[min(second, third), max(second, third)]
    z_p, z_q = z[first], z[second]
    for lane in range(_LANES):
        half = 0.5 * (q[lane] - p[lane])
        size = abs(half) + math.sqrt(half * half + off[lane] * off[lane])
        t = off[lane] / (size if size > 0.0 else 1.0)
        t = -t if half < 0.0 else t
        t = 0.0 if abs(off[lane]) <= _NOTHING else t  # a lane that is diagonal stays as it is, whatever its company
        cosine = 1.0 / math.sqrt(1.0 + t * t)
        sine = t * cosine
        p[lane] -= t * off[lane]
        q[lane] += t * off[lane]
        off[lane] = 0.0
        a[lane], b[lane] = cosine * a[lane] - sine * b[lane], sine * a[lane] + cosine * b[lane]
        z_p[lane], z_q[lane] = cosine * z_p[lane] - sine * z_q[lane], sine * z_p[lane] + cosine * z_q[lane]


@jit
def _is_diagonal(S):  # type: ignore[no-untyped-def]
    """Tell whether further sweeps would change no lane; false where there is NaN."""
    n_turned = 0.0
    for lane in range(_LANES):
        left = abs(S[0, 1, lane]) + abs(S[0, 2, lane]) + abs(S[1, 2, lane])
        n_turned += 0.0 if left <= _NOTHING else 1.0
    return n_turned == 0.0


@jit
def _take_gaps(S, lanes):  # type: ignore[no-untyped-def]
    """Largest eigenvalue, how far the others are below it; z is squared."""
    for lane in range(_LANES):
        a, b, d = S[0, 0, lane], S[1, 1, lane], S[2, 2, lane]
        largest = a if a > b else b
        largest = largest if largest > d else d
        lanes.top[lane] = largest
        lanes.gaps[0, lane], lanes.gaps[1, lane], lanes.gaps[2, lane] = largest - a, largest - b, largest - d
        for k in range(3):
            lanes.squares[k, lane] *= lanes.squares[k, lane]


@jit
def _start_at_limit(lanes, ratio):  # type: ignore[no-untyped-def]
    """The largest of the bounds from below that are known of the root; every lane moves."""
    squares, gaps, x, moving = lanes.squares, lanes.gaps, lanes.x, lanes.moving
    for lane in range(_LANES):
        a, b, d = squares[0, lane], squares[1, lane], squares[2, lane]
        g, h, f = gaps[0, lane], gaps[1, lane], gaps[2, lane]
        widest = g if g > h else h
        widest = widest if widest > f else f
        least = ratio * math.sqrt(a + b + d) - widest
        for other in (ratio * math.sqrt(a) - g, ratio * math.sqrt(b) - h, ratio * math.sqrt(d) - f, LEAST_STEP):
            least = other if other > least else least
        x[lane], moving[lane] = least, 1.0


@jit
def _step_at_limit(lanes, ratio):  # type: ignore[no-untyped-def]
    """A Newton step in every lane that moves; whether any still does."""
    squares, gaps, x, moving = lanes.squares, lanes.gaps, lanes.x, lanes.moving
    left = 0.0
    for lane in range(_LANES):
        size = slope = 0.0
        for k in range(3):
            inverse = 1.0 / (x[lane] + gaps[k, lane])
            term = ratio * ratio * squares[k, lane] * inverse * inverse
            size += term
            slope += term * inverse
        step = (math.sqrt(size) - 1.0) * size / (slope if slope > 0.0 else 1.0)
        step = step if slope > 0.0 else 0.0
        new = x[lane] + step
        new = new if new > LEAST_STEP else LEAST_STEP
        x[lane] = new if moving[lane] > 0.0 else x[lane]
        moving[lane] = moving[lane] if abs(step) > CLOSE * new else 0.0
        left += moving[lane]
    return left > 0.0


@jit
def _finish_at_limit(lanes, c, s):  # type: ignore[no-untyped-def]
    """The best product at the limit; where the best rotation is within it, the start of the search there."""
    squares, gaps, x, top, trace = lanes.squares, lanes.gaps, lanes.x, lanes.top, lanes.trace
    for lane in range(_LANES):
        rest, least = 0.0, x[lane]
        below = top[lane] - trace[lane]
        for k in range(3):
            rest += squares[k, lane] / (x[lane] + gaps[k, lane])
            half = 0.5 * (gaps[k, lane] - below)
            start = half + math.sqrt(half * half + squares[k, lane]) - gaps[k, lane]
            least = start if start > least else least
        lanes.at_limit[lane] = c * c * trace[lane] + s * s * (top[lane] + x[lane]) + c * c * rest
        lanes.inside[lane] = 1.0 if below + x[lane] < rest else 0.0
        x[lane] = least if below + x[lane] < rest else x[lane]


@jit
def _step_within(lanes):  # type: ignore[no-untyped-def]
    """Step as `_step_at_limit`, for the root where the best rotation is within the limit."""
    squares, gaps, x, top, trace, moving = lanes.squares, lanes.gaps, lanes.x, lanes.top, lanes.trace, lanes.moving
    left = 0.0
    for lane in range(_LANES):
        total, slope = 0.0, 1.0
        for k in range(3):
            inverse = 1.0 / (x[lane] + gaps[k, lane])
            term = squares[k, lane] * inverse
            total += term
            slope += term * inverse
        step = (total - (top[lane] - trace[lane]) - x[lane]) / slope
        new = x[lane] + step
        new = new if new > LEAST_STEP else LEAST_STEP
        x[lane] = new if moving[lane] > 0.0 else x[lane]
        moving[lane] = moving[lane] if abs(step) > CLOSE * new else 0.0
        left += moving[lane]
    return left > 0.0
