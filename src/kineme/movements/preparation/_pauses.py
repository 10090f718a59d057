"""Compiled twin of the search for pauses."""

from __future__ import annotations

import numpy as np

from kineme.movements.preparation import pauses
from kineme.movements.trajectories._compiled import nth_smallest
from kineme.runtime.compiled import jit


@jit
def fill_cut(samples, offsets, rule, cut, ends):  # type: ignore[no-untyped-def]
    """Movements with their pauses cut short, one after the other from 0 on; whether any had one, see `cut_pauses`."""
    times, positions = samples
    cut_times, cut_positions = cut
    steps, moving, changes = np.empty(len(times)), np.empty(len(times), np.bool_), False
    ends[0] = 0
    for i in range(len(offsets) - 1):
        begin, n = ends[i], offsets[i + 1] - offsets[i]
        own_times, own = cut_times[begin : begin + n], cut_positions[begin : begin + n]
        for j in range(n):
            own_times[j] = times[offsets[i] + j]
            for k in range(positions.shape[1]):
                own[j, k] = positions[offsets[i] + j, k]
        for _ in range(pauses.ROUNDS):
            if not _fill_shortened(own_times[:n], own[:n], rule, steps[:n], moving[:n]):
                break
            changes, elapsed, left = True, 0.0, 0
            for j in range(n):
                if moving[j]:
                    own_times[left] = elapsed
                    for k in range(positions.shape[1]):
                        own[left, k] = own[j, k]
                    left += 1
                elapsed += steps[j]
            n = left
        ends[i + 1] = begin + n
    return changes


@jit
def _fill_shortened(times, positions, rule, steps, moving):  # type: ignore[no-untyped-def]
    """Steps of one movement, as far as they count, and which samples are left; whether anything changes."""
    last, (allowance, shortens_rests) = len(times) - 1, rule
    usual = _fill_steps(times, steps)
    reach, rests, between = 0.0, False, False
    if shortens_rests:
        reach, rests, between = _fill_resting(positions, moving)
    else:
        moving[:] = True
    motion, path = 0.0, 0.0
    for j in range(last):
        if moving[j]:
            motion += min(steps[j], usual)
    scale = allowance * motion  # pauses count by shares of it
    gaps = _may_have_gaps(steps, usual, scale)
    if not gaps and not rests:
        return False
    if gaps or between:  # a path takes long to measure, and rests at the ends do not depend on it
        for j in range(last):
            if moving[j]:
                path += np.sqrt(_squared_distance(positions, j, j + 1))
    pace = motion / path if path > 0 else 0.0  # seconds for a unit of length
    if not gaps:
        return _shorten_rests(steps, moving, scale, allowance * pauses.REST * reach * pace)
    changes = False
    before = 0.0
    for j in range(last):
        step = steps[j]
        if step > usual:
            length = np.sqrt(_squared_distance(positions, j, j + 1))
            most = min(pauses.GAP * max(before, steps[j + 1], length * pace), pauses.PAUSE * scale)
            changes |= step > pauses.EQUAL * max(usual, most)
            steps[j] = min(step, max(usual, most))
        before = step
    return _shorten_rests(steps, moving, scale, allowance * pauses.REST * reach * pace) or changes


@jit
def _fill_steps(times, steps):  # type: ignore[no-untyped-def]
    """Steps of one movement, 0 after its last sample; above which they may be gaps, infinite where none is."""
    last, most = len(times) - 1, 0.0
    for j in range(last):
        steps[j] = times[j + 1] - times[j]
        most = max(most, steps[j])
    steps[last] = 0.0
    n_short, share = 0, most / pauses.GAP
    for j in range(last):
        n_short += steps[j] < share  # a sum has no branch and becomes vector instructions
    if n_short <= last // 2:  # the median is at least that share of the longest step
        return np.inf
    return pauses.GAP * nth_smallest(steps[:last].copy(), last // 2)


@jit
def _may_have_gaps(steps, usual, motion):  # type: ignore[no-untyped-def]
    """Tell whether a step may be a gap, before the path is measured: lengths only make gaps fewer."""
    if usual == np.inf:
        return False
    before = 0.0
    for j in range(len(steps) - 1):
        if steps[j] > pauses.EQUAL * max(usual, min(pauses.GAP * max(before, steps[j + 1]), pauses.PAUSE * motion)):
            return True
        before = steps[j]
    return False


@jit
def _fill_resting(positions, moving):  # type: ignore[no-untyped-def]
    """Mark the samples of one movement after which it rests as not kept, for now.

    Its reach, whether it rests, and whether it rests anywhere but at its ends.
    """
    n, window, size = len(positions), pauses.SHORTEST, 0.0
    while 2 * pauses.WINDOWS * window <= n:
        window *= 2
    for j in range(1, n):
        size = max(size, _squared_distance(positions, 0, j))
    most_apart = pauses.RADIUS * pauses.RADIUS * size
    until, n_rests, begin = 0, 0, 0  # the last sample and the first one of the newest rest
    for j in range(n - window + 1):  # the last sample of a window settles it for most windows
        last = _squared_distance(positions, j, j + window - 1)
        if last <= most_apart and _is_still(positions, j, window, most_apart):
            if j > until or n_rests == 0:
                n_rests, begin = n_rests + 1, j
            until = j + window - 1
        moving[j] = j >= until
    for j in range(max(n - window + 1, 0), n):
        moving[j] = j >= until
    n_at_ends = int(not moving[0]) + int(begin > 0 and until == n - 1)
    return np.sqrt(size), n_rests > 0, n_rests > n_at_ends


@jit
def _shorten_rests(steps, moving, motion, most):  # type: ignore[no-untyped-def]
    """Shorten the rests of one movement, and tell which samples are left; whether there are long rests."""
    n, changes, j = len(steps), False, 0
    while j < n:
        begin, total = j, 0.0
        while not moving[j]:  # the last sample is kept
            total += steps[j]
            moving[j] = True
            j += 1
        limit = pauses.PAUSE * motion if begin == 0 else min(pauses.PAUSE * motion, most)
        if j == n - 1:
            limit = pauses.LAST_REST * motion
        if total > pauses.EQUAL * limit and limit > 0:
            changes, count, share = True, j - begin, limit / total
            left = max(pauses.FEWEST, int(np.ceil(share * count - pauses.SAME_COUNT)))
            for p in range(count):
                steps[begin + p] *= share
                moving[begin + p] = p == 0 or p * left // count != (p - 1) * left // count
        j += 1
    return changes


@jit
def _is_still(positions, begin, window, most_apart):  # type: ignore[no-untyped-def]
    """Tell whether the samples of a window stay near its first."""
    for j in range(begin + 1, begin + window - 1):  # noqa: SIM110 - Numba compiles no generators
        if _squared_distance(positions, begin, j) > most_apart:
            return False
    return True


@jit
def _squared_distance(positions, i, j):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(positions.shape[1]):
        total += (positions[j, k] - positions[i, k]) ** 2
    return total
