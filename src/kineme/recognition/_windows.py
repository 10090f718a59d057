"""Compiled twins of the loops over candidate windows. Importing this imports Numba."""

from __future__ import annotations

import math

import numpy as np

from kineme.runtime.compiled import jit


@jit
def fill_windows(times, positions, start, end, share, windows):  # type: ignore[no-untyped-def]
    """Fill in the recording at shares of the time from `start` to `end`, (n, T, d); see `resampled`."""
    n, n_points, n_dims = windows.shape
    last = len(times) - 2
    for i in range(n):
        j = max(0, min(np.searchsorted(times, start[i], side="right") - 1, last))
        for p in range(n_points):
            at = start[i] + (end[i] - start[i]) * share[p]
            while j < last and times[j + 1] <= at:
                j += 1
            weight = (at - times[j]) / (times[j + 1] - times[j])
            for k in range(n_dims):
                windows[i, p, k] = positions[j, k] * (1.0 - weight) + positions[j + 1, k] * weight


@jit
def fill_size_and_slowness(samples, slow, sizes, slowness):  # type: ignore[no-untyped-def]
    """Fill in the distances of paths (n, T, d) from their centers, root mean square, and the shares of slow steps.

    See `compared_windows.size_and_slowness`.
    """
    n, n_samples, n_dims = samples.shape
    steps = np.empty(n_samples - 1)
    for i in range(n):
        path = samples[i]
        total = 0.0
        for k in range(n_dims):
            center = 0.0
            for t in range(n_samples):
                center += path[t, k]
            center /= n_samples
            for t in range(n_samples):
                total += (path[t, k] - center) ** 2
        sizes[i] = math.sqrt(total / n_samples)
        length = 0.0
        for t in range(n_samples - 1):
            square = 0.0
            for k in range(n_dims):
                square += (path[t + 1, k] - path[t, k]) ** 2
            steps[t] = math.sqrt(square)
            length += steps[t]
        bar, count = slow * (length / (n_samples - 1)), 0
        for t in range(n_samples - 1):
            count += steps[t] <= bar
        slowness[i] = count / (n_samples - 1)
