"""Compiled distances of point clouds; their plain twins are in `kineme_experiments.evaluation.methods`."""

from __future__ import annotations

from typing import Any

import numpy as np

from kineme.runtime.compiled import jit


@jit
def fill_plus(A: Any, B: Any, out: Any) -> None:
    """$P+ distances of clouds (n, N, k) and (m, N, k) into out (n, m); k counts the turning angle."""
    size = A.shape[1]
    squares = np.empty((size, size))
    for a in range(len(A)):
        for b in range(len(B)):
            _fill_squares(A[a], B[b], squares)
            out[a, b] = min(_one_way(squares), _one_way(squares.T))


@jit
def _fill_squares(A: Any, B: Any, squares: Any) -> None:
    """Squared distances of every point of one cloud (N, k) to every point of another."""
    for i in range(len(A)):
        for j in range(len(B)):
            total = 0.0
            for c in range(A.shape[1]):
                total += (A[i, c] - B[j, c]) ** 2
            squares[i, j] = total


@jit
def _one_way(squares: Any) -> float:
    """Every point of the first cloud to its nearest; then the points of the second that nothing was matched to."""
    size = len(squares)
    matched = np.zeros(size, dtype=np.bool_)
    total = 0.0
    for i in range(size):
        nearest = 0
        for j in range(1, size):
            if squares[i, j] < squares[i, nearest]:
                nearest = j
        matched[nearest] = True
        total += np.sqrt(squares[i, nearest])
    for j in range(size):
        if not matched[j]:
            least = squares[0, j]
            for i in range(1, size):
                least = min(least, squares[i, j])
            total += np.sqrt(least)
    return total


@jit
def fill_nearest(A: Any, B: Any, step: int, squared: bool, nearest: Any, distance: Any) -> None:
    """Index of the nearest cloud of B (m, N, d) to each of A (n, N, d) by $P or $Q, and its distance; (n,) each.

    Clouds that cannot be nearer than the best one so far are abandoned.
    """
    size = A.shape[1]
    costs = np.empty((size, size))
    for a in range(len(A)):
        best = np.inf
        for b in range(len(B)):
            _fill_squares(A[a], B[b], costs)
            if not squared:
                for i in range(size):
                    for j in range(size):
                        costs[i, j] = np.sqrt(costs[i, j])
            found = _matched(costs, costs.T, step, best)
            if found < best:
                best = found
                nearest[a] = b
        distance[a] = best


@jit
def _matched(there: Any, back: Any, step: int, best: float) -> float:
    """The least cost of all starts in both directions, or `best` if none costs less."""
    size = len(there)
    for direction in range(2):
        costs = there if direction == 0 else back
        sums = np.empty(size + 1)  # of the costs of the nearest points: (i,) up to point i
        sums[0] = 0.0
        bound = 0.0
        for i in range(size):
            least = costs[i, 0]
            for j in range(1, size):
                least = min(least, costs[i, j])
            sums[i + 1] = sums[i] + least
            bound += (size - i) * least
        for start in range(0, size, step):
            if bound + start * sums[size] - size * sums[start] < best:
                best = min(best, _greedy(costs, start, best))
    return best


@jit
def _greedy(costs: Any, start: int, best: float) -> float:
    """Cost of matching point after point to its nearest unmatched one, the first weighing most."""
    size = len(costs)
    free = np.arange(size)
    total = 0.0
    for k in range(size):
        i = (start + k) % size
        left = size - k
        at = 0
        for j in range(1, left):
            if costs[i, free[j]] < costs[i, free[at]]:
                at = j
        total += left * costs[i, free[at]]
        if total >= best:
            return total
        free[at] = free[left - 1]
    return total
