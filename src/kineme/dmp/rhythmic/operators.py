"""The matrices of a rhythmic specification, built once and cached.

On the limit cycle differentiation and the response of the spring-damper multiply the harmonic ``e^(i h phi)`` by a
number, so both are exact: ``x_h = f_h / (K - omega^2 + i omega D)`` with ``omega = 2 pi h`` per period.

Fourier series are fitted to even samples by least squares: complex exponentials have a Toeplitz Gram matrix, so a fit
costs two products with them and one small solve, for any number of periods.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.dmp.discrete.operators import ridge_regression
from kineme.dmp.discrete.specification import MOST_BASIS, MOST_POINTS
from kineme.dmp.spring_damper import SpringDamper
from kineme.movements.preparation.trim import check_steps
from kineme.validation import Array, check_choice, check_count, check_number

_PER_GAP = 128  # samples between two centers; resolves overlaps down to 1e-6
_NEGLIGIBLE = 1e-15  # of the largest harmonic

APERIODIC = ("raise", "accept")

Complex = NDArray[np.complex128]

_JITTER = 1e-12  # of the Gram matrix's diagonal: keeps the system regular for a period with a gap; far below any noise


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
    """Least squares of the path (N, T): ``mean (y - Phi W)^2 + ridge mean (diff^2 W / K)^2``, around the circle."""
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


class HarmonicFit(NamedTuple):
    """Least-squares Fourier series of a block of recordings."""

    coefficients: Complex  # (n, d, H + 1): x = Re(c_0 + 2 sum_h c_h e^(i h theta))
    fitted: Array  # (n, d, R)


def fit_harmonics(rows: Array, cycles: Array, n_harmonics: NDArray[np.intp]) -> HarmonicFit:
    """Fit samples (n, d, R) by Fourier series of `n_harmonics` (n,) through `cycles` (n,) periods, whole or not."""
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


@dataclass(frozen=True)
class RhythmicSpecification(SpringDamper):
    """Parameters of a `RhythmicDMP`, which explains them."""

    n_basis: int = 25
    stiffness: float = 100.0
    damping: float | None = None
    fit: str = "trajectory"
    ridge: float | None = None
    n_points: int = 200
    overlap: float = 0.5
    period: float | None = None
    align_on: int | None = None
    aperiodic: str = "raise"
    preprocessing: tuple[Any, ...] = ()

    def __post_init__(self) -> None:
        check_choice("aperiodic", self.aperiodic, APERIODIC)
        self._check_spring_damper()
        check_number("period", self.period, above=0.0, optional=True)
        if self.align_on is not None:
            check_count("align_on", self.align_on, 0)
        _ = self.basis  # checks its own parameters
        check_count("n_points", self.n_points, 2 * self.n_basis, most=MOST_POINTS)
        object.__setattr__(self, "preprocessing", check_steps(self.preprocessing))

    @property
    def basis(self) -> VonMisesBasis:
        """Basis functions over the phase."""
        return VonMisesBasis(self.n_basis, self.overlap)

    def terms(self, u: Array) -> Array:
        """Return basis functions and coupling, which a rhythm has not, at times u (T,) in periods, shape (T, N + 1)."""
        return np.column_stack((self.basis.design(2 * np.pi * u), np.zeros(len(u))))

    @property
    def n_harmonics(self) -> int:
        """Number of harmonics of the folded cycle: twice as many as the basis functions can represent."""
        return min(self.n_basis, (self.n_points - 1) // 2)


@dataclass(frozen=True)
class VonMisesBasis:
    """Basis functions ``psi_i(phi) = exp(h (cos(phi - c_i) - 1))`` with N centers equally spaced on the circle.

    A. J. Ijspeert, J. Nakanishi, H. Hoffmann, P. Pastor, S. Schaal, "Dynamical Movement Primitives: Learning Attractor
    Models for Motor Behaviors", Neural Computation 25(2), 2013: Table 1 and Eq. (2.6).
    """

    n_basis: int  # number N of basis functions, at least 3
    overlap: float

    def __post_init__(self) -> None:
        check_count("n_basis", self.n_basis, 3, most=MOST_BASIS)
        check_number("overlap", self.overlap, above=0.0, below=1.0)

    @property
    def centers(self) -> Array:
        """Centers c_i, shape (N,) [rad]."""
        return np.asarray(2 * np.pi / self.n_basis * np.arange(self.n_basis))

    @property
    def width(self) -> float:
        """The factor h, one for all by symmetry."""
        return -math.log(self.overlap) / (1 - math.cos(2 * math.pi / self.n_basis))

    def activations(self, phases: Array) -> Array:
        """The psi_i at phases (...,) [rad], shape (..., N)."""
        return np.exp(self.width * (np.cos(phases[..., None] - self.centers) - 1))

    def design(self, phases: Array) -> Array:
        """Maps weights w to ``f = sum psi w / sum psi`` at phases (...,), shape (..., N)."""
        psi = self.activations(phases)
        return np.asarray(psi / psi.sum(axis=-1, keepdims=True))

    def spectrum(self) -> Array:
        """Real Fourier coefficients (H + 1,) of the column of `design` centered at 0; the others are shifted."""
        n_samples = _PER_GAP * self.n_basis
        phases = 2 * np.pi / n_samples * np.arange(n_samples)
        psi = np.exp(self.width * (np.cos(phases) - 1))
        total = psi.reshape(self.n_basis, -1).sum(axis=0)  # the sum over all centers repeats from gap to gap
        harmonics = np.fft.rfft(psi / np.tile(total, self.n_basis)).real / n_samples
        last = np.flatnonzero(np.abs(harmonics) > _NEGLIGIBLE * harmonics[0])[-1]
        return np.asarray(harmonics[: last + 1])
