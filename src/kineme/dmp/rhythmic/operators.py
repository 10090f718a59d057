"""The matrices of a rhythmic specification, built once and cached.

On the limit cycle everything is periodic, so differentiation and the response of the spring-damper multiply the
harmonic ``e^(i h phi)`` by a number. Spectral derivatives of a Fourier series are exact, and the steady state needs no
integration: ``x_h = f_h / (K - omega^2 + i omega D)`` with ``omega = 2 pi h`` per period.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from kineme.dmp.discrete.fits import ridge_regression
from kineme.dmp.rhythmic.harmonics import Complex, as_real, waves
from kineme.dmp.rhythmic.specification import RhythmicSpecification
from kineme.validation import Array


@lru_cache(maxsize=32)
def encoder(dmp: RhythmicSpecification) -> Array:
    """From a cycle's Fourier coefficients `as_real`, (2 H + 1,), to its weights times amplitude: shape (2 H + 1, N)."""
    H = dmp.n_harmonics
    phases = even_phases(dmp.n_points)
    synthesis = waves(phases, H)
    synthesis[:, 0] = 0.0  # the baseline is not part of the shape
    if dmp.fit == "trajectory":
        return _frozen((trajectory_regression(dmp) @ synthesis).T)
    impedance = 1 / transfer(dmp, H)
    # Re(c z e^(i h phi)): cosine and sine columns mix as a complex product.
    cosine, sine = synthesis[:, 1 : H + 1], synthesis[:, H + 1 :]
    re, im = impedance[1:].real, impedance[1:].imag
    target = np.column_stack((np.zeros(len(phases)), cosine * re - sine * im, sine * re + cosine * im))
    return _frozen((ridge_regression(dmp.basis.design(phases), dmp.ridge_strength) @ target).T)


def trajectory_regression(dmp: RhythmicSpecification) -> Array:
    """Least squares of the path itself on the periodic response, (N, T).

    Minimizes ``mean (y - Phi W)^2 + ridge mean (diff^2 W / K)^2``; the second differences go around the circle.
    """
    phases = even_phases(dmp.n_points)
    response = limit_cycle(dmp)
    Phi = waves(phases, response.shape[1] - 1) @ as_real(response).T * dmp.K  # unit: W / K, comparable to y
    eye = np.eye(dmp.n_basis)
    curvature = np.roll(eye, 1, axis=1) - 2 * eye + np.roll(eye, -1, axis=1)
    penalty = dmp.ridge_strength / dmp.n_basis * curvature.T @ curvature
    gram = Phi.T @ Phi / len(phases) + penalty
    return np.asarray(np.linalg.solve(gram, Phi.T / len(phases)) * dmp.K)


def transfer(dmp: RhythmicSpecification, n_harmonics: int) -> Complex:
    """Response of x to a unit harmonic of the forcing, ``1 / (K - omega^2 + i omega D)``, shape (H + 1,)."""
    omega = 2 * np.pi * np.arange(n_harmonics + 1)
    return np.asarray(1 / (dmp.K - omega**2 + 1j * omega * dmp.D))


@lru_cache(maxsize=32)
def limit_cycle(dmp: RhythmicSpecification) -> Complex:
    """Fourier coefficients of the periodic response of x - b to each weight, shape (N, H + 1)."""
    spectrum = dmp.basis.spectrum()
    h = np.arange(len(spectrum))
    turned = spectrum * np.exp(-1j * dmp.basis.centers[:, None] * h)
    return _frozen(turned * transfer(dmp, len(spectrum) - 1))


@lru_cache(maxsize=32)
def forcing_matrix(dmp: RhythmicSpecification, n_samples: int) -> Array:
    """Psi (S, N): from weights to f at `n_samples` even phases from 0, the last one step before 2 pi."""
    return _frozen(dmp.basis.design(even_phases(n_samples)))


def even_phases(n_samples: int) -> Array:
    """Phases of one cycle; the first is not repeated as the last."""
    return np.asarray(2 * np.pi / n_samples * np.arange(n_samples))


def _frozen(matrix: np.ndarray) -> np.ndarray:
    matrix = np.ascontiguousarray(matrix)
    matrix.setflags(write=False)
    return matrix
