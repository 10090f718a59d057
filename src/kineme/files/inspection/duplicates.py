"""Duplicate movements: all recorded columns equal sample by sample, whatever time they start at."""

from __future__ import annotations

import numpy as np

from kineme.movements.trajectories.demonstrations import Demonstrations

_STAMP = 1e-6  # times since the start are equal if they differ by less than this share of the duration


def duplicates_among(demonstrations: Demonstrations) -> list[list[int]]:
    """Groups of indices of equal movements, each group in order.

    Candidates have equal lengths, ends and sums, computed for all movements at once; they are compared by sample.
    """
    x, offsets = demonstrations.positions, demonstrations.offsets
    key = np.column_stack(
        (demonstrations.lengths, x[offsets[:-1]], x[offsets[1:] - 1], np.add.reduceat(x, offsets[:-1], axis=0))
    )
    _, group, size = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    group = group.ravel()
    candidates = np.flatnonzero(size[group] > 1)
    candidates = candidates[np.argsort(group[candidates], kind="stable")]
    groups = []
    for alike in np.split(candidates, np.flatnonzero(np.diff(group[candidates])) + 1):
        groups += _equal(demonstrations, alike.tolist())
    return sorted(groups)


def _equal(demonstrations: Demonstrations, alike: list[int]) -> list[list[int]]:
    groups: list[list[int]] = []
    for i in alike:
        same = next((group for group in groups if _are_equal(demonstrations, group[0], i)), None)
        if same is None:
            groups.append([i])
        else:
            same.append(i)
    return [group for group in groups if len(group) > 1]


def _are_equal(demonstrations: Demonstrations, i: int, k: int) -> bool:
    one, other = demonstrations[i], demonstrations[k]
    since = np.abs((one.times - one.times[0]) - (other.times - other.times[0])).max()
    return np.array_equal(one.recorded, other.recorded) and bool(since <= _STAMP * one.duration)
