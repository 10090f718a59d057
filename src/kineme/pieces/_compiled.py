"""Compiled search of the best k of many rows of reduced features for one query. Importing this imports Numba.

Twin of `kineme.pieces.scan.scan_plain`, which says what the parts of an index, of a plan and of a query are.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from kineme.runtime.compiled import jit

_FIRST = 64
_NEWTON_STEPS = 6  # as of `similarity.bounds`
_ROUNDING = 4e-6  # the same
_SLACK = np.float32(1e-5)  # of squared norms, and of logarithms: bounds by marks are computed in single precision
_SLOPE = np.float32(0.5 / math.log(2.0) / 16.0)
_LN2 = np.float32(math.log(2.0))


@jit
def scan(index, query, plan, best, rows, state, first_row):  # type: ignore[no-untyped-def]
    """Go on with the best k scores `best` and `rows`, a heap, least first, by the rows of an index.

    `state` is that of `kineme.pieces.scan.Best`. Rows are numbered from `first_row`.
    """
    marks, lows, highs, _ = index
    n_blocks, size = marks.shape[0], marks.shape[2]
    bounds, slacks = _block_bounds(lows, highs, query[0], plan)
    work = np.empty(size, np.float32), np.empty(size, np.float32), np.empty(len(plan[3]))
    for _ in range(min(_FIRST, n_blocks)):
        b: Any = np.argmax(bounds)
        if bounds[b] >= _bar(best, state):
            _scan_block(index, b, slacks, query, plan, work, (best, rows, state), first_row)
        bounds[b] = -np.inf
    for b in range(n_blocks):
        if bounds[b] >= _bar(best, state) and bounds[b] > -np.inf:
            _scan_block(index, b, slacks, query, plan, work, (best, rows, state), first_row)


@jit
def _bar(best, state):  # type: ignore[no-untyped-def]
    bar = max(np.float64(best[0]), state[0])
    return bar - _SLACK * (1.0 + abs(bar)) if bar > -np.inf else bar


@jit
def _block_bounds(lows, highs, marks, plan):  # type: ignore[no-untyped-def]
    """Bounds (n_blocks,) of the scores in each block, and its slack (n_blocks, R) of squared distances."""
    ends, _, _, halves, logs, codes, _ = plan
    n_blocks: Any = len(lows)
    n_representations: Any = len(halves)
    bounds, slacks = np.empty(n_blocks, np.float32), np.empty((n_blocks, n_representations), np.float32)
    for b in range(n_blocks):
        total = np.float32(0.0)
        for r in range(n_representations):
            square, norms = np.float32(0.0), np.float32(0.0)
            for j in range(ends[r], ends[r + 1]):
                low, high, mark = lows[b, j], highs[b, j], marks[j]
                away = max(low - mark, mark - high, np.float32(0.0))
                far = max(abs(low), abs(high))
                square += away * away
                norms += far * far + mark * mark
            slacks[b, r] = _SLACK * norms
            own = np.float32(logs[r]) - max(square - slacks[b, r], np.float32(0.0)) * np.float32(halves[r])
            total = own if r == 0 else _joined(total, own, codes[0])
        bounds[b] = _averaged(total, codes[0], n_representations)
    return bounds, slacks


@jit
def _joined(total, own, mean):  # type: ignore[no-untyped-def]
    """Add the logarithm of one more kernel to an upper bound of their sum, or to what the mean is bounded by."""
    if mean == 0:  # log(exp a + exp b) = max + log(1 + exp -t), and the latter is at most ln 2 (1 + t / 32 ln 2)^-16
        x = np.float32(1.0) + _SLOPE * abs(total - own)
        x *= x
        x *= x
        x *= x
        return max(total, own) + _LN2 / (x * x)
    if mean == 1:
        return max(total, own)
    return total + own


@jit
def _averaged(total, mean, n):  # type: ignore[no-untyped-def]
    return total if mean < 2 else total / np.float32(n)


@jit
def _scan_block(index, b, slacks, query, plan, work, top, first_row):  # type: ignore[no-untyped-def]
    marks, _, _, reduced = index
    ends, _, _, halves, logs, codes, _ = plan
    totals, sums, kernels = work
    best, rows, state = top
    size, mean = marks.shape[2], codes[0]
    for r in range(len(halves)):
        how, into = (logs[r], halves[r], slacks[b, r]), sums if r else totals
        _fill_logs(marks[b], query[0], (ends[r], ends[r + 1]), how, into)
        if r == 0:
            continue
        if mean == 0:
            for i in range(size):
                totals[i] = _joined(totals[i], sums[i], 0)
        else:
            for i in range(size):
                totals[i] = _joined(totals[i], sums[i], mean)
    start = b * size
    for i in range(min(size, len(reduced) - start)):
        if _averaged(totals[i], mean, len(halves)) >= _bar(best, state):
            score = np.float32(_log_bound(reduced, start + i, query, plan, kernels))
            state[2] += 1
            if score >= state[0]:
                _keep(best, rows, state, score, first_row + start + i)


@jit
def _fill_logs(block, marks, part, how, logs):  # type: ignore[no-untyped-def]
    """Write upper bounds (BLOCK,) of the logarithm of one kernel."""
    begin, end = part
    log, half, slack = np.float32(how[0]), np.float32(how[1]), how[2]
    logs[:] = np.float32(0.0)
    for j in range(begin, end):
        mark, row = marks[j], block[j]
        for i in range(len(logs)):
            away = row[i] - mark
            logs[i] += away * away
    for i in range(len(logs)):
        logs[i] = log - max(logs[i] - slack, np.float32(0.0)) * half


@jit
def _keep(best, rows, state, score, row):  # type: ignore[no-untyped-def]
    """Put a score into the heap, if it is larger than the least."""
    if score <= best[0]:
        state[1] = max(state[1], score)
        return
    state[1] = max(state[1], best[0])
    k, i = len(best), 0
    while True:
        child = 2 * i + 1
        if child + 1 < k and best[child + 1] < best[child]:
            child += 1
        if child >= k or best[child] >= score:
            break
        best[i], rows[i] = best[child], rows[child]
        i = child
    best[i], rows[i] = score, row
    state[0] = max(state[0], best[0])


@jit
def _log_bound(rows, i, query, plan, kernels):  # type: ignore[no-untyped-def]
    """Bound the logarithm of the averaged kernel between a query and row i, as `similarity.bounds.log_bounds` does."""
    _, begins, counts, halves, logs, codes, turns = plan
    _, values, squares, residuals = query
    for r in range(len(halves)):
        begin, end = begins[r], begins[r] + counts[r]
        square, residual = np.float64(rows[i, end]), np.float64(rows[i, end + 1])
        norms = math.sqrt(squares[r] * square)
        inner = _alignment(values, rows, i, (begin, end), norms, codes[1], turns) + residuals[r] * residual
        away = 0.5 * (1.0 - _ROUNDING) * (squares[r] + square) - inner
        kernels[r] = logs[r] - max(away, 0.0) * 2.0 * halves[r]
    return _mean(kernels, codes[0])


@jit
def _mean(logs, mean):  # type: ignore[no-untyped-def]
    """The A-averages of `similarity.specification.LOG_MEANS`; the arithmetic one of logarithms less log R."""
    if mean == 0:
        return _log_sum(logs, 1.0)
    if mean == 1:
        return 0.5 * (_log_sum(logs, 2.0) - math.log(len(logs)))
    if mean == 2:
        return logs.sum() / len(logs)
    if mean == 3:
        return math.log(len(logs)) - _log_sum(logs, -1.0)
    return logs.min()


@jit
def _log_sum(logs, factor):  # type: ignore[no-untyped-def]
    most = factor * logs[0]
    for r in range(1, len(logs)):
        most = max(most, factor * logs[r])
    total = 0.0
    for r in range(len(logs)):
        total += math.exp(factor * logs[r] - most)
    return most + math.log(total)


@jit
def _alignment(a, rows, i, part, norms, kind, turns):  # type: ignore[no-untyped-def]
    """Return the largest inner product of a part of a query and the same part of row i, less what a rotation costs."""
    begin, end = part
    if kind == 0:
        inner = 0.0
        for t in range(begin, end):
            inner += a[t] * rows[i, t]
        return inner
    if kind == 3:
        return _in_space(a, rows, i, part, norms, turns)
    half = (end - begin) // 2
    re, im = 0.0, 0.0
    for t in range(begin, begin + half):
        x, y = np.float64(rows[i, t]), np.float64(rows[i, t + half])
        re += a[t] * x + a[t + half] * y
        im += a[t + half] * x - a[t] * y
    if kind == 2:
        weight = turns[2, 2] * norms
        return math.sqrt((re + weight) ** 2 + im * im) - weight
    size = math.sqrt(re * re + im * im)
    return size if re >= turns[0, 0] * size else turns[0, 0] * re + turns[0, 1] * abs(im)


@jit
def _in_space(a, rows, row, part, norms, F):  # type: ignore[no-untyped-def]
    """Bound the same in space over all rotations, see `similarity.bounds`."""
    begin, end = part
    k = (end - begin) // 3
    C = np.empty((3, 3))
    longer, longest = 0.0, 0.0
    for t in range(begin, end):
        longer += a[t] * a[t]
        longest += np.float64(rows[row, t]) * np.float64(rows[row, t])
    for i in range(3):
        for j in range(3):
            inner = 0.0
            for t in range(begin, begin + k):
                inner += rows[row, t + i * k] * a[t + j * k]
            C[i, j] = inner + F[i, j] * norms
    square, last, determinant = 0.0, 0.0, 0.0
    for i in range(3):
        u, v = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            p, q = (j + 1) % 3, (j + 2) % 3
            cofactor = C[u, p] * C[v, q] - C[u, q] * C[v, p]
            square += C[i, j] * C[i, j]
            last += 4.0 * cofactor * cofactor
            if i == 0:
                determinant += C[0, j] * cofactor
    trace = norms * (F[0, 0] + F[1, 1] + F[2, 2])
    x = min(math.sqrt(longer * longest) + trace, math.sqrt(square + math.sqrt(3.0 * last)))
    for _ in range(_NEWTON_STEPS):
        over = x * x - square
        slope = 4.0 * x * over - 8.0 * determinant
        value = over * over - 8.0 * x * determinant - last
        if slope > 0.0:
            x -= max(value, 0.0) / slope
    return x - trace
