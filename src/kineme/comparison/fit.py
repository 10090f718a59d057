"""Fit a comparison to labeled movements, which become its references."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.comparison.comparison import Comparison
from kineme.comparison.describe import feature_rows, prepare
from kineme.comparison.references import References
from kineme.comparison.representation import Representation
from kineme.comparison.similarity import AveragedSimilarity
from kineme.comparison.specification import ComparisonSpecification
from kineme.comparison.weights import fitted_weights, given_weights, suffices
from kineme.comparison.widths import impostor_widths
from kineme.errors import SpecificationError
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.runtime.parallel import single_threaded_blas
from kineme.validation import check_choice


def fit_comparison(
    specification: ComparisonSpecification,
    demos: Demonstrations,
    labels: NDArray[Any],
    weights: str | Sequence[float] = "auto",
    candidates: tuple[Representation, ...] | None = None,
) -> tuple[Comparison, References]:
    """Describe movements, and estimate widths and weights from them.

    Parameters
    ----------
    specification : ComparisonSpecification
    demos : Demonstrations
    labels : ndarray of shape (m,)
        The class of each.
    weights : {"auto", "equal"} or sequence of R numbers, default "auto"
        "auto" fits them where there are eight movements of every class, see `fitted_weights`.
    candidates : tuple of Representation, optional
        Representations to fit weights for, those of the specification first; by default only those.

    Returns
    -------
    comparison : Comparison
        With the representations that have a weight above 0.
    references : References
        The movements, ordered by class.

    Raises
    ------
    SpecificationError
        Weights that do not fit the specification, or movements that are all the same.
    """
    order = np.argsort(labels, kind="stable")
    demos, labels = demos[order], labels[order]
    n_defaults = len(specification.representations)
    fitted = _fits(weights, specification.mean, np.unique(labels, return_counts=True)[1])
    if fitted and candidates is not None:
        specification = replace(specification, representations=candidates)
    with single_threaded_blas():  # products of few rows: a second thread mostly waits
        rows = feature_rows(demos, specification)
        references = References.of(demos, prepare(rows, specification, specification.procrustes(demos.n_dims)), labels)
        return fit_to_references(specification, references, weights, n_defaults)


def fit_to_references(
    specification: ComparisonSpecification,
    references: References,
    weights: str | Sequence[float] = "auto",
    n_defaults: int | None = None,
) -> tuple[Comparison, References]:
    """As `fit_comparison`, of movements that are described already, in all representations of the specification.

    The first `n_defaults` representations, by default all, have equal weights where none are fitted.
    """
    described, labels = references.described, references.labels
    n_defaults = len(specification.representations) if n_defaults is None else n_defaults
    with single_threaded_blas():
        widths = impostor_widths(described, labels)
        similarity = AveragedSimilarity(described.procrustes, widths, specification.mean)
        if _fits(weights, specification.mean, references.counts):
            values = fitted_weights(similarity, described, labels, n_defaults)
        elif isinstance(weights, str):
            values = np.full(n_defaults, 1.0 / n_defaults)
        else:
            values = given_weights(weights, n_defaults)
    kept = np.flatnonzero(values)
    whole = Comparison(
        specification.representations,
        specification.normalization,
        specification.cutoff,
        replace(similarity, weights=values),
    )
    return whole.select(kept), replace(references, described=described.select(kept))


def _fits(weights: str | Sequence[float], mean: str, per_class: NDArray[np.intp]) -> bool:
    """Whether weights are fitted to movements of so many per class."""
    if isinstance(weights, str):
        check_choice("weights", weights, ["auto", "equal"])
    elif mean != "arithmetic":
        raise SpecificationError(f"expected weights with mean='arithmetic', got them with mean={mean!r}")
    return isinstance(weights, str) and weights == "auto" and mean == "arithmetic" and suffices(per_class)
