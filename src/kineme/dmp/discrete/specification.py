"""Parameters of a discrete DMP, checked; `DMP` adds learning."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from kineme.dmp.discrete.basis import ExponentialPhase, GaussianBasis
from kineme.dmp.discrete.fits import FITS, REGRESSIONS
from kineme.dmp.discrete.formulations import FORMULATIONS, Formulation
from kineme.dmp.spring_damper import SpringDamper
from kineme.movements.preparation.preprocess import check_steps
from kineme.validation import check_choice, check_count

MOST_POINTS = 10_000  # a fit with T points needs matrices of T^2 numbers


@dataclass(frozen=True)
class Specification(SpringDamper):
    """What `DMP` is made of; its parameters are explained there."""

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

    @property
    def system(self) -> Formulation:
        """The formulation's row in the table."""
        return FORMULATIONS[self.formulation]
