"""Under what the trials are held: how movements are perturbed, and how strongly."""

from __future__ import annotations

import math
from typing import NamedTuple

from kineme.movements.preparation.perturbations import Perturbation


class Condition(NamedTuple):
    """One column of a table and one point of a plot.

    Attributes
    ----------
    kind : str
        What varies; one panel of the plot.
    strength : float
        How much of it.
    label : str
        Both, in words.
    """

    kind: str
    strength: float
    label: str


UNTOUCHED = Condition("none", 0, "as recorded")

#: Kind -> strengths; the middle one is the reference.
STRENGTHS: dict[str, tuple[float, float, float]] = {
    "shift": (0.5, 1.0, 2.0),  # extents
    "scale": (0.5, 1.0, 1.5),  # doublings
    "rotation": (10.0, 20.0, 40.0),  # degrees
    "warp": (0.2, 0.35, 0.5),  # standard deviation of the logarithm of the speed
    "noise": (1.0, 2.0, 3.0),  # % of the extent
}

_IN_WORDS = {
    "shift": "shift {:g} extents",
    "scale": "scale 2^±{:g}",
    "rotation": "rotation ±{:g}°",
    "warp": "warp {:g}",
    "noise": "noise {:g} %",
}

#: Everything at once, from weak to strong.
TOGETHER = (
    Perturbation(0.5, 0.5, math.radians(10), 0.2, 0.005),
    Perturbation(1.0, 1.0, math.radians(20), 0.35, 0.01),
    Perturbation(2.0, 1.5, math.radians(40), 0.5, 0.03),
)
_TOGETHER_IN_WORDS = ("weakly", "moderately", "strongly")


def robustness_conditions(n_dims: int) -> list[tuple[Condition, Perturbation, bool]]:
    """Each perturbation alone and all together, at growing strength; and which of them are the reference."""
    found = [(Condition("shift", 0.0, "as recorded"), Perturbation(), True)]
    for kind, strengths in STRENGTHS.items():
        if kind == "rotation" and n_dims not in (2, 3):
            continue
        for k, strength in enumerate(strengths):
            amount = {"rotation": math.radians(strength), "noise": strength / 100}.get(kind, strength)
            condition = Condition(kind, strength, _IN_WORDS[kind].format(strength))
            found.append((condition, Perturbation(**{kind: amount}), k == 1))
    for k, perturbation in enumerate(TOGETHER):
        condition = Condition("together", k + 1.0, f"all {_TOGETHER_IN_WORDS[k]}")
        found.append((condition, perturbation.in_dimensions(n_dims), k == 1))
    return found
