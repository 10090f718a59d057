"""Compiled cubic splines of movements of unequal length: many rows at once, each in its own vector lane.

Elimination along a banded matrix waits at every knot for the previous division. A row is one dimension of one
movement; several rows are eliminated together, so that the processor works on one while another waits. A knot is a
record with one number per lane and quantity: all strides in memory are constants, so that the compiler vectorizes the
loops over lanes. Shorter rows are continued by a gap so long that what follows has no influence.
"""

from __future__ import annotations

import numpy as np

from kineme.movements.trajectories._compiled import locate
from kineme.runtime.compiled import jit

_LANES = 32  # with fewer the processor waits, more do not fit its cache
_FAR = 1e200  # gap behind the last sample
_BEFORE, _BEHIND = 1, 3  # empty knots that the equations of the outer ones refer to

_FIELDS = ("gap", "inverse", "x", "m", "above", "pivot")  # gap to the next knot; second derivative m
# A cache line more, or the numbers of a lane in consecutive knots would fall into an eighth of the sets of L1.
_KNOT = np.dtype([*((name, np.float64, (_LANES,)) for name in _FIELDS), ("unused", np.float64, (8,))])


@jit
def fill_spline_rows(parameter, positions, offsets, rows):  # type: ignore[no-untyped-def]
    """Not-a-knot splines of every movement at even parameters, (n, d, S); see `spline.spline_rows`."""
    _fill_rows(parameter, positions, offsets, np.ones(len(rows)), False, rows)


@jit
def fill_smooth_rows(times, positions, offsets, scales, rows):  # type: ignore[no-untyped-def]
    """Smoothing splines of every movement at even times, (n, d, S); see `smooth.smooth_rows`."""
    _fill_rows(times, positions, offsets, scales, True, rows)


@jit
def fill_smoothed(times, positions, offsets, scales, smoothed):  # type: ignore[no-untyped-def]
    """Smoothing spline of every movement at its own stamps; see `smooth.Smooth`."""
    n_dims, n_rows = positions.shape[1], (len(offsets) - 1) * positions.shape[1]
    knots = _empty_knots(offsets)
    for first in range(0, n_rows, _LANES):
        _smooth(knots, _load(times, positions, offsets, scales, first, knots))
        for lane in range(min(_LANES, n_rows - first)):
            i, k = divmod(first + lane, n_dims)
            start = positions[offsets[i], k]
            for j in range(offsets[i + 1] - offsets[i]):
                smoothed[offsets[i] + j, k] = knots[j + _BEFORE].x[lane] + start


@jit
def _fill_rows(parameter, positions, offsets, scales, smooth, rows):  # type: ignore[no-untyped-def]
    n, n_dims, n_points = rows.shape
    knots = _empty_knots(offsets)
    interval, local = np.empty(n_points, np.int64), np.empty(n_points)
    for first in range(0, n * n_dims, _LANES):
        length = _load(parameter, positions, offsets, scales, first, knots)
        if smooth:
            _smooth(knots, length)
        else:
            _interpolate(knots, length, offsets, first, n_dims)
        _expand(knots, length)
        for lane in range(min(_LANES, n * n_dims - first)):
            i, k = divmod(first + lane, n_dims)
            if lane == 0 or k == 0:
                # Written to memory, so that sums are not reordered: stamps may be seconds since 1970.
                u = parameter[offsets[i] : offsets[i + 1]] - parameter[offsets[i]]
                locate(u, interval, local)
                local *= scales[i]
            _evaluate(knots, lane, interval, local, rows[i, k])


@jit
def _empty_knots(offsets):  # type: ignore[no-untyped-def]
    """Knots for the longest movement; gaps are 1, since divisions run over unused lanes too."""
    longest = 0
    for i in range(len(offsets) - 1):
        longest = max(longest, offsets[i + 1] - offsets[i])
    knots = np.zeros(longest + _BEFORE + _BEHIND + 1, _KNOT)
    for j in range(_BEFORE, len(knots)):
        knots[j].gap[:] = 1.0
    return knots


