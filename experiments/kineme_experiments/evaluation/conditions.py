"""The conditions of the trials: how movements are perturbed, and how strongly."""

from __future__ import annotations

import math
from typing import NamedTuple

from kineme.movements.preparation.perturbations import Perturbation


class Condition(NamedTuple):
    """One column of a table and one point of a plot.

    Attributes
    ----------
    varied : str
        Name of what varies; one panel of the plot each.
    strength : float
        How strongly it varies.
    label : str
        Both as text.
    """

    varied: str
    strength: float
    label: str


UNTOUCHED = Condition("none", 0, "as recorded")

#: Name of the perturbation -> strengths.
STRENGTHS: dict[str, tuple[float, float, float]] = {
    "shift": (0.5, 1.0, 2.0),  # extents
    "scale": (0.5, 1.0, 1.5),  # doublings
    "rotation": (10.0, 20.0, 40.0),  # degrees
    "warp": (0.2, 0.35, 0.5),  # standard deviation of the logarithm of the speed
    "noise": (1.0, 2.0, 3.0),  # % of the extent
}

_LABELS = {
    "shift": "shift {:g} extents",
    "scale": "scale 2^±{:g}",
    "rotation": "rotation ±{:g}°",
    "warp": "warp {:g}",
    "noise": "noise {:g} %",
}

#: All perturbations together, from weak to strong.
TOGETHER = (
    Perturbation(0.5, 0.5, math.radians(10), 0.2, 0.005),
    Perturbation(1.0, 1.0, math.radians(20), 0.35, 0.01),
    Perturbation(2.0, 1.5, math.radians(40), 0.5, 0.03),
)
_TOGETHER_LABELS = ("weakly", "moderately", "strongly")


def robustness_conditions(n_dims: int) -> list[tuple[Condition, Perturbation]]:
    """Each perturbation alone and all together at three strengths."""
    conditions = [(Condition("shift", 0.0, "as recorded"), Perturbation())]
    for varied, strengths in STRENGTHS.items():
        if varied == "rotation" and n_dims not in (2, 3):
            continue
        for strength in strengths:
            amount = {"rotation": math.radians(strength), "noise": strength / 100}.get(varied, strength)
            condition = Condition(varied, strength, _LABELS[varied].format(strength))
            conditions.append((condition, Perturbation(**{varied: amount})))
    for k, perturbation in enumerate(TOGETHER):
        condition = Condition("together", k + 1.0, f"all {_TOGETHER_LABELS[k]}")
        conditions.append((condition, perturbation.in_dimensions(n_dims)))
    return conditions
