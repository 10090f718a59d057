"""The spring-damper that every primitive is: its parameters, and its free motion in closed form."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from kineme.validation import Array, check_choice, check_number

_DEFAULT_RIDGE = {"forcing": 1e-8, "trajectory": 1e-6}
FITS = tuple(_DEFAULT_RIDGE)

#: Nodes and weights of Gauss-Legendre quadrature on [0, 1]: with 8 of them the order is 16.
NODES, NODE_WEIGHTS = np.polynomial.legendre.leggauss(8)
NODES, NODE_WEIGHTS = 0.5 * (NODES + 1.0), 0.5 * NODE_WEIGHTS


class SpringDamper:
    """Base of specifications with the parameters `stiffness`, `damping`, `fit` and `ridge`."""

    stiffness: float
    damping: float | None
    fit: str
    ridge: float | None

    def _check_spring_damper(self) -> None:
        check_choice("fit", self.fit, FITS)
        check_number("stiffness", self.stiffness, above=0.0)
        check_number("damping", self.damping, above=0.0, optional=True)
        check_number("ridge", self.ridge, least=0.0, optional=True)

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


def transition(stiffness: float, damping: float, h: Any) -> tuple[Any, Any, Any, Any]:
    """Elements (row by row) of ``exp(A h)`` of ``A = [[0, 1], [-K, -D]]``, for a number or an array h.

    With a = D / 2 and ``b = sqrt(|K - a^2|)``, ``exp(A h) = [[C + a S, S], [-K S, C - a S]]``, where C and S are
    ``exp(-a h)`` times cos(b h) and sin(b h) / b below critical damping, 1 and h at it, cosh(b h) and sinh(b h) / b
    above. The hyperbolic functions are multiplied out: alone they overflow. The slow pole is ``K / (a + b)``, since
    a - b cancels. Compiled code calls the same function with numbers.
    """
    a = 0.5 * damping
    square = stiffness - a * a
    b = math.sqrt(abs(square))
    if b == 0.0:
        C = np.exp(-a * h)
        S = C * h
    elif square > 0:
        decay = np.exp(-a * h)
        C, S = decay * np.cos(b * h), decay * np.sin(b * h) / b
    else:
        slow, ratio = np.exp(-stiffness / (a + b) * h), np.exp(-2.0 * b * h)
        C, S = 0.5 * slow * (1.0 + ratio), -0.5 * slow * np.expm1(-2.0 * b * h) / b
    return C + a * S, S, -stiffness * S, C - a * S


def transitions(stiffness: float, damping: float, h: Array) -> Array:
    """`transition` as matrices: for steps h (m,), shape (m, 2, 2)."""
    return np.stack(transition(stiffness, damping, h), axis=1).reshape(-1, 2, 2)