@jit
def _load(parameter, positions, offsets, scales, first, knots):  # type: ignore[no-untyped-def]
    """Copy rows from `first` on into the lanes, minus their start, with scaled gaps; return the longest length."""
    n_dims, longest = positions.shape[1], 0
    n_lanes = min(_LANES, (len(offsets) - 1) * n_dims - first)
    for lane in range(n_lanes):
        i = (first + lane) // n_dims
        longest = max(longest, offsets[i + 1] - offsets[i])
    for lane in range(n_lanes):
        i, k = divmod(first + lane, n_dims)
        own, path = parameter[offsets[i] : offsets[i + 1]], positions[offsets[i] : offsets[i + 1], k]
        last, scale, u, start = len(own) - 1, scales[i], own[0], path[0]
        for j in range(last):
            following = own[j + 1]
            knots[j + _BEFORE].gap[lane] = (following - u) * scale
            knots[j + _BEFORE].x[lane] = path[j] - start
            u = following
        knots[last + _BEFORE].x[lane] = path[last] - start
        for j in range(last, longest + _BEHIND):
            knots[j + _BEFORE].gap[lane] = _FAR
            knots[j + _BEFORE + 1].x[lane] = 0.0
    return longest


@jit
def _smooth(knots, length):  # type: ignore[no-untyped-def]
    """Second derivatives m, and x smoothed, as `smooth.smoothing_spline` does.

    The factors are L D L'; `pivot` holds 1 / D, `above` the first off-diagonal of L D, whose second one is the product
    of two neighboring inverse gaps.
    """
    for lane in range(_LANES):
        knots[1].inverse[lane], knots[2].inverse[lane] = 1.0 / knots[1].gap[lane], 1.0 / knots[2].gap[lane]
        knots[1].pivot[lane] = knots[1].above[lane] = knots[1].m[lane] = 0.0
    for j in range(length):  # knot j + 1, in record j + 2
        for lane in range(_LANES):
            a, b, c = knots[j + 1].inverse[lane], knots[j + 2].inverse[lane], 1.0 / knots[j + 3].gap[lane]
            knots[j + 3].inverse[lane] = c
            e, r = knots[j + 1].above[lane], knots[j + 1].pivot[lane]
            second = knots[j].inverse[lane] * a
            factor_1, factor_2 = e * r, second * knots[j].pivot[lane]
            gaps = knots[j + 1].gap[lane] + knots[j + 2].gap[lane]
            row = gaps * (1.0 / 3.0) + (a * a + b * b + (a + b) * (a + b))
            knots[j + 2].pivot[lane] = 1.0 / (row - factor_1 * e - factor_2 * second)
            knots[j + 2].above[lane] = knots[j + 2].gap[lane] * (1.0 / 6.0) - b * (a + 2.0 * b + c) - factor_1 * (a * b)
            left = (knots[j + 2].x[lane] - knots[j + 1].x[lane]) * a
            right = (knots[j + 3].x[lane] - knots[j + 2].x[lane]) * b
            knots[j + 2].m[lane] = right - left - factor_1 * knots[j + 1].m[lane] - factor_2 * knots[j].m[lane]
    for lane in range(_LANES):
        knots[length + 2].m[lane] = knots[length + 3].m[lane] = 0.0
    for j in range(length - 1, -1, -1):
        for lane in range(_LANES):
            e, second = knots[j + 2].above[lane], knots[j + 2].inverse[lane] * knots[j + 3].inverse[lane]
            rest = knots[j + 2].m[lane] - e * knots[j + 3].m[lane] - second * knots[j + 4].m[lane]
            knots[j + 2].m[lane] = rest * knots[j + 2].pivot[lane]
    for j in range(length):
        for lane in range(_LANES):
            left = (knots[j + 1].m[lane] - knots[j].m[lane]) * knots[j].inverse[lane]
            right = (knots[j + 2].m[lane] - knots[j + 1].m[lane]) * knots[j + 1].inverse[lane]
            knots[j + 1].x[lane] -= right - left


