"""New movements beside known symbols: each is assigned to a symbol or to a new proposal, or stays unknown."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from kineme.anchoring.clustering import Clusters, average_linkage, cut_at, stabilities, without_small
from kineme.anchoring.proposals import Proposals, describe_clusters, extend, largest_clustered, subsample
from kineme.anchoring.unlabeled import own_order
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.recognition.known_classes import FittedRecognizer, KnownClasses, known_classes, open_set_labels
from kineme.recognition.left_out import distances as in_widths
from kineme.sampling import evenly_spaced
from kineme.similarity.comparison import Comparison
from kineme.similarity.describe import describe
from kineme.similarity.described import Described
from kineme.similarity.references import References
from kineme.similarity.similarity import compare
from kineme.validation import Array, check_count

_REPEATS = 20
_REACH = 0.6  # share of the typical distance to another symbol, where no two movements show one symbol


@dataclass(frozen=True, eq=False)
class Assignment:
    """Names of new movements, and proposals for the others.

    Attributes
    ----------
    labels : ndarray of n labels or None
        The symbol that each movement is assigned to; None is unknown.
    p_values : ndarray of shape (n,)
        The largest conformal p-value of each movement for any symbol.
    proposals : Proposals
        Clusters of unknown movements; members are indices of the new movements. `clusters` is -1 for movements that are
        assigned to a symbol or stay unknown.
    """

    labels: NDArray[np.object_]
    p_values: Array
    proposals: Proposals

    @property
    def unknown(self) -> NDArray[np.intp]:
        """Indices of the movements that are in no symbol and in no proposal."""
        unlabeled = np.array([label is None for label in self.labels], dtype=bool)
        return np.flatnonzero(unlabeled & (self.proposals.clusters < 0))

    def __repr__(self) -> str:
        n_assigned = sum(label is not None for label in self.labels)
        return (
            f"Assignment({n_assigned} of {len(self.labels)} to a symbol, {len(self.proposals)} new clusters proposed, "
            f"{len(self.unknown)} unknown)"
        )


def assign(
    movements: MovementsLike,
    symbols: FittedRecognizer | MovementsLike,
    error_rate: float = 0.05,
    *,
    min_members: int = 3,
) -> Assignment:
    """Assign movements to the symbols that they are recognized as, and cluster the unknown ones.

    Parameters
    ----------
    movements : movements as `Demonstrations.of` accepts them
    symbols : fitted Recognizer, or labeled movements
        The known symbols. Kernel widths and the height at which clusters are cut are theirs.
    error_rate : float, default 0.05
        Share of a symbol's true movements that may stay unknown, see `kineme.Recognizer.recognize`.
    min_members : int, default 3
        Movements of a proposal, at least. On average they are more similar than half way from the members of one
        symbol, which are 1, to those of the nearest other, 0.

    Returns
    -------
    Assignment

    Raises
    ------
    SpecificationError
        Parameters out of range.
    TrajectoryError
        Symbols without labels, or movements of another number of dimensions.
    """
    check_count("min_members", min_members, 2)
    classes = known_classes(symbols)
    described = describe(classes.comparison.checked(movements), classes.comparison)
    return assign_described(described, classes, error_rate, min_members)


def assign_described(
    described: Described, classes: KnownClasses, error_rate: float = 0.05, min_members: int = 3
) -> Assignment:
    """Assign movements that are described in the representations of the known classes, see `assign`."""
    labels, p_values = open_set_labels(classes, described, error_rate)
    unknown = np.flatnonzero([label is None for label in labels])
    proposals = _among_unknown(classes, described.take(unknown), min_members)
    return Assignment(labels, p_values.max(axis=1), _at(unknown, proposals, len(described)))


def _among_unknown(classes: KnownClasses, unknown: Described, min_members: int) -> Proposals:
    """Clusters among the unknown; where they are many, of a subsample, extended by their nearest neighbors."""
    n, similarity = len(unknown), classes.comparison.similarity
    if n < min_members:
        return describe_clusters(np.eye(n), np.full(n, -1, dtype=np.intp), np.empty(0), similarity.widths)
    limit, height = largest_clustered(unknown.n_dims), 1.0 - agreement(classes.comparison, classes.references)
    if n <= limit:
        return _clustered(classes.comparison, unknown, height, min_members)[1]
    sample, _ = subsample(unknown, limit)
    K, proposals = _clustered(classes.comparison, unknown.take(sample), height, min_members)
    return extend(unknown, sample, K, proposals, similarity)


def _clustered(
    comparison: Comparison, described: Described, height: float, min_members: int
) -> tuple[Array, Proposals]:
    """Similarities, and clusters by average linkage whose mean distance does not exceed `height`."""
    K = compare(comparison.similarity, described, described)
    np.fill_diagonal(K, 1.0)
    order = own_order(K)

    def cut(distances: Array) -> Clusters:
        return cut_at(average_linkage(distances), height)

    distances = 1.0 - 0.5 * (K + K.T)[np.ix_(order, order)]
    ordered = without_small(cut(distances), min_members)
    clusters = np.empty(len(described), dtype=np.intp)
    clusters[order] = ordered
    stable = stabilities(distances, ordered, cut, _REPEATS)
    return K, describe_clusters(K, clusters, stable, comparison.similarity.widths)


def agreement(comparison: Comparison, references: References) -> float:
    """Mean similarity from which on movements are one symbol, measured on known symbols.

    Half way from the typical mean similarity within a symbol to that with the nearest other symbol. Where each symbol
    was shown once, the similarity at 0.6 of the typical distance to the nearest other symbol, as
    `kineme.recognition.conformal.Calibration` takes it.
    """
    some = evenly_spaced(len(references), 500)
    described, labels = references.described.take(some), references.labels[some]
    K = compare(comparison.similarity, described, described)
    np.fill_diagonal(K, 0.0)
    member = np.unique(labels, return_inverse=True)[1]
    H = (member[:, None] == np.arange(member.max() + 1)).astype(float)
    sums, counts = H.T @ K @ H, H.sum(axis=0)
    means = sums / np.maximum(np.outer(counts, counts) - np.diag(counts), 1.0)
    others = np.where(np.eye(len(counts), dtype=bool), -1.0, means).max(axis=1)
    apart = float(np.median(others)) if len(counts) > 1 else 0.0
    several = counts > 1
    if several.any():
        return 0.5 * (float(np.median(np.diag(means)[several])) + apart)
    nearest = np.where(labels[:, None] == labels, 0.0, K).max(axis=1)
    reach = _REACH * in_widths(np.log(np.maximum(nearest, np.finfo(float).tiny)))
    return float(np.exp(-0.5 * np.median(reach) ** 2))


def _at(indices: NDArray[np.intp], proposals: Proposals, n: int) -> Proposals:
    """The same proposals, of movements with these indices among n."""
    clusters = np.full(n, -1, dtype=np.intp)
    clusters[indices] = proposals.clusters
    moved = (
        replace(proposal, members=indices[proposal.members], medoid=int(indices[proposal.medoid]))
        for proposal in proposals.proposals
    )
    return Proposals(tuple(moved), clusters, proposals.widths)
