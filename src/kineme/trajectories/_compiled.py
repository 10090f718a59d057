"""Compiled twins of the loops over ragged movements."""

from __future__ import annotations

import numpy as np

from kineme.compiled import jit


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
def fill_extents(rows, extents):  # type: ignore[no-untyped-def]
    """Largest minus smallest of each row (n, d, T), in one pass; see `resample.extents_of`."""
    n, n_dims, n_samples = rows.shape
    for i in range(n):
        for k in range(n_dims):
            row = rows[i, k]
            low, high = row[0], row[0]
            for t in range(1, n_samples):
                low, high = min(low, row[t]), max(high, row[t])
            extents[i, k] = high - low


@jit
def fill_spline_rows(parameter, positions, offsets, rows):  # type: ignore[no-untyped-def]
    """Not-a-knot cubic spline of every movement at even parameters; see `spline.spline_rows`.

    With knot distances h and second derivatives m, continuity of the slope at the inner knots is
    ``h[j-1] m[j-1] + 2 (h[j-1] + h[j]) m[j] + h[j] m[j+1] = 6 (slope[j] - slope[j-1])``. The
    not-a-knot conditions put the outer second derivatives into the first and last of these rows.
    """
    n, n_dims, n_points = rows.shape
    longest = 0
    for i in range(n):
        longest = max(longest, offsets[i + 1] - offsets[i])
    h, inv_h, above, cubic = np.empty(longest), np.empty(longest), np.empty(longest), np.empty(longest)
    y, slope, m = np.empty((n_dims, longest)), np.empty((n_dims, longest)), np.empty((n_dims, longest))
    interval, local = np.empty(n_points, np.int64), np.empty(n_points)
    for i in range(n):
        first, length = offsets[i], offsets[i + 1] - offsets[i]
        u = parameter[first : first + length] - parameter[first]  # stamps count seconds since 1970 here and there
        for j in range(length - 1):
            h[j] = u[j + 1] - u[j]
            inv_h[j] = 1.0 / h[j]
        for k in range(n_dims):
            _chords(positions[first : first + length, k], inv_h, length, y[k], slope[k], m[k])
        _eliminate(h, inv_h, length, above, m)
        _locate(u, length, interval, local)
        for k in range(n_dims):
            _substitute(h, inv_h, length, above, m[k])
            _evaluate(h, inv_h, length, y[k], slope[k], m[k], cubic, interval, local, rows[i, k])


@jit
def _chords(x, inv_h, length, y, slope, m):  # type: ignore[no-untyped-def]
    """Positions from the start, chord slopes, and the right-hand side of the equations."""
    for j in range(length):
        y[j] = x[j] - x[0]
    for j in range(length - 1):
        slope[j] = (y[j + 1] - y[j]) * inv_h[j]
    for j in range(1, length - 1):
        m[j] = 6.0 * (slope[j] - slope[j - 1])


@jit
def _eliminate(h, inv_h, length, above, m):  # type: ignore[no-untyped-def]
    """Forward elimination of the tridiagonal matrix, in all dimensions; `above` gets its upper diagonal.

    Each pivot waits for the division before it: one loop for all lets the processor work on the
    right-hand sides meanwhile, and `used`, which is ``h[j] * above[j]``, does not wait for `above`.
    """
    last = length - 2  # the last inner knot
    q = h[0] * h[0] * inv_h[1]
    pivot = 1.0 / (3.0 * h[0] + 2.0 * h[1] + q)
    above[1] = (h[1] - q) * pivot
    m[:, 1] *= pivot
    used = h[1] * above[1]
    for j in range(2, last):
        pivot = 1.0 / (2.0 * (h[j - 1] + h[j]) - used)
        used = (h[j] * h[j]) * pivot
        above[j] = h[j] * pivot
        for k in range(len(m)):
            m[k, j] = (m[k, j] - h[j - 1] * m[k, j - 1]) * pivot
    q = h[last] * h[last] * inv_h[last - 1]
    below = h[last - 1] - q
    pivot = 1.0 / (2.0 * h[last - 1] + 3.0 * h[last] + q - below * above[last - 1])
    m[:, last] = (m[:, last] - below * m[:, last - 1]) * pivot


@jit
def _substitute(h, inv_h, length, above, m):  # type: ignore[no-untyped-def]
    """Backward substitution of one dimension, and the second derivatives at both ends."""
    last = length - 2
    for j in range(last - 1, 0, -1):
        m[j] -= above[j] * m[j + 1]
    m[0] = m[1] - h[0] * inv_h[1] * (m[2] - m[1])
    m[last + 1] = m[last] + h[last] * inv_h[last - 1] * (m[last] - m[last - 1])


@jit
def _evaluate(h, inv_h, length, y, slope, m, cubic, interval, local, row):  # type: ignore[no-untyped-def]
    """The cubics of one dimension at the even targets; overwrites slopes and second derivatives."""
    for j in range(length - 1):
        slope[j] -= h[j] * (2.0 * m[j] + m[j + 1]) * (1.0 / 6.0)
        cubic[j] = (m[j + 1] - m[j]) * inv_h[j] * (1.0 / 6.0)
        m[j] *= 0.5
    for p in range(len(row)):
        j, v = interval[p], local[p]
        row[p] = y[j] + v * (slope[j] + v * (m[j] + v * cubic[j]))


