"""The specification of a comparison: its parameters, without estimates from movements.

Kernels are averaged by their logarithms here; `kineme.kernels.average` has the same averages of the kernels themselves,
with what is proved of each.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from kineme.errors import SpecificationError
from kineme.kernels.procrustes import Procrustes
from kineme.kernels.soft_rotation import RotationPrior
from kineme.movements.preparation.smooth import Smooth
from kineme.similarity.representation import (
    DEFAULT_REPRESENTATIONS,
    Normalization,
    Representation,
    check_representations,
)
from kineme.validation import Array, check_choice, check_number


def _log_mean_exp(logs: Array) -> Array:
    top = logs.max(axis=0)
    return np.asarray(np.log(np.mean(np.exp(logs - top), axis=0)) + top)


#: Name -> A-average (paper's reference [10]) of kernels given by their logarithms, over the first axis.
LOG_MEANS: dict[str, Callable[[Array], Array]] = {
    "arithmetic": _log_mean_exp,
    "geometric": lambda logs: np.asarray(logs.mean(axis=0)),
    "harmonic": lambda logs: -_log_mean_exp(-logs),
    "quadratic": lambda logs: 0.5 * _log_mean_exp(2.0 * logs),
    "min": lambda logs: np.asarray(logs.min(axis=0)),
}


def _softmax(logs: Array) -> Array:
    weights = np.exp(logs - logs.max(axis=0))
    return np.asarray(weights / weights.sum(axis=0))


#: Name -> share of each kernel in the average, d log K / d log k_r: none negative, their sum over the first axis 1.
SHARES: dict[str, Callable[[Array], Array]] = {
    "arithmetic": _softmax,
    "geometric": lambda logs: np.full(logs.shape, 1.0 / len(logs)),
    "harmonic": lambda logs: _softmax(-logs),
    "quadratic": lambda logs: _softmax(2.0 * logs),
    "min": lambda logs: (np.arange(len(logs))[:, None] == logs.argmin(axis=0)).astype(float),
}


@dataclass(frozen=True)
class ComparisonSpecification:
    """Representations, invariances, smoothing and average.

    Kernel widths and weights are estimated from movements, see `Comparison`.

    - `representations`: those compared sample by sample first. By default positions over arc length, forcing term over
      time, elastic path, turning angles, and point cloud.
    - `cutoff`: movements are smoothed below this many cycles each, see `Smooth`; None for recordings without noise.
    - `max_angle`: largest rotation [rad] between movements of one class, instead of the prior; 0 for none.
    - `prior`: how rare rotations are, in two and three dimensions, if there is no `max_angle`. None is a limit of pi/3.

    Raises `SpecificationError`: a parameter out of its range, or `max_angle` and a prior that is not the default.
    """

    representations: tuple[Representation, ...] = DEFAULT_REPRESENTATIONS
    normalization: Normalization = field(default_factory=Normalization)  # the normalization of translation and size
    cutoff: float | None = 10.0
    max_angle: float | None = None
    mean: str = "arithmetic"  # the A-average over representations
    prior: RotationPrior | None = field(default_factory=RotationPrior)

    def __post_init__(self) -> None:
        check_choice("mean", self.mean, list(LOG_MEANS))
        if self.cutoff is not None:
            Smooth(self.cutoff)  # checks its own parameter
        object.__setattr__(self, "representations", check_representations(self.representations))
        if self.max_angle is not None:
            check_number("max_angle", self.max_angle, least=0.0)
        if self.prior is not None and not isinstance(self.prior, RotationPrior):
            raise SpecificationError(
                f"expected rotation_prior to be a kineme.recognition.RotationPrior or None, got {self.prior!r}; write "
                "kineme.recognition.RotationPrior(concentration=0.03)"
            )
        if self.max_angle is not None and self.prior not in (None, RotationPrior()):
            raise SpecificationError(
                f"expected max_angle or rotation_prior, got max_angle={self.max_angle!r} and {self.prior}; leave one "
                "out: under a prior, a large rotation costs similarity and none is forbidden"
            )

    @property
    def by_rows(self) -> tuple[Representation, ...]:
        """The representations that are compared sample by sample; they come first."""
        return tuple(representation for representation in self.representations if not representation.in_pairs)

    @property
    def by_pairs(self) -> tuple[Representation, ...]:
        """The representations that are compared pair by pair."""
        return self.representations[len(self.by_rows) :]

    @property
    def specification(self) -> ComparisonSpecification:
        """The specification itself."""
        return self

    def procrustes(self, n_dims: int) -> Procrustes:
        """Return the distance between rows of movements of `n_dims` dimensions."""
        if self.max_angle is not None and 0 <= self.max_angle - math.pi <= 1e-12 and n_dims in (2, 3):
            return Procrustes(n_dims, math.pi, RotationPrior(0.0))  # no limit: the fast way
        if self.max_angle is not None:
            return Procrustes(n_dims, float(self.max_angle))
        if n_dims not in (2, 3):
            return Procrustes(n_dims, 0.0)
        return Procrustes(n_dims, math.pi / 3 if self.prior is None else math.pi, self.prior)


class Compares(Protocol):
    """An object with the specification of a comparison: a specification itself, a `Comparison`, a recognizer."""

    @property
    def specification(self) -> ComparisonSpecification:
        """Specification of the comparison."""
        ...


def specification_of(like: Compares | None) -> ComparisonSpecification:
    """Return the specification that `like` is or has; the default one for None.

    Raises `SpecificationError`: `like` has none, or one with a parameter out of its range.
    """
    specification = ComparisonSpecification() if like is None else getattr(like, "specification", None)
    if not isinstance(specification, ComparisonSpecification):
        raise SpecificationError(
            f"expected like to be a kineme.Recognizer, a Comparison, a ComparisonSpecification or None, got {like!r}"
        )
    return specification
