"""The formulations: what the forcing term is multiplied by, and how the goal enters besides the spring.

In normalized time u = t / tau every formulation is one linear spring-damper,

    x'' = K (g - x) - D x' + scale f(s) + coupling(s) (g - x0),        ' = d/du,

and differs in two places only. Encoding, decoding and features are written once for all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kineme.validation import Array


@dataclass(frozen=True)
class Formulation:
    """One row of `FORMULATIONS`.

    Attributes
    ----------
    equation : str
        The transformation system as the paper prints it.
    scales_with_amplitude : bool
        Whether scale is ``g - x0`` (then weights and f do not exist where it is 0) or the stiffness K.
    coupling : callable
        ``coupling(K, s)``: the factor of ``g - x0`` in the equation and, the same function, of
        ``x - x0`` in the shape-attractor term.
    """

    name: str
    equation: str
    scales_with_amplitude: bool
    coupling: Callable[[float, Array], Array]

    def scale(self, stiffness: float, amplitude: Array) -> Array:
        """The factor of f in the equation, for amplitudes g - x0 of any shape."""
        return amplitude if self.scales_with_amplitude else np.full_like(amplitude, stiffness)


FORMULATIONS = {
    row.name: row
    for row in (
        Formulation(
            name="original",
            equation="tau v' = K (g - x) + (g - x0) f(s) - D v  (Eq. 1)",
            scales_with_amplitude=True,
            coupling=lambda K, s: np.zeros_like(s),
        ),
        # Eq. (4) multiplied out: s K (f/s + x0 - x) + (1 - s) K (g - x) = K (g - x) + K f - K s (g - x0).
        Formulation(
            name="bio-inspired",
            equation="tau v' = s K (f(s)/s + x0 - x) + (1 - s) K (g - x) - D v  (Eq. 4)",
            scales_with_amplitude=False,
            coupling=lambda K, s: -K * s,
        ),
    )
}