@jit
def _interpolate(knots, length, offsets, first, n_dims):  # type: ignore[no-untyped-def]
    """Second derivatives m of the not-a-knot spline.

    Continuity of the slope at the inner knots is ``h[j-1] m[j-1] + 2 (h[j-1] + h[j]) m[j] + h[j] m[j+1] =
    6 (slope[j] - slope[j-1])``. The not-a-knot conditions put the outer second derivatives into the first and last of
    these rows; the last row has another index in every lane, so it is eliminated again after the common loop.
    """
    for lane in range(_LANES):
        knots[1].inverse[lane], knots[2].inverse[lane] = 1.0 / knots[1].gap[lane], 1.0 / knots[2].gap[lane]
        h, behind = knots[1].gap[lane], knots[2].gap[lane]
        q = h * h * knots[2].inverse[lane]
        pivot = 1.0 / (3.0 * h + 2.0 * behind + q)
        knots[2].above[lane] = (behind - q) * pivot
        knots[2].m[lane] = _bend(knots[1], knots[2], knots[3], lane) * pivot
    for j in range(length - 1):  # knot j + 2, in record j + 3
        for lane in range(_LANES):
            before, behind = knots[j + 2].gap[lane], knots[j + 3].gap[lane]
            knots[j + 3].inverse[lane] = 1.0 / behind
            pivot = 1.0 / (2.0 * (before + behind) - before * knots[j + 2].above[lane])
            knots[j + 3].above[lane] = behind * pivot
            left = (knots[j + 3].x[lane] - knots[j + 2].x[lane]) * knots[j + 2].inverse[lane]
            right = (knots[j + 4].x[lane] - knots[j + 3].x[lane]) * knots[j + 3].inverse[lane]
            knots[j + 3].m[lane] = (6.0 * (right - left) - before * knots[j + 2].m[lane]) * pivot
    for lane in range(_LANES):
        knots[length + 2].m[lane] = 0.0  # longer rows of the previous block may have left a number here
        _close(knots, _last(offsets, first + lane, n_dims), lane)
    for j in range(length - 1, -1, -1):
        for lane in range(_LANES):
            knots[j + 2].m[lane] -= knots[j + 2].above[lane] * knots[j + 3].m[lane]
    for lane in range(_LANES):
        _extend(knots, _last(offsets, first + lane, n_dims), lane)


@jit
def _last(offsets, row, n_dims):  # type: ignore[no-untyped-def]
    """Record of the last inner knot of a row."""
    i = min(row // n_dims, len(offsets) - 2)
    return offsets[i + 1] - offsets[i] - 2 + _BEFORE


@jit
def _bend(before, knot, behind, lane):  # type: ignore[no-untyped-def]
    """Right-hand side at one knot of one lane: six times the difference of the slopes."""
    left, right = (knot.x[lane] - before.x[lane]) / before.gap[lane], (behind.x[lane] - knot.x[lane]) / knot.gap[lane]
    return 6.0 * (right - left)


@jit
def _close(knots, last, lane):  # type: ignore[no-untyped-def]
    """Eliminate the last row of one lane, which contains the not-a-knot condition at its end."""
    before, h = knots[last - 1].gap[lane], knots[last].gap[lane]
    q = h * h * knots[last - 1].inverse[lane]
    below = before - q
    pivot = 1.0 / (2.0 * before + 3.0 * h + q - below * knots[last - 1].above[lane])
    bend = _bend(knots[last - 1], knots[last], knots[last + 1], lane)
    knots[last].m[lane] = (bend - below * knots[last - 1].m[lane]) * pivot


@jit
def _extend(knots, last, lane):  # type: ignore[no-untyped-def]
    """Second derivatives at both ends of one lane, where not-a-knot makes the outer two cubics one."""
    step = knots[3].m[lane] - knots[2].m[lane]
    knots[1].m[lane] = knots[2].m[lane] - knots[1].gap[lane] * knots[2].inverse[lane] * step
    step = knots[last].m[lane] - knots[last - 1].m[lane]
    knots[last + 1].m[lane] = knots[last].m[lane] + knots[last].gap[lane] * knots[last - 1].inverse[lane] * step


@jit
def _expand(knots, length):  # type: ignore[no-untyped-def]
    """Taylor coefficients of the cubic after each knot: x, the slope in `above`, m / 2 in m, the third in `pivot`."""
    for j in range(length):
        for lane in range(_LANES):
            m, behind, inverse = knots[j + 1].m[lane], knots[j + 2].m[lane], knots[j + 1].inverse[lane]
            chord = (knots[j + 2].x[lane] - knots[j + 1].x[lane]) * inverse
            knots[j + 1].above[lane] = chord - knots[j + 1].gap[lane] * (2.0 * m + behind) * (1.0 / 6.0)
            knots[j + 1].pivot[lane] = (behind - m) * inverse * (1.0 / 6.0)
            knots[j + 1].m[lane] = 0.5 * m


@jit
def _evaluate(knots, lane, interval, local, row):  # type: ignore[no-untyped-def]
    """The cubics of one lane at the located targets."""
    for p in range(len(row)):
        knot, v = knots[interval[p] + _BEFORE], local[p]
        row[p] = knot.x[lane] + v * (knot.above[lane] + v * (knot.m[lane] + v * knot.pivot[lane]))