@jit
def _locate(u, length, interval, local):  # type: ignore[no-untyped-def]
    """For each even target, its knot interval and its distance from the interval's left knot; u starts at 0.

    Counting the knots at or below each target, then adding up, has no branch to mispredict: on
    irregular stamps it is several times faster than walking along the knots.
    """
    n_points = len(interval)
    step = u[length - 1] / (n_points - 1)
    per_step = 1.0 / step
    interval[:] = 0
    for j in range(1, length - 1):
        target = int(np.ceil(u[j] * per_step))
        interval[min(target, n_points - 1)] += 1
    j = 0
    for p in range(n_points):
        j += interval[p]
        interval[p] = j
        local[p] = p * step - u[j]


@jit
def fill_smoothed(u, positions, offsets, penalties, smoothed):  # type: ignore[no-untyped-def]
    """Reinsch's smoothing spline of every movement; see `smooth.Smooth`.

    With Q the second divided differences and R the Gram matrix of hat functions, both banded, the second
    derivatives of the spline solve ``(R + lam Q'Q) m = Q'x``, and the smoothed positions are ``x - lam Q m``.
    """
    longest = 0
    for i in range(len(penalties)):
        longest = max(longest, offsets[i + 1] - offsets[i])
    inv_h, m = np.empty(longest), np.empty(longest + 2)
    diagonal, above, second = np.empty(longest), np.empty(longest), np.empty(longest)
    for i in range(len(penalties)):
        first, length, lam = offsets[i], offsets[i + 1] - offsets[i], penalties[i]
        for j in range(length - 1):
            inv_h[j] = 1.0 / (u[first + j + 1] - u[first + j])
        _factor_smoother(inv_h, length - 2, lam, diagonal, above, second)
        for k in range(positions.shape[1]):
            x = positions[first : first + length, k]
            _solve_smoother(x, inv_h, length - 2, diagonal, above, second, m)
            for j in range(length):  # m is stored from index 1; the outer second derivatives are 0
                left = (m[j + 1] - m[j]) * inv_h[j] if j < length - 1 else 0.0
                right = (m[j] - m[j - 1]) * inv_h[j - 1] if j > 0 else 0.0
                smoothed[first + j, k] = x[j] - lam * (left - right)


@jit
def _factor_smoother(inv_h, n, lam, diagonal, above, second):  # type: ignore[no-untyped-def]
    """L D L' factors of the pentadiagonal matrix R + lam Q'Q of the n inner knots.

    `diagonal` holds 1 / D, `above` and `second` the off-diagonals of L. The last two rows are carried in
    scalars: one division per knot is all that the chain waits for.
    """
    pivot_1 = pivot_2 = above_1 = second_1 = second_2 = 0.0  # of the rows one and two before
    for j in range(n):
        a, b = inv_h[j], inv_h[j + 1]
        c = inv_h[j + 2] if j < n - 1 else 0.0
        row = (1.0 / a + 1.0 / b) / 3.0 + lam * (a * a + b * b + (a + b) * (a + b))
        pivot = row - above_1 * above_1 * pivot_1 - second_2 * second_2 * pivot_2
        next_one = 1.0 / (6.0 * b) - lam * b * (a + 2.0 * b + c) - above_1 * second_1 * pivot_1 if j < n - 1 else 0.0
        next_two = lam * b * c if j < n - 2 else 0.0
        reciprocal = 1.0 / pivot
        diagonal[j], above[j], second[j] = reciprocal, next_one * reciprocal, next_two * reciprocal
        pivot_2, pivot_1 = pivot_1, pivot
        second_2, second_1, above_1 = second_1, second[j], above[j]


@jit
def _solve_smoother(x, inv_h, n, diagonal, above, second, m):  # type: ignore[no-untyped-def]
    """Second derivatives at the inner knots, in m[1] to m[n]; m[0] and m[n + 1] are 0."""
    value_1 = value_2 = above_1 = second_1 = second_2 = 0.0
    for j in range(n):
        value = (x[j + 2] - x[j + 1]) * inv_h[j + 1] - (x[j + 1] - x[j]) * inv_h[j]
        value -= above_1 * value_1 + second_2 * value_2
        m[j + 1] = value * diagonal[j]
        value_2, value_1 = value_1, value
        second_2, second_1, above_1 = second_1, second[j], above[j]
    m[0] = m[n + 1] = 0.0
    below_1 = below_2 = 0.0
    for j in range(n - 1, -1, -1):
        below = m[j + 1] - above[j] * below_1 - second[j] * below_2
        m[j + 1] = below
        below_2, below_1 = below_1, below


@jit
def fill_arc_rows(paths, a, rows):  # type: ignore[no-untyped-def]
    """Paths (n, d, T) at even values of their phase, (n, d, S); see `arc_length.resample_by_arc_length`."""
    n, n_dims, n_samples = paths.shape
    n_points = rows.shape[2]
    phase = np.empty(n_samples)
    for i in range(n):
        phase[0] = 0.0
        for t in range(1, n_samples):
            square = 0.0
            for k in range(n_dims):
                step = paths[i, k, t] - paths[i, k, t - 1]
                square += step * step
            phase[t] = phase[t - 1] + np.sqrt(square)
        total = phase[n_samples - 1]
        share = a if total > 0.0 else 0.0
        per_length = share / total if total > 0.0 else 0.0
        for t in range(n_samples):
            phase[t] = per_length * phase[t] + (1.0 - share) * t / (n_samples - 1)
        j = 0
        for p in range(n_points):
            target = p / (n_points - 1)
            while j < n_samples - 2 and phase[j + 1] <= target:
                j += 1
            weight = min(1.0, (target - phase[j]) / (phase[j + 1] - phase[j]))
            for k in range(n_dims):
                rows[i, k, p] = paths[i, k, j] + weight * (paths[i, k, j + 1] - paths[i, k, j])
