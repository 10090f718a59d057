"""New movements beside known symbols: each is assigned to a symbol or to a new proposal, or stays unknown."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.anchoring.clustering import Clusters, average_linkage, cut_at, cuts, stabilities, without_small
from kineme.anchoring.proposals import Proposals, describe_clusters, extend, largest_clustered, own_order, subsample
from kineme.errors import SpecificationError
from kineme.movements.trajectories.labels import label_array
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.recognition.answer import FittedRecognizer, KnownClasses, known_classes, open_set_labels
from kineme.recognition.conformal import distances as in_widths
from kineme.reporting.text import counted
from kineme.sampling import evenly_spaced
from kineme.similarity.comparison import Comparison, References
from kineme.similarity.describe import Described, describe
from kineme.similarity.similarity import averaged, compare, similarities
from kineme.similarity.specification import Compares
from kineme.validation import Array, check_count, check_number

_LARGEST = 5000  # movements compared at once
_STABLE = 0.75  # a valid cluster to Hennig (2007)
_OVERLAP = 0.25  # of the two parts of a symbol, up to which it is named

_REACH = 0.6  # share of the typical distance to another symbol, where no two movements show one symbol


@dataclass(frozen=True, eq=False)
class Assignment:
    """Names of new movements, and proposals for the others.

    - `labels`: the symbol that each movement is assigned to; None is unknown.
    - `p_values` (n,): the largest conformal p-value of each movement for any symbol.
    - `proposals`: clusters of unknown movements; members are indices of the new movements. `clusters` is -1 for
      movements that are assigned to a symbol or stay unknown.
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
            f"Assignment({n_assigned} of {len(self.labels)} to a symbol, {counted(len(self.proposals), 'new cluster')} "
            f"proposed, {len(self.unknown)} unknown)"
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

    Raises
    ------
    SpecificationError
        Parameters out of range.
    TrajectoryError
        Symbols without labels, or movements of another number of dimensions.
    """
    check_count("min_members", min_members, 2)
    classes = known_classes(symbols)
    described = classes.comparison.describe(classes.comparison.checked(movements))
    return assign_described(described, classes, error_rate, min_members)


def assign_described(
    described: Described, classes: KnownClasses, error_rate: float = 0.05, min_members: int = 3
) -> Assignment:
    """Assign movements that are described in the representations of the known classes, see `assign`."""
    labels, p_values = open_set_labels(classes, described, error_rate)
    unknown = np.flatnonzero([label is None for label in labels])
    proposals = _among_unknown(classes, described.take(unknown), min_members)
    return Assignment(labels, p_values.max(axis=1), at_indices(unknown, proposals, len(described)))


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
    stable = stabilities(distances, ordered, cut)
    return K, describe_clusters(K, clusters, stable, comparison.similarity.widths)


def agreement(comparison: Comparison, references: References) -> float:
    """Mean similarity from which on movements are one symbol: half way from that within one to that with the nearest.

    Where each symbol was shown once, the similarity at 0.6 of the typical distance to the nearest other one, as of
    `kineme.recognition.conformal.Calibration`.
    """
    some = evenly_spaced(len(references), 500)
    described, labels = references.described.take(some), references.labels[some]
    K = compare(comparison.similarity, described, described)
    means, counts = mean_similarities(K, np.unique(labels, return_inverse=True)[1])
    others = np.where(np.eye(len(counts), dtype=bool), -1.0, means).max(axis=1)
    apart = float(np.median(others)) if len(counts) > 1 else 0.0
    several = counts > 1
    if several.any():
        return 0.5 * (float(np.median(np.diag(means)[several])) + apart)
    nearest = np.where(labels[:, None] == labels, 0.0, K).max(axis=1)
    reach = _REACH * in_widths(np.log(np.maximum(nearest, np.finfo(float).tiny)))
    return float(np.exp(-0.5 * np.median(reach) ** 2))


def mean_similarities(K: Array, member: NDArray[np.intp]) -> tuple[Array, NDArray[np.intp]]:
    """Mean of different members of each two symbols (c, c), and the numbers of members; the diagonal of K becomes 0."""
    np.fill_diagonal(K, 0.0)
    counts = np.bincount(member)
    H = (member[:, None] == np.arange(len(counts))).astype(float)
    return H.T @ K @ H / np.maximum(np.outer(counts, counts) - np.diag(counts), 1), counts


def at_indices(indices: NDArray[np.intp], proposals: Proposals, n: int) -> Proposals:
    """The same proposals, of movements with these indices among n."""
    clusters = np.full(n, -1, dtype=np.intp)
    clusters[indices] = proposals.clusters
    moved = (
        replace(proposal, members=indices[proposal.members], medoid=int(indices[proposal.medoid]))
        for proposal in proposals.proposals
    )
    return Proposals(tuple(moved), clusters, proposals.widths)


class Merge(NamedTuple):
    """Two symbols whose members are hard to tell apart."""

    first: Any
    second: Any
    overlap: float


class Split(NamedTuple):
    """A symbol whose members form two clusters, given by the indices of the movements."""

    symbol: Any
    parts: tuple[NDArray[np.intp], NDArray[np.intp]]
    overlap: float
    stability: float  # of the less stable part


def suggest_merges(
    movements: MovementsLike | Described,
    labels: ArrayLike,
    *,
    least: float = 0.5,
    like: Compares | None = None,
    widths: ArrayLike | None = None,
) -> tuple[Merge, ...]:
    """Pairs of symbols that overlap, those that do most first.

    The overlap of a and b is ``mean K(a, b) / sqrt(mean K(a, a') mean K(b, b'))`` over different members: the cosine
    of their mean elements in the kernel's space (Gretton et al., "A kernel two-sample test", JMLR 13, 2012, section
    2.2), free of bias. It is about 1 where both are drawn from one class and 0 where no member is near the other's; on
    handwriting, halves of one shape have 0.7 to 1.4, and the two most similar shapes 0.25.

    Parameters
    ----------
    movements : Described, or movements as `Demonstrations.of` accepts them
    labels : array_like of shape (n,)
        The symbol of each.
    least : float, default 0.5
        Overlap from which on a pair is named.
    like : Recognizer, Comparison or ComparisonSpecification, optional
        Whose representations and invariances to take.
    widths : array_like of shape (R,), optional
        Of the kernels, by default `gap_widths` of these movements.

    Notes
    -----
    A symbol with one member is as cohesive as the others typically are. Of a large symbol, evenly spaced
    members are compared.
    """
    check_number("least", least, above=0.0)
    described, member, names = _labeled(movements, labels, like)
    if len(names) < 2:
        return ()
    of_symbols = np.split(np.argsort(member, kind="stable"), np.cumsum(np.bincount(member))[:-1])
    most = max(3, _LARGEST // len(names))
    chosen = np.sort(np.concatenate([own[evenly_spaced(len(own), most)] for own in of_symbols]))
    means, counts = mean_similarities(similarities(described.take(chosen), widths=widths), member[chosen])
    several = counts > 1
    typical = float(np.median(np.diag(means)[several])) if several.any() else 1.0
    within = np.maximum(np.where(several, np.diag(means), typical), np.finfo(float).tiny)
    overlap = means / np.sqrt(np.outer(within, within))
    pairs = np.argwhere(np.triu(overlap >= least, 1))
    merges = [Merge(names[i], names[j], float(overlap[i, j])) for i, j in pairs]
    return tuple(sorted(merges, key=lambda merge: -merge.overlap))


def suggest_splits(
    movements: MovementsLike | Described,
    labels: ArrayLike,
    *,
    like: Compares | None = None,
    widths: ArrayLike | None = None,
) -> tuple[Split, ...]:
    """Symbols whose members form two stable clusters, the most clearly apart first.

    Average linkage in two; both parts must have a stability of 0.75 (Hennig 2007) and two members, and their overlap
    (see `suggest_merges`) must be at most 0.25. On handwriting, two shapes under one name have less than 0.02, and the
    two most different ways of drawing one shape 0.4. Parts can be split again.

    Parameters are as for `suggest_merges`. Without `widths` there must be another symbol that shows how far apart
    symbols are; the only symbol is never split.
    """
    described, member, names = _labeled(movements, labels, like)
    if len(names) < 2 and widths is None:
        return ()
    sigma = averaged(described, widths).widths
    splits = []
    for k, name in enumerate(names):
        indices = np.flatnonzero(member == k)
        if len(indices) > 3:
            splits.append(_in_two(name, described.take(indices), indices, sigma))
    clear = (s for s in splits if s.overlap <= _OVERLAP and s.stability >= _STABLE and min(map(len, s.parts)) > 1)
    return tuple(sorted(clear, key=lambda split: split.overlap))


def _in_two(name: Any, described: Described, indices: NDArray[np.intp], widths: Array) -> Split:
    some = evenly_spaced(len(described), _LARGEST // 5)
    K = similarities(described.take(some), widths=widths)
    order = own_order(K)
    K = K[np.ix_(order, order)]

    def halve(distances: Array) -> Clusters:
        return cuts(average_linkage(distances), [2])[0]

    halves = halve(1.0 - K)
    stability = float(stabilities(1.0 - K, halves, halve).min())
    means, counts = mean_similarities(K, halves)
    within = float(np.where(counts > 1, np.diag(means), 1.0).prod())  # 1 for a movement alone
    parts = np.empty(len(some), dtype=np.intp)
    parts[order] = halves
    nearest = compare(averaged(described, widths), described, described.take(some)).argmax(axis=1)
    parent = parts[nearest]
    parent[some] = parts
    overlap = float(means[0, 1]) / float(np.sqrt(max(within, np.finfo(float).tiny)))
    return Split(name, (indices[parent == 0], indices[parent == 1]), overlap, stability)


def _labeled(
    movements: MovementsLike | Described, labels: ArrayLike, like: Compares | None
) -> tuple[Described, NDArray[np.intp], list[Any]]:
    described, label_values = describe(movements, like), label_array(labels)
    if len(label_values) != len(described):
        raise SpecificationError(
            f"expected one label for each of the {len(described)} movements, got shape {label_values.shape}"
        )
    names, member = np.unique(label_values, return_inverse=True)
    return described, np.asarray(member, dtype=np.intp), names.tolist()
