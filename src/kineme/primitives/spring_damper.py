"""Base class of the specifications: spring, damper, and ridge penalty of the fit."""

from __future__ import annotations

import math

from kineme.validation import check_number

_DEFAULT_RIDGE = {"forcing": 1e-8, "trajectory": 1e-6}


class SpringDamper:
    """Base of specifications with the parameters `stiffness`, `damping`, `fit` and `ridge`."""

    stiffness: float
    damping: float | None
    fit: str
    ridge: float | None

    def _check_spring_damper(self) -> None:
        check_number("stiffness", self.stiffness, above=0.0)
        if self.damping is not None:
            check_number("damping", self.damping, above=0.0)
        if self.ridge is not None:
            check_number("ridge", self.ridge, least=0.0)

    @property
    def K(self) -> float:
        """Stiffness."""
        return float(self.stiffness)

    @property
    def D(self) -> float:
        """Damping."""
        return 2.0 * math.sqrt(self.stiffness) if self.damping is None else float(self.damping)

    @property
    def ridge_strength(self) -> float:
        """The ridge penalty in force."""
        return _DEFAULT_RIDGE[self.fit] if self.ridge is None else float(self.ridge)
