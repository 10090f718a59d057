"""Parameters of a discrete DMP, checked: the canonical system, basis functions over its phase, spring and fit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from kineme.dmp.discrete.formulations import FORMULATIONS, Formulation
from kineme.dmp.spring_damper import SpringDamper
from kineme.errors import SpecificationError
from kineme.movements.preparation.trim import check_steps
from kineme.validation import Array, check_choice, check_count, check_number

FITS = ("forcing", "trajectory")
REGRESSIONS = ("local", "ridge")
GATINGS = ("none", "phase")
MOST_BASIS = 2_000  # the response to N functions takes 32 N^2 numbers
# Beyond these limits the centers c_i, or squares of their distances, are equal after rounding.
_SMALLEST, _LARGEST = 1e-100, 0.999

MOST_POINTS = 10_000  # a fit with T points needs matrices of T^2 numbers


@dataclass(frozen=True)
class Specification(SpringDamper):
    """Parameters of a `DMP`, which explains them."""

    formulation: str = "bio-inspired"
    n_basis: int = 40
    stiffness: float = 100.0
    damping: float | None = None
    gating: str = "none"
    fit: str = "trajectory"
    regression: str = "local"
    ridge: float | None = None
    phase_end: float = 0.01
    overlap: float = 0.3
    n_points: int = 200
    preprocessing: tuple[Any, ...] = ()

    def __post_init__(self) -> None:
        check_choice("formulation", self.formulation, list(FORMULATIONS))
        check_choice("fit", self.fit, FITS)
        check_choice("regression", self.regression, REGRESSIONS)
        self._check_spring_damper()
        check_count("n_points", self.n_points, 10, most=MOST_POINTS)
        if self.fit == "trajectory":
            check_count("n_basis", self.n_basis, 3)
        object.__setattr__(self, "preprocessing", check_steps(self.preprocessing))
        _ = self.basis  # checks its own parameters

    @property
    def basis(self) -> GaussianBasis:
        """Basis functions over the shared canonical system."""
        return GaussianBasis(self.n_basis, self.overlap, self.gating, ExponentialPhase(self.phase_end))

    def terms(self, u: Array) -> Array:
        """Return basis functions and coupling at normalized times u (T,), shape (T, N + 1)."""
        return np.column_stack((self.basis.design(u), self.system.coupling(self.K, self.basis.phase(u))))

    @property
    def system(self) -> Formulation:
        """The formulation's row in the table."""
        return FORMULATIONS[self.formulation]


@dataclass(frozen=True)
class ExponentialPhase:
    """Exponential decay ``tau ds/dt = -alpha s``, so ``s(u) = exp(-alpha u)`` with ``u = t / tau`` (Section 2.1)."""

    end: float = 0.01  # the phase at the end of the movement, s(tau), between 0 and 1; ``alpha = -ln(end)``

    def __post_init__(self) -> None:
        check_number("phase_end", self.end, above=0.0, smallest=0.0)
        if not _SMALLEST <= self.end <= _LARGEST:
            raise SpecificationError(
                f"expected phase_end to be between {_SMALLEST:g} and {_LARGEST:g}, got {self.end!r}"
            )

    @property
    def alpha(self) -> float:
        """Rate of decay."""
        return -math.log(self.end)

    def __call__(self, u: Array) -> Array:
        """Phase at normalized times `u` = t / tau."""
        return np.exp(-self.alpha * u)


@dataclass(frozen=True)
class GaussianBasis:
    """Basis functions ``psi_i(s) = exp(-h_i (s - c_i)^2)``, Eq. (3), with centers equally spaced in time.

    Parameters
    ----------
    n_basis : int
        Number N of basis functions.
    overlap : float
        Value of each function at the next center, between 0 and 1. It sets the widths:
        ``h_i = -ln(overlap) / (c_{i+1} - c_i)^2``.
    gating : {"none", "phase"}
        Whether f carries the factor s: ``f = sum psi w / sum psi`` (Eq. 2) or that times s. Papers mix
        the two and call both f.
    phase : ExponentialPhase
        Maps time to s.
    """

    n_basis: int
    overlap: float
    gating: str
    phase: ExponentialPhase

    def __post_init__(self) -> None:
        check_count("n_basis", self.n_basis, 2, most=MOST_BASIS)
        check_number("overlap", self.overlap, above=0.0)
        if self.overlap >= 1:
            raise SpecificationError(f"expected overlap to be below 1, got {self.overlap!r}")
        check_choice("gating", self.gating, GATINGS)

    @property
    def centers(self) -> Array:
        """Centers c_i, shape (N,), from 1 down to the phase's end."""
        return self.phase(np.linspace(0.0, 1.0, self.n_basis))

    @property
    def widths(self) -> Array:
        """Factors h_i, shape (N,)."""
        gaps = -np.diff(self.centers)
        return -math.log(self.overlap) / np.append(gaps, gaps[-1]) ** 2

    def activations(self, u: Array) -> Array:
        """Eq. (3) at normalized times u (T,), shape (T, N), up to a common factor per row.

        The factor makes the largest activation of a row 1, so that far beyond the last center, where
        every Gaussian underflows, Eq. (2) does not become 0/0.
        """
        exponents = self.exponents(u)
        return np.exp(exponents - exponents.max(axis=1, keepdims=True))

    def exponents(self, u: Array) -> Array:
        """Logarithms of Eq. (3) at normalized times u (T,), shape (T, N)."""
        return -self.widths * (self.phase(u)[:, None] - self.centers) ** 2

    def design(self, u: Array) -> Array:
        """Matrix (T, N) that maps weights w to f, Eq. (2), times s if gated."""
        psi = self.activations(u)
        normalized = psi / psi.sum(axis=1, keepdims=True)
        return normalized * self.gate(u)[:, None]

    def gate(self, u: Array) -> Array:
        """The factor that f carries besides the basis, shape (T,): s if gated, else 1.

        Eq. (2) leaves f for u > 1 open, past the end of the demonstration; there the last weight would keep the
        movement away from its goal forever. So past the end an ungated f decays with the phase, as ``s / s(tau)``.
        """
        s = self.phase(u)
        return s if self.gating == "phase" else np.minimum(1.0, s / self.phase.end)
