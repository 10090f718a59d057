"""Fit a comparison to labeled movements, which become its references."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.movements.channels.channel import Channels
from kineme.movements.channels.coordinates import with_periods
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import in_coordinates
from kineme.runtime.parallel import single_threaded_blas
from kineme.similarity.comparison import Comparison
from kineme.similarity.describe import feature_rows, prepare
from kineme.similarity.references import References
from kineme.similarity.representation import rotating
from kineme.similarity.similarity import AveragedSimilarity
from kineme.similarity.specification import ComparisonSpecification
from kineme.similarity.weights import WEIGHTS, given_weights, own_weights
from kineme.similarity.widths import impostor_widths, lone_widths
from kineme.validation import check_choice


def fit_comparison(
    specification: ComparisonSpecification,
    demos: Demonstrations,
    labels: NDArray[Any],
    weights: str | Sequence[float] = "auto",
) -> tuple[Comparison, References]:
    """Describe movements, and estimate widths and weights from them.

    Parameters
    ----------
    specification : ComparisonSpecification
    demos : Demonstrations
    labels : ndarray of shape (m,)
        The class of each.
    weights : {"auto", "equal", "fitted"} or sequence of R numbers, default "auto"
        "auto" takes the weights of the representations; "fitted" estimates them, see `fitted_weights`.

    Returns
    -------
    comparison : Comparison
        With the representations that have a weight above 0, and with positions over arc length if any of them is
        compared pair by pair.
    references : References
        The movements, ordered by class.

    Raises
    ------
    SpecificationError
        Weights that do not fit the specification, or movements that are all the same.
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
    """As `fit_comparison`, of movements that are described already, in all representations of the specification.

    `channels` are what was recorded of them, where that is known.
    """
    described, labels = references.described, references.labels
    representations = specification.representations
    with single_threaded_blas():
        alone = len(references) == 1
        quantities = [one.quantity for one in representations]
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
    in_pairs = any(one.in_pairs and value > 0 for one, value in zip(representations, values, strict=True))
    # Where movements are compared pair by pair, their rotation comes from their positions, even with a weight of 0.
    needed = np.arange(len(values)) == rotating(representations) if in_pairs else False
    kept = np.flatnonzero((values > 0) | needed)
    whole = Comparison(
        specification.representations,
        specification.normalization,
        specification.cutoff,
        replace(similarity, weights=values),
        channels,
    )
    return whole.select(kept), replace(references, described=described.select(kept))
