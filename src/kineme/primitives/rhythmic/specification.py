"""Parameters of a rhythmic DMP, checked; `RhythmicDMP` adds learning."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from kineme.movements.preparation.preprocess import check_steps
from kineme.primitives.discrete.fits import FITS
from kineme.primitives.discrete.specification import MOST_POINTS
from kineme.primitives.rhythmic.basis import VonMisesBasis
from kineme.primitives.spring_damper import SpringDamper
from kineme.validation import check_choice, check_count, check_number

APERIODIC = ("raise", "accept")


@dataclass(frozen=True)
class RhythmicSpecification(SpringDamper):
    """What `RhythmicDMP` is made of; its parameters are explained there."""

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

    @property
    def n_harmonics(self) -> int:
        """Number of harmonics of the folded cycle: twice as many as the basis functions can represent."""
        return min(self.n_basis, (self.n_points - 1) // 2)
