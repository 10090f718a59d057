"""The comparison of movements: a specification with kernel widths and weights that are fitted to labeled movements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.kernels.procrustes import Procrustes
from kineme.kernels.soft_rotation import RotationPrior
from kineme.movements.channels.channel import Channels
from kineme.movements.channels.coordinates import with_periods
from kineme.movements.trajectories.as_learned import as_learned
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import in_coordinates
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.runtime.parallel import single_threaded_blas
from kineme.similarity.describe import feature_rows, prepare
from kineme.similarity.described import Described
from kineme.similarity.references import References
from kineme.similarity.representation import Normalization, Representation, rotating
from kineme.similarity.similarity import AveragedSimilarity
from kineme.similarity.specification import ComparisonSpecification
from kineme.similarity.weights import WEIGHTS, given_weights, own_weights
from kineme.similarity.widths import impostor_widths, lone_widths
from kineme.validation import check_choice


@dataclass(frozen=True, eq=False)
class Comparison:
    """Everything that is needed to describe and compare movements; made by `fit_comparison`.

    - `representations`: those with a weight above 0, and positions over arc length if pairs are rotated by them.
    - `channels`: what was recorded of the movements that it was fitted to; None if that is not known.
    """

    representations: tuple[Representation, ...]
    normalization: Normalization
    cutoff: float | None  # movements are smoothed below this many cycles each; None for not at all
    similarity: AveragedSimilarity  # with the distance, the widths, the weights and the average
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
        """Return the movements as `Demonstrations`, in the coordinates that were learned; see `as_learned`.

        `what` they are called in messages.

        Raises `TrajectoryError`: movements of another number of dimensions, or of channels of other kinds.
        """
        return as_learned(movements, self.channels, self.n_dims, what)

    def prepared(self, rows: tuple[NDArray[np.floating[Any]], ...]) -> Described:
        """Return feature rows, as from `feature_rows`, ready for comparison."""
        return prepare(rows, self, self.procrustes)

    def select(self, representations: NDArray[np.intp]) -> Comparison:
        """Return the comparison by some of the representations."""
        similarity = self.similarity
        weights = None if similarity.weights is None else similarity.weights[representations]
        similarity = replace(similarity, widths=similarity.widths[representations], weights=weights)
        return replace(
            self, representations=tuple(self.representations[r] for r in representations), similarity=similarity
        )


def fit_comparison(
    specification: ComparisonSpecification,
    demos: Demonstrations,
    labels: NDArray[Any],
    weights: str | Sequence[float] = "auto",
) -> tuple[Comparison, References]:
    """Describe movements, and estimate widths and weights from them.

    - `labels` (m,): the class of each.
    - `weights` ({"auto", "equal", "fitted"} or sequence of R numbers, default "auto"): "auto" takes the weights of the
      representations; "fitted" estimates them, see `fitted_weights`.

    Returns `comparison`: with the representations that have a weight above 0, and with positions over arc length if any
    of them is compared pair by pair; `references`: the movements, ordered by class. Raises `SpecificationError`:
    weights that do not fit the specification, or movements that are all the same.
    """
    demos = Demonstrations.of_movements(in_coordinates(demos.movements), demos.steps)
    order = np.argsort(labels, kind="stable")
    demos, labels = demos[order], labels[order]
    with single_threaded_blas():  # products of few rows: a second thread mostly waits
        rows = feature_rows(demos, specification)
        references = References.of(demos, prepare(rows, specification, specification.procrustes(demos.n_dims)), labels)
        channels = None if demos.channels is None else with_periods(demos.channels, demos.recorded)
        return fit_to_references(specification, references, weights, channels)


def fit_to_references(
    specification: ComparisonSpecification,
    references: References,
    weights: str | Sequence[float] = "auto",
    channels: Channels | None = None,
) -> tuple[Comparison, References]:
    """Fit like `fit_comparison` to movements that are described already, in all representations of the specification.

    `channels` are what was recorded of them, where that is known.
    """
    described, labels = references.described, references.labels
    representations = specification.representations
    with single_threaded_blas():
        alone = len(references) == 1
        quantities = [representation.quantity for representation in representations]
        widths = lone_widths(described, quantities) if alone else impostor_widths(described, labels)
        similarity = AveragedSimilarity(described.procrustes, widths, specification.mean)
        if isinstance(weights, str):
            check_choice("weights", weights, list(WEIGHTS))
            chosen = own_weights if alone else WEIGHTS[weights]  # nothing to fit to
            values = chosen(similarity, described, labels, representations)
        else:
            if specification.mean != "arithmetic":
                raise SpecificationError(
                    f"expected weights with mean='arithmetic', got them with mean={specification.mean!r}"
                )
            values = given_weights(weights, len(representations))
    in_pairs = any(
        representation.in_pairs and value > 0 for representation, value in zip(representations, values, strict=True)
    )
    # Where movements are compared pair by pair, their rotation comes from their positions, even with a weight of 0.
    needed = np.arange(len(values)) == rotating(representations) if in_pairs else False
    selected = np.flatnonzero((values > 0) | needed)
    comparison = Comparison(
        specification.representations,
        specification.normalization,
        specification.cutoff,
        replace(similarity, weights=values),
        channels,
    )
    return comparison.select(selected), replace(references, described=described.select(selected))
