"""Onset and end of a movement within its piece."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kineme.movements.segmentation.bouts import Rows
from kineme.movements.segmentation.motion import Motion
from kineme.validation import Array

_LEVEL = 0.05  # threshold, as a share of the movement's own peak speed
_STILL = 1e-3  # of the same: speed at rest in a recording without noise
_BLUR = 0.25  # time that smoothing moves a crossing outward, in cycles at the cutoff
_REACH = 0.1  # longest extrapolation of an onset, as a share of the movement


def onset_rows(motion: Motion, pieces: Rows) -> Rows:
    """Narrow pieces (n, 2) to their motion.

    A movement starts smoothly, so a threshold on the speed detects it late: a minimum-jerk movement reaches 5 % of its
    peak speed after 6 % of its duration. Speed at first grows about as the square of the time since the onset, so the
    onset is extrapolated: it lies as far before the crossing of a level as that lies before the crossing of four times
    the level, but not within rest. Smoothing moves the crossings outward: with cutoff c, the extrapolated onset of a
    minimum-jerk movement by 0.1 / c, that of a movement at full speed from the start by 0.4 / c. The mean of the two,
    0.25 / c, is subtracted. The end is found in the same way, backward in time.
    """
    if not len(pieces):  # np.maximum.reduceat needs a piece
        return pieces
    begin = _crossings(motion, motion.times, motion.speed, pieces)
    backward = len(motion.times) - pieces[:, ::-1]
    end = _crossings(motion, -motion.times[::-1], motion.speed[::-1], backward[::-1])
    return np.column_stack((begin, len(motion.times) - end[::-1]))


def _crossings(motion: Motion, t: Array, speed: Array, pieces: Rows) -> Rows:
    """First row of the motion in each piece; pieces are increasing and disjoint; t and speed may be reversed."""
    piece_of = np.searchsorted(pieces[:, 0], np.arange(len(t)), side="right") - 1
    inside = (piece_of >= 0) & (np.arange(len(t)) < pieces[np.maximum(piece_of, 0), 1])
    peaks = np.maximum.reduceat(np.where(inside, speed, 0.0), pieces[:, 0])
    level = np.maximum(_LEVEL * peaks, 2.0 * motion.noise)
    row = np.arange(len(t))
    higher = _first(inside & (speed >= np.minimum(4.0 * level, 0.9 * peaks)[piece_of]), pieces)
    before = inside & (row < higher[piece_of])
    first = _last(before & (speed < level[piece_of]), pieces) + 1  # earlier crossings may be noise at rest
    reach = np.minimum(t[higher] - t[first], _REACH * (t[pieces[:, 1] - 1] - t[first]))
    onset = np.searchsorted(t, t[first] - reach + _BLUR / motion.cutoff, side="right") - 1
    still = _last(before & (speed < _STILL * peaks[piece_of]), pieces)
    return np.clip(np.maximum(onset, still), pieces[:, 0], higher)


def _last(where: NDArray[np.bool_], pieces: Rows) -> Rows:
    """Last row of each piece where the condition holds, else the row before it."""
    rows = np.maximum.reduceat(np.where(where, np.arange(len(where)), -1), pieces[:, 0])
    return np.maximum(rows, pieces[:, 0] - 1)


def _first(where: NDArray[np.bool_], pieces: Rows) -> Rows:
    """First row of each piece where the condition holds, else its first row."""
    rows = np.minimum.reduceat(np.where(where, np.arange(len(where)), len(where)), pieces[:, 0])
    return np.asarray(np.where(rows < pieces[:, 1], rows, pieces[:, 0]))
