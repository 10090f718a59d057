"""Fold a recording of several periods into one cycle that starts at a defined phase."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.primitives.rhythmic.harmonics import Complex, fit_harmonics
from kineme.validation import Array

_RESOLVED = 0.45  # harmonics per sample of a period; one half would be the Nyquist limit


class Cycles(NamedTuple):
    """One cycle of each of n recordings."""

    coefficients: Complex  # (n, d, H + 1), Fourier series in the phase
    phases: Array  # (n,), where the recording started, in [0, 2 pi)
    aligned_on: NDArray[np.intp]  # (n,), dimension that set the phase
    explained: Array  # (n,), share of the recording's variance that its cycle explains


def fold(rows: Array, cycles: Array, lengths: NDArray[np.intp], most: int, dimension: int | None) -> Cycles:
    """Average over periods by the least-squares Fourier series, then set the phase.

    For a whole number of periods the series is the Fourier series of the average period. For a fractional number it
    still uses every sample, has no jump where the recording begins and ends, and its mean is that of whole periods.

    Parameters
    ----------
    rows : ndarray of shape (n, d, R)
        Even samples.
    cycles : ndarray of shape (n,)
        Periods per recording.
    lengths : ndarray of shape (n,)
        Recorded samples; no harmonic above the sampling of a period is used.
    most : int
        Largest number of harmonics H.
    dimension : int or None
        Dimension whose first harmonic defines the phase; None for the one with the largest.
    """
    n_harmonics = np.clip(_RESOLVED * (lengths - 1) / cycles, 1, most).astype(np.intp)
    mean = rows.mean(axis=2, keepdims=True)
    fit = fit_harmonics(rows - mean, cycles, n_harmonics)
    total = ((rows - mean) ** 2).sum(axis=(1, 2))
    explained = 1 - ((rows - mean - fit.fitted) ** 2).sum(axis=(1, 2)) / total
    missing = most + 1 - fit.coefficients.shape[2]
    coefficients = np.pad(fit.coefficients, ((0, 0), (0, 0), (0, missing)))
    coefficients[:, :, 0] += mean[:, :, 0]
    first = coefficients[:, :, 1]
    aligned_on = np.abs(first).argmax(axis=1) if dimension is None else np.full(len(rows), dimension)
    phases = start_phases(first[np.arange(len(rows)), aligned_on])
    turn = np.exp(-1j * phases[:, None] * np.arange(most + 1))
    return Cycles(coefficients * turn[:, None], phases, aligned_on, explained)


def start_phases(first: Complex) -> Array:
    """Phase of the first sample, from one first harmonic (n,): phase 0 is where it is largest.

    Unlike a principal axis, a maximum has a sign, so the phase is not ambiguous by half a turn. A dimension without a
    first harmonic defines no phase.
    """
    phases = np.angle(first) % (2 * np.pi)
    return np.where(phases == 2 * np.pi, 0.0, phases)  # the remainder of a tiny negative angle rounds up to 2 pi
