"""Bouts: runs of samples in motion, found with hysteresis, and their typical duration."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kineme.validation import Array

Rows = NDArray[np.intp]


def moving_bouts(speed: Array, low: float, high: float) -> Rows:
    """Runs of samples faster than `low` that exceed `high` somewhere: rows (n, 2), first and one past the last."""
    edges = np.diff(np.concatenate(([False], speed > low, [False])).astype(np.int8))
    rows = np.column_stack((np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)))
    if not len(rows):
        return rows
    fastest = np.maximum.reduceat(np.append(speed, 0.0), rows.ravel())[::2]
    return rows[fastest > high]


def typical_duration(durations: Array) -> float:
    """The duration such that half of the moving time lies in bouts at least as long; twitches hardly change it."""
    ordered = np.sort(durations)
    return float(ordered[np.searchsorted(np.cumsum(ordered), 0.5 * ordered.sum())])


def merge_across(bouts: Rows, times: Array, gap: float) -> Rows:
    """Merge bouts that are at most `gap` seconds apart."""
    starts, ends = times[bouts[:, 0]], times[bouts[:, 1] - 1]
    apart = np.flatnonzero(starts[1:] - ends[:-1] > gap)
    return np.column_stack((bouts[np.append(0, apart + 1), 0], bouts[np.append(apart, len(bouts) - 1), 1]))


def durations_of(bouts: Rows, times: Array) -> Array:
    """Duration of each bout [s]."""
    return np.asarray(times[bouts[:, 1] - 1] - times[bouts[:, 0]])


def consecutive(inner_cuts: Rows, n_samples: int) -> Rows:
    """The pieces between cuts: rows (n, 2) that cover all samples."""
    edges = np.concatenate(([0], inner_cuts, [n_samples]))
    return np.column_stack((edges[:-1], edges[1:]))
