"""Compiled twins of the loops over evenly sampled movements."""

from __future__ import annotations

import numpy as np

from kineme.runtime.compiled import jit


@jit
def locate(u, interval, local):  # type: ignore[no-untyped-def]
    """For each of the even targets from 0 to the end of u, with u[0] = 0: its interval, and its distance from the knot.

    The knots at or below each target are counted and the counts summed up. That has no branch to mispredict: on
    irregular stamps it is several times faster than a walk along the knots.
    """
    n_points, last = len(interval), len(u) - 1
    step = u[last] / (n_points - 1)
    per_step = 1.0 / step
    interval[:] = 0
    for j in range(1, last):
        target = int(np.ceil(u[j] * per_step))
        interval[max(0, min(target, n_points - 1))] += 1  # clipped, so that NaN cannot write outside the array
    j = 0
    for p in range(n_points):
        j += interval[p]
        interval[p] = j
        local[p] = p * step - u[j]


@jit
def fill_even_rows(block, rows):  # type: ignore[no-untyped-def]
    """Movements (n, T, d) as rows (n, d, T) minus their start; see `resample.even_rows`."""
    n, n_samples, n_dims = block.shape
    for i in range(n):
        for k in range(n_dims):
            row, start = rows[i, k], block[i, 0, k]
            for t in range(n_samples):
                row[t] = block[i, t, k] - start


@jit
def fill_extents(positions, offsets, extents):  # type: ignore[no-untyped-def]
    """Largest minus smallest of each movement and dimension, in one pass; see `resample.extents_of`."""
    n, n_dims = extents.shape
    for i in range(n):
        for k in range(n_dims):
            low = high = positions[offsets[i], k]
            for t in range(offsets[i] + 1, offsets[i + 1]):
                low, high = min(low, positions[t, k]), max(high, positions[t, k])
            extents[i, k] = high - low


@jit
def nth_smallest(values, n):  # type: ignore[no-untyped-def]
    """The n-th smallest value, from 0, by C. A. R. Hoare (1961, Algorithm 65); `np.partition` is slow to compile."""
    low, high = 0, len(values) - 1
    while low < high:
        pivot, i, j = values[(low + high) // 2], low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if n <= j:
            high = j
        elif n >= i:
            low = i
        else:
            break
    return values[n]


@jit
def fill_usual_steps(times, offsets, share, quantile, steps):  # type: ignore[no-untyped-def]
    """Quantile of the gaps of each movement, 0 where no gap is close; see `movements.merge_close`."""
    longest = 0
    for i in range(len(steps)):
        longest = max(longest, offsets[i + 1] - offsets[i])
    gaps, range_bits = np.empty(longest), np.empty(2, np.int64)
    gap_bits, ends = gaps.view(np.int64), range_bits.view(np.float64)  # bits of positive floats have their order
    for i in range(len(steps)):
        own = times[offsets[i] : offsets[i + 1]]
        n_gaps = len(own) - 1
        for j in range(n_gaps):
            gaps[j] = own[j + 1] - own[j]
        low, high = gap_bits[0], gap_bits[0]
        for j in range(n_gaps):
            low = min(low, gap_bits[j])
        for j in range(n_gaps):
            high = max(high, gap_bits[j])
        range_bits[0], range_bits[1] = low, high
        at = int(quantile * n_gaps)
        steps[i] = nth_smallest(gaps[:n_gaps], at) if ends[0] < share * ends[1] else 0.0


@jit
def fill_arc_rows(paths, a, rows):  # type: ignore[no-untyped-def]
    """Paths (n, d, T) at even values of their phase, (n, d, S); see `arc_length.resample_by_arc_length`."""
    n, n_dims, n_samples = paths.shape
    n_points = rows.shape[2]
    phase, interval, local = np.zeros(n_samples), np.empty(n_points, np.int64), np.empty(n_points)
    for i in range(n):
        phase[:] = 0.0
        for k in range(n_dims):
            path = paths[i, k]
            for t in range(n_samples - 1):
                step = path[t + 1] - path[t]
                phase[t + 1] += step * step
        for t in range(n_samples):
            phase[t] = np.sqrt(phase[t])
        for t in range(1, n_samples):
            phase[t] += phase[t - 1]
        total = phase[n_samples - 1]
        share = a if total > 0.0 else 0.0
        per_length = share / total if total > 0.0 else 0.0
        per_sample = (1.0 - share) / (n_samples - 1)
        for t in range(n_samples):
            phase[t] = per_length * phase[t] + per_sample * t
        locate(phase, interval, local)
        for p in range(n_points):
            j = interval[p]
            local[p] = min(1.0, local[p] / (phase[j + 1] - phase[j]))
        for k in range(n_dims):
            path, row = paths[i, k], rows[i, k]
            for p in range(n_points):
                j = interval[p]
                row[p] = path[j] + local[p] * (path[j + 1] - path[j])
