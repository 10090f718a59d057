"""Where exactly, between two cuts, a movement begins and ends."""

from __future__ import annotations

import numpy as np

from kineme.segmentation.bouts import Rows
from kineme.segmentation.motion import Motion
from kineme.validation import Array

_LEVEL = 0.05  # of the movement's own peak speed
_REACH = 0.1  # of the movement: the farthest that its onset is extrapolated


def onset_rows(motion: Motion, pieces: Rows) -> Rows:
    """Narrow pieces (n, 2) to their motion.

    A movement starts smoothly, so a threshold of speed sees it late: a minimum-jerk movement by 6 % of its duration at
    5 % of its peak speed. Speed grows at first about as the square of the time since the onset, so the onset lies as
    far before the first crossing of a level as that lies before the first crossing of four times the level. The
    extrapolation stops where the speed is noise, and the same holds for the end, backward in time.
    """
    begin = _crossings(motion.times, motion.speed, motion.noise, pieces)
    backward = len(motion.times) - pieces[:, ::-1]
    end = _crossings(-motion.times[::-1], motion.speed[::-1], motion.noise, backward[::-1])
    return np.column_stack((begin, len(motion.times) - end[::-1]))


def _crossings(t: Array, speed: Array, noise: float, pieces: Rows) -> Rows:
    """First row of the motion in each piece; pieces are increasing and disjoint."""
    piece_of = np.searchsorted(pieces[:, 0], np.arange(len(t)), side="right") - 1
    inside = (piece_of >= 0) & (np.arange(len(t)) < pieces[np.maximum(piece_of, 0), 1])
    peaks = np.maximum.reduceat(np.where(inside, speed, 0.0), pieces[:, 0])
    level = np.maximum(_LEVEL * peaks, 2.0 * noise)
    first = _first(inside & (speed >= level[piece_of]), pieces)
    higher = _first(inside & (speed >= np.minimum(4.0 * level, 0.9 * peaks)[piece_of]), pieces)
    reach = np.minimum(t[higher] - t[first], _REACH * (t[pieces[:, 1] - 1] - t[first]))
    onset = np.searchsorted(t, t[first] - reach, side="right") - 1
    row = np.arange(len(t))
    still = np.where(
        inside & (speed < np.maximum(1.5 * noise, 1e-3 * peaks[piece_of])) & (row < first[piece_of]), row, -1
    )
    return np.maximum(np.maximum(onset, np.maximum.reduceat(still, pieces[:, 0])), pieces[:, 0])


def _first(where: np.ndarray, pieces: Rows) -> Rows:
    """First row of each piece where the condition holds, else its first row."""
    found = np.minimum.reduceat(np.where(where, np.arange(len(where)), len(where)), pieces[:, 0])
    return np.asarray(np.where(found < pieces[:, 1], found, pieces[:, 0]))
