"""Parameters of a rhythmic DMP, checked; `RhythmicDMP` adds learning."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from kineme.dmp.discrete.specification import FITS, MOST_BASIS, MOST_POINTS
from kineme.dmp.spring_damper import SpringDamper
from kineme.errors import SpecificationError
from kineme.movements.preparation.trim import check_steps
from kineme.validation import Array, check_choice, check_count, check_number

_PER_GAP = 128  # samples between two centers; resolves overlaps down to 1e-6
_NEGLIGIBLE = 1e-15  # of the largest harmonic

APERIODIC = ("raise", "accept")


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
        check_choice("fit", self.fit, FITS)
        check_choice("aperiodic", self.aperiodic, APERIODIC)
        self._check_spring_damper()
        if self.period is not None:
            check_number("period", self.period, above=0.0)
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

    Parameters
    ----------
    n_basis : int
        Number N of basis functions, at least 3.
    overlap : float
        Value of each function at the next center, between 0 and 1. It sets the width of all of them:
        ``h = -ln(overlap) / (1 - cos(2 pi / N))``.

    References
    ----------
    A. J. Ijspeert, J. Nakanishi, H. Hoffmann, P. Pastor, S. Schaal, "Dynamical Movement Primitives: Learning Attractor
    Models for Motor Behaviors", Neural Computation 25(2), 2013: Table 1 and the rhythmic forcing term, Eq. (2.6).
    """

    n_basis: int
    overlap: float

    def __post_init__(self) -> None:
        check_count("n_basis", self.n_basis, 3, most=MOST_BASIS)
        check_number("overlap", self.overlap, above=0.0)
        if self.overlap >= 1:
            raise SpecificationError(f"expected overlap to be below 1, got {self.overlap!r}")

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
        """Fourier coefficients F of one column of `design`, the one centered at 0: ``sum_h F_h e^(i h phi)``.

        Real, because the function is even; shape (H + 1,), h = 0 ... H. The other columns are this one shifted by
        their center: ``F_h e^(-i h c_i)``. The function is analytic, so the coefficients decay exponentially, and those
        below the rounding error are left out.
        """
        n_samples = _PER_GAP * self.n_basis
        phases = 2 * np.pi / n_samples * np.arange(n_samples)
        psi = np.exp(self.width * (np.cos(phases) - 1))
        total = psi.reshape(self.n_basis, -1).sum(axis=0)  # the sum over all centers repeats from gap to gap
        harmonics = np.fft.rfft(psi / np.tile(total, self.n_basis)).real / n_samples
        last = np.flatnonzero(np.abs(harmonics) > _NEGLIGIBLE * harmonics[0])[-1]
        return np.asarray(harmonics[: last + 1])
