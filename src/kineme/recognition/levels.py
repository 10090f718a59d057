"""Levels of a gripper as evidence beside the path: what an arm holds tells a reach from a carry of the same path.

Where a movement lies is no part of the comparison of paths, so that the same movement elsewhere is the same. Of the
opening of a gripper it is: open, closed around something, opening and closing are different things to do.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from kineme.movements.channels.channel import Channels
from kineme.movements.segmentation.table import Motion, Rows, observe
from kineme.movements.segmentation.work import ROLES
from kineme.movements.tables.time_stamps import words_of
from kineme.similarity.comparison import References
from kineme.validation import Array

_SPREAD = 0.35  # distance of levels, in the range of all demonstrations, that counts as much as a typical distance
_ENDS = 0.125  # share of a movement at each end whose mean is a level; the third is that of the middle half
_LEAST = 0.2  # of the largest range of a gripper: one that moves less does nothing


class Levels(NamedTuple):
    """Levels of the demonstrations of C classes."""

    columns: tuple[int, ...]  # of grippers, among the coordinates and, behind these, the discrete columns
    ranges: Array  # (k,), of these in all demonstrations
    levels: Array  # (m, 3 k), of each demonstration, in these ranges
    first: Rows  # (C,), index of the first demonstration of each class


def gripper_levels(
    references: References, channels: Channels | None, resolution: float, steps: bool = True
) -> Levels | None:
    """Return the levels of the grippers of demonstrations; None if none moves, or no channel is called one.

    Without `steps`, those of discrete columns are no evidence.
    """
    moving = [channel.name for channel in channels or () for _ in channel.coordinates]
    discrete = [channel.name for channel in channels or () if channel.kind == "discrete"] if steps else []
    columns = [k for k, name in enumerate((*moving, *discrete)) if ROLES["gripper"] & {*words_of(name)}]
    if not columns:
        return None
    motions = [observe(movement, resolution) for movement in references.all_movements()]
    if any(motion.steps.shape[1] < len(discrete) for motion in motions):  # generated ones have none
        return gripper_levels(references, channels, resolution, steps=False)
    spans = np.ptp(np.concatenate([openings(motion, columns) for motion in motions]), axis=0)
    moves = spans > _LEAST * spans.max()
    columns, spans = np.array(columns)[moves].tolist(), spans[moves]
    if not columns:
        return None
    every = [_levels(motion, np.array([[0, len(motion.times) - 1]]), columns) for motion in motions]
    return Levels(tuple(columns), spans, np.concatenate(every) / np.tile(spans, 3), references.first)


def openings(motion: Motion, columns: tuple[int, ...] | list[int], lasting: float = 0.0) -> Array:
    """Return columns (T, k) of grippers, as `Levels.columns` counts them; steps by a Gaussian `lasting` so long [s]."""
    steps, rate = motion.steps, (len(motion.times) - 1) / (motion.times[-1] - motion.times[0])
    steps = gaussian_filter1d(steps, lasting * rate, axis=0, mode="nearest") if lasting else steps
    return np.concatenate((motion.positions, steps), axis=1)[:, columns]


def level_scores(references: Levels, motion: Motion, rows: Rows) -> Array:
    """Return distances (n, C) of the levels of windows rows[:, 0] to rows[:, 1] to the nearest ones of each class.

    As parts of a nonconformity ``sqrt(a^2 + b^2)``: a by the path, b by the levels.
    """
    levels, others = _levels(motion, rows, references.columns) / np.tile(references.ranges, 3), references.levels
    squares = (levels**2).sum(axis=1)[:, None] + (others**2).sum(axis=1) - 2.0 * levels @ others.T
    nearest = np.minimum.reduceat(np.maximum(squares, 0.0), references.first, axis=1)
    return np.asarray(np.sqrt(nearest) / _SPREAD)


def _levels(motion: Motion, rows: Rows, columns: tuple[int, ...] | list[int]) -> Array:
    """Return means at the start, in the middle and at the end of windows, (n, 3 k)."""
    sums = np.zeros((len(motion.times) + 1, len(columns)))
    np.cumsum(openings(motion, columns), axis=0, out=sums[1:])
    first, n = rows[:, 0], rows[:, 1] - rows[:, 0] + 1
    ends = np.maximum((_ENDS * n).astype(np.intp), 1)
    quarter = n // 4
    stop = first + n

    def mean(start: Rows, until: Rows) -> Array:
        return np.asarray((sums[until] - sums[start]) / (until - start)[:, None])

    middle = mean(first + quarter, np.maximum(stop - quarter, first + quarter + 1))
    return np.concatenate((mean(first, first + ends), middle, mean(stop - ends, stop)), axis=1)
