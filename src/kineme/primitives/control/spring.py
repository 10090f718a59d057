"""The spring-damper in closed form: carry a state over any step without error."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from kineme.validation import Array

NODES, NODE_WEIGHTS = np.polynomial.legendre.leggauss(8)
NODES, NODE_WEIGHTS = 0.5 * (NODES + 1.0), 0.5 * NODE_WEIGHTS  # on [0, 1]


def transition(stiffness: float, damping: float, h: float) -> tuple[float, float, float, float]:
    """Elements (row by row) of ``exp(A h)`` of ``A = [[0, 1], [-K, -D]]``.

    With a = D / 2 and ``b = sqrt(|K - a^2|)``, ``exp(A h) = [[C + a S, S], [-K S, C - a S]]``, where C and S are
    ``exp(-a h)`` times cos(b h) and sin(b h) / b below critical damping, 1 and h at it, cosh(b h) and sinh(b h) / b
    above. The hyperbolic functions are multiplied out: alone they overflow. The slow pole is ``K / (a + b)``, since
    a - b cancels.
    """
    a = 0.5 * damping
    square = stiffness - a * a
    b = math.sqrt(abs(square))
    if b * h < 1e-8:  # critical: the next term of the series is below rounding
        C = math.exp(-a * h)
        S = C * h
    elif square > 0:
        decay = math.exp(-a * h)
        C, S = decay * math.cos(b * h), decay * math.sin(b * h) / b
    else:
        slow, ratio = math.exp(-stiffness / (a + b) * h), math.exp(-2.0 * b * h)
        C, S = 0.5 * slow * (1.0 + ratio), -0.5 * slow * math.expm1(-2.0 * b * h) / b
    return C + a * S, S, -stiffness * S, C - a * S


@lru_cache(maxsize=64)
def step_matrices(stiffness: float, damping: float, h: float) -> tuple[Array, Array]:
    """What carries a state over h (2, 2), and what an acceleration at each quadrature node adds to it (8, 2)."""
    carry = np.array(transition(stiffness, damping, h)).reshape(2, 2)
    ends = [transition(stiffness, damping, h * (1.0 - node)) for node in NODES]
    impulse = np.array([(end[1], end[3]) for end in ends]) * (h * NODE_WEIGHTS)[:, None]
    return carry, impulse
