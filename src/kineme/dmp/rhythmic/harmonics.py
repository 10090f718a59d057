"""Fourier series of unknown or known period: fitted to even samples by least squares, and summed up again.

Everything works on blocks of movements. The complex exponentials of even samples have a Toeplitz Gram matrix, so a
fit costs two products with the exponentials and one small solve, for any number of periods, whole or not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.validation import Array

Complex = NDArray[np.complex128]

_JITTER = 1e-12  # of the Gram matrix's diagonal: keeps the system regular for a period with a gap; far below any noise


class HarmonicFit(NamedTuple):
    """Least-squares Fourier series of a block of recordings."""

    coefficients: Complex  # (n, d, H + 1): x = Re(c_0 + 2 sum_h c_h e^(i h theta))
    fitted: Array  # (n, d, R)


def fit_harmonics(rows: Array, cycles: Array, n_harmonics: NDArray[np.intp]) -> HarmonicFit:
    """Fit each recording by a Fourier series that runs through `cycles` periods from its first to its last sample.

    Parameters
    ----------
    rows : ndarray of shape (n, d, R)
        Even samples.
    cycles : ndarray of shape (n,)
        Periods per recording; any positive number.
    n_harmonics : ndarray of shape (n,)
        Highest harmonic of each; the coefficients above it are 0.
    """
    n_samples, top = rows.shape[2], int(n_harmonics.max())
    theta = (2 * np.pi / (n_samples - 1)) * cycles[:, None] * np.arange(n_samples)
    powers = np.empty((len(rows), n_samples, 2 * top + 1), dtype=complex)  # e^(i h theta), h = 0 ... 2 H
    powers[:, :, 0] = 1.0
    turn = np.exp(1j * theta)
    for h in range(2 * top):
        np.multiply(powers[:, :, h], turn, out=powers[:, :, h + 1])
    order = np.arange(-top, top + 1)
    lag = order[:, None] - order  # Gram[a, b] = sum_t e^(i (b - a) theta)
    moments = powers.sum(axis=1)
    gram = np.where(lag < 0, moments[:, -lag], moments[:, lag].conj())
    unused = np.abs(order) > n_harmonics[:, None]
    gram[unused[:, :, None] | unused[:, None, :]] = 0.0
    diagonal = np.arange(len(order))
    gram[:, diagonal, diagonal] = n_samples * (1.0 + _JITTER)
    half = np.ascontiguousarray(powers[:, :, : top + 1])
    moment = rows @ half.conj()  # (n, d, H + 1), sum_t x e^(-i h theta)
    moment[np.broadcast_to((np.arange(top + 1) > n_harmonics[:, None])[:, None], moment.shape)] = 0.0
    both = np.concatenate((moment[:, :, :0:-1].conj(), moment), axis=2)
    solved = np.asarray(np.linalg.solve(gram, both.transpose(0, 2, 1)), dtype=complex)
    coefficients = solved.transpose(0, 2, 1)[:, :, top:]
    coefficients[:, :, 0] = coefficients[:, :, 0].real
    doubled = coefficients * np.where(np.arange(top + 1) == 0, 1.0, 2.0)
    return HarmonicFit(coefficients, (doubled @ half.transpose(0, 2, 1)).real)


def as_real(coefficients: Complex) -> Array:
    """Coefficients (..., H + 1) as real numbers (..., 2 H + 1) for `waves`: c_0, then 2 Re c_h, then -2 Im c_h."""
    oscillating = 2 * coefficients[..., 1:]
    return np.concatenate((coefficients[..., :1].real, oscillating.real, -oscillating.imag), axis=-1)


def waves(phases: Array, n_harmonics: int) -> Array:
    """Constant, cosines and sines at phases (S,), shape (S, 2 H + 1): ``x = waves @ as_real(c)``."""
    angles = phases[:, None] * np.arange(1, n_harmonics + 1)
    return np.column_stack((np.ones(len(phases)), np.cos(angles), np.sin(angles)))
