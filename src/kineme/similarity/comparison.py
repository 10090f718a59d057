"""The comparison of movements: a specification with estimated kernel widths and weights."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.kernels.procrustes import Procrustes
from kineme.kernels.soft_rotation import RotationPrior
from kineme.movements.channels.channel import Channels
from kineme.movements.trajectories.as_learned import as_learned
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.similarity.describe import prepare
from kineme.similarity.described import Described
from kineme.similarity.normalization import Normalization
from kineme.similarity.representation import Representation
from kineme.similarity.similarity import AveragedSimilarity
from kineme.similarity.specification import ComparisonSpecification


@dataclass(frozen=True, eq=False)
class Comparison:
    """Everything that is needed to describe and compare movements; made by `fit_comparison`.

    Attributes
    ----------
    representations : tuple of R Representation
        Those with a weight above 0, and positions over arc length if pairs are rotated by them.
    normalization : Normalization
    cutoff : float or None
        Movements are smoothed below this many cycles each; None for not at all.
    similarity : AveragedSimilarity
        With the distance, the widths, the weights and the average.
    channels : tuple of Channel or None
        What was recorded of the movements that it was fitted to; None if that is not known.
    """

    representations: tuple[Representation, ...]
    normalization: Normalization
    cutoff: float | None
    similarity: AveragedSimilarity
    channels: Channels | None = None

    @property
    def procrustes(self) -> Procrustes:
        """The distance between rows, and the best rotation of a pair."""
        return self.similarity.procrustes

    @property
    def n_dims(self) -> int:
        """Number of dimensions d of the movements."""
        return self.procrustes.n_dims

    @property
    def mean(self) -> str:
        """The A-average over representations."""
        return self.similarity.mean

    @property
    def specification(self) -> ComparisonSpecification:
        """The same without widths and weights, so for other movements."""
        prior = self.procrustes.prior
        angle = self.procrustes.max_angle if prior is None else None
        return ComparisonSpecification(
            self.representations, self.normalization, self.cutoff, angle, self.mean, prior or RotationPrior()
        )

    def checked(self, movements: MovementsLike, what: str = "movements") -> Demonstrations:
        """The movements as `Demonstrations`, in the coordinates that were learned; see `as_learned`.

        `what` they are called in messages.

        Raises
        ------
        TrajectoryError
            Movements of another number of dimensions, or of channels of other kinds.
        """
        return as_learned(movements, self.channels, self.n_dims, what)

    def prepared(self, rows: tuple[NDArray[np.floating[Any]], ...]) -> Described:
        """Feature rows, as from `feature_rows`, ready for comparison."""
        return prepare(rows, self, self.procrustes)

    def select(self, representations: NDArray[np.intp]) -> Comparison:
        """The comparison by some of the representations."""
        one = self.similarity
        weights = None if one.weights is None else one.weights[representations]
        similarity = replace(one, widths=one.widths[representations], weights=weights)
        return replace(
            self, representations=tuple(self.representations[r] for r in representations), similarity=similarity
        )
