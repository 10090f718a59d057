"""The canonical system: the phase s, which decays from 1 to almost 0 and replaces time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kineme.errors import SpecificationError
from kineme.validation import Array, check_number

# Beyond these limits the centers c_i, or squares of their distances, are equal after rounding.
_SMALLEST, _LARGEST = 1e-100, 0.999


@dataclass(frozen=True)
class ExponentialPhase:
    """Exponential decay ``tau ds/dt = -alpha s``, so ``s(u) = exp(-alpha u)`` with ``u = t / tau`` (Section 2.1).

    Parameters
    ----------
    end : float, default 0.01
        The phase at the end of the movement, s(tau), between 0 and 1; ``alpha = -ln(end)``.
    """

    end: float = 0.01

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
