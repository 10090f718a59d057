"""The conventions that "weights" and "f(t)" can stand for, in one table.

Each row maps movements to features. The reproduction asks which rows give the paper's numbers, and which ones a user
should take.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kineme.dmp.discrete.dmp import DMP
from kineme.dmp.discrete.operators import forcing_target, local_regression
from kineme.features.movement_features import features_of
from kineme.movements.preparation.resample import relative_rows
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.validation import Array
from kineme_experiments.paper.paper import N_BASIS, N_POINTS, N_SAMPLES, STIFFNESS


@dataclass(frozen=True)
class Representation:
    """One row of `REPRESENTATIONS`.

    Attributes
    ----------
    formulation, quantity : str
        The column of the paper's tables that the row can stand for.
    formula : str
        Formula of the feature.
    why : str
        How it differs from the other rows of its column.
    rows : callable
        Demonstrations -> features (n, p).
    """

    key: str
    formulation: str
    quantity: str
    formula: str
    why: str
    rows: Callable[[Demonstrations], Array]


def specification(formulation: str, gating: str = "none") -> DMP:
    """The paper's parameters (Section 4.2)."""
    return DMP(formulation, N_BASIS, STIFFNESS, gating=gating, fit="forcing", n_points=N_POINTS)


def _feature(formulation: str, feature: str, gating: str = "none") -> Callable[[Demonstrations], Array]:
    dmp = specification(formulation, gating)
    return lambda demos: features_of(dmp.learn(demos), feature, N_SAMPLES)


def _phase(n_samples: int) -> Array:
    return specification("bio-inspired").basis.phase(np.linspace(0.0, 1.0, n_samples))


def _weights_of_target_over_s(demos: Demonstrations) -> Array:
    """Bio-inspired weights when the target is divided by s before a fit with the basis gated by s."""
    dmp, u = specification("bio-inspired", gating="phase"), np.linspace(0.0, 1.0, N_POINTS)
    over_s = forcing_target(dmp, u) / _phase(N_POINTS)[:, None]
    operator = local_regression(dmp.basis, u) @ over_s
    return (relative_rows(demos, 0, len(demos), N_POINTS) @ operator.T).reshape(len(demos), -1)


def _forcing_over_s(demos: Demonstrations) -> Array:
    by_dimension = _feature("bio-inspired", "forcing")(demos).reshape(len(demos), -1, N_SAMPLES)
    return (by_dimension / _phase(N_SAMPLES)).reshape(len(demos), -1)


def _bracket(demos: Demonstrations) -> Array:
    by_dimension = _feature("bio-inspired", "shape-attractor")(demos).reshape(len(demos), -1, N_SAMPLES)
    return (by_dimension / _phase(N_SAMPLES)).reshape(len(demos), -1)


REPRESENTATIONS = {
    row.key: row
    for row in (
        Representation(
            "original-w",
            "original",
            "weights",
            "w, Eq. (2) as printed",
            "divided by g - x0, whose sign and size differ between equal movements",
            _feature("original", "weights"),
        ),
        Representation(
            "original-w-gated",
            "original",
            "weights",
            "w, basis times s",
            "divided by g - x0, and the last weights by s too",
            _feature("original", "weights", gating="phase"),
        ),
        Representation(
            "original-f",
            "original",
            "f(t)",
            "f",
            "divided by g - x0, as w is",
            _feature("original", "forcing"),
        ),
        Representation(
            "original-sa",
            "original",
            "f(t)",
            "(g - x0) f, the shape-attractor",
            "not divided by g - x0: the inversion of Section 3.1 is gone",
            _feature("original", "shape-attractor"),
        ),
        Representation(
            "bio-w-over-s",
            "bio-inspired",
            "weights",
            "K w, target divided by s, basis times s",
            "divided by a phase that ends at 0.01: the last samples outweigh the others",
            _weights_of_target_over_s,
        ),
        Representation(
            "bio-w",
            "bio-inspired",
            "weights",
            "w, Eq. (2) as printed",
            "not divided by s",
            _feature("bio-inspired", "weights"),
        ),
        Representation(
            "bio-f-over-s",
            "bio-inspired",
            "f(t)",
            "f / s",
            "divided by s, which magnifies the noise of the last samples",
            _forcing_over_s,
        ),
        Representation(
            "bio-f",
            "bio-inspired",
            "f(t)",
            "f",
            "not divided by s",
            _feature("bio-inspired", "forcing"),
        ),
        Representation(
            "bio-bracket",
            "bio-inspired",
            "f(t)",
            "K (f/s + x0 - x), Section 2.2 to the letter",
            "divided by s",
            _bracket,
        ),
        Representation(
            "bio-sa",
            "bio-inspired",
            "f(t)",
            "s K (f/s + x0 - x), the shape-attractor as it acts",
            "multiplied by the s that stands in Eq. (4): no division is left",
            _feature("bio-inspired", "shape-attractor"),
        ),
    )
}

#: Two readings of the four columns of Tables 2 to 4, in the order of `paper.CELLS`. The first has in each column the
#: row whose median distance is nearest to the printed RBF width; a test checks it.
READINGS = {
    "closest in distances": ("original-w", "bio-w-over-s", "original-sa", "bio-f-over-s"),
    "kineme's default": ("original-w", "bio-w", "original-sa", "bio-sa"),
}
