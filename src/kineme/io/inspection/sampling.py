"""Sampling rates, jitter and gaps of movements, for all of them at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.validation import Array

GAP = 3.0  # steps longer than this many median steps are gaps: at least two samples are missing


class Sampling(NamedTuple):
    """One row per movement; arrays of shape (n,).

    Attributes
    ----------
    rates : ndarray
        One over the median step between samples [Hz].
    jitters : ndarray
        Root mean square deviation of the steps from the median step, as a share of it; gaps are not counted.
    gaps : ndarray
        Number of steps longer than `GAP` median steps.
    longest : ndarray
        The longest step [s].
    """

    rates: Array
    jitters: Array
    gaps: NDArray[np.intp]
    longest: Array


def sampling_of(demonstrations: Demonstrations) -> Sampling:
    """Rates, jitters and gaps of every movement."""
    offsets, lengths = demonstrations.offsets, demonstrations.lengths - 1
    inner = np.ones(len(demonstrations.times) - 1, dtype=bool)
    inner[offsets[1:-1] - 1] = False  # from one movement to the next
    steps = np.diff(demonstrations.times)[inner]
    starts = np.concatenate(([0], np.cumsum(lengths)[:-1]))
    owner = np.repeat(np.arange(len(lengths)), lengths)
    ordered = steps[np.lexsort((steps, owner))]
    median = 0.5 * (ordered[starts + (lengths - 1) // 2] + ordered[starts + lengths // 2])
    relative = steps / median[owner]
    gaps = relative > GAP
    deviation = np.where(gaps, 0.0, relative - 1.0) ** 2
    n_gaps = np.add.reduceat(gaps.astype(np.intp), starts)
    jitters = np.sqrt(np.add.reduceat(deviation, starts) / np.maximum(lengths - n_gaps, 1))
    return Sampling(1.0 / median, jitters, n_gaps, ordered[starts + lengths - 1])
