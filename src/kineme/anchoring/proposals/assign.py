"""New movements beside known symbols: they join one, stay unknown, or raise a new proposal."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.anchoring.clustering.clustering import without_small
from kineme.anchoring.clustering.resampling import Clusters, stabilities
from kineme.anchoring.clustering.tree import average_linkage, cut_at
from kineme.anchoring.proposals.proposals import Proposals, describe_clusters
from kineme.anchoring.proposals.propose import own_order
from kineme.anchoring.proposals.subsample import assign, largest_clustered, spread_sample
from kineme.comparison.compared import nearest, score
from kineme.comparison.describe import Described
from kineme.comparison.sampling import evenly_spaced
from kineme.comparison.similarity import compare
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements_like import MovementsLike
from kineme.recognition.answer import known_labels
from kineme.recognition.conformal import REACH, check_error_rate
from kineme.recognition.conformal import distances as in_widths
from kineme.recognition.recognizer import Recognizer
from kineme.validation import Array, check_count

_REPEATS = 20


@dataclass(frozen=True, eq=False)
class Placement:
    """Where new movements belong.

    Attributes
    ----------
    labels : ndarray of n labels or None
        The symbol that each movement joins; None is unknown.
    p_values : ndarray of shape (n,)
        The largest conformal p-value of each movement for any symbol.
    proposals : Proposals
        Kinds among the unknown; members are places among the new movements, and so are the `clusters`, -1 for
        movements that joined a symbol or stay unknown.
    """

    labels: NDArray[np.object_]
    p_values: Array
    proposals: Proposals

    @property
    def unknown(self) -> NDArray[np.intp]:
        """Places of the movements that neither join a symbol nor raise a proposal."""
        nowhere = np.array([label is None for label in self.labels], dtype=bool)
        return np.flatnonzero(nowhere & (self.proposals.clusters < 0))

    def __repr__(self) -> str:
        n_joined = sum(label is not None for label in self.labels)
        return (
            f"Placement({n_joined} of {len(self.labels)} join a symbol, {len(self.proposals)} new kinds proposed, "
            f"{len(self.unknown)} unknown)"
        )


def place(movements: MovementsLike, symbols: Any, error_rate: float = 0.05, *, min_members: int = 3) -> Placement:
    """Let movements join the symbols that they are recognized as, and gather the unknown into new kinds.

    Parameters
    ----------
    movements : movements as `Demonstrations.of` accepts them
    symbols : fitted Recognizer, or labeled Demonstrations
        What is known. Widths and the scale of likeness are its own.
    error_rate : float, default 0.05
        Share of a symbol's true movements that may stay out of it, see `Recognizer.recognize`.
    min_members : int, default 3
        Unknown movements that must agree to be proposed. They agree when on average they are more alike than half way
        from the members of one symbol, which are 1, to those of the nearest other, 0.

    Returns
    -------
    Placement
    """
    check_count("min_members", min_members, 2)
    known = symbols if isinstance(symbols, Recognizer) else Recognizer().fit(symbols)
    demos = Demonstrations.of(movements)
    check_error_rate(error_rate)
    described = known.describe(demos)
    near, scores = score(known.comparison_, known.references_, described, nearest, known.classifier_.scores)
    p = known.calibration().p_values(near, error_rate)
    labels = known_labels(known.classes_, scores, p, error_rate)
    unknown = np.flatnonzero([label is None for label in labels])
    proposals = _among_unknown(known, described, unknown, min_members)
    return Placement(labels, p.max(axis=1), proposals)


def _among_unknown(known: Recognizer, everything: Described, unknown: NDArray[np.intp], min_members: int) -> Proposals:
    """Kinds among the unknown; where they are many, among a spread sample, which the others join by their nearest."""
    n = len(unknown)
    if n < min_members:
        none = np.full(n, -1, dtype=np.intp)
        return _at(unknown, describe_clusters(np.eye(n), none, np.empty(0), known.widths_), len(everything))
    described = everything.take(unknown)
    limit, similarity = largest_clustered(everything.n_dims), known.comparison_.similarity
    if n <= limit:
        return _at(unknown, _that_agree(known, described, min_members)[1], len(everything))
    sample, _ = spread_sample(described, limit)
    K, found = _that_agree(known, described.take(sample), min_members)
    return _at(unknown, assign(described, sample, K, found, similarity), len(everything))


def _that_agree(known: Recognizer, described: Described, min_members: int) -> tuple[Array, Proposals]:
    """Similarities, and clusters by average linkage up to where movements of one symbol agree."""
    K = compare(known.comparison_.similarity, described, described)
    np.fill_diagonal(K, 1.0)
    order, height = own_order(K), 1.0 - agreement(known)

    def cut(distances: Array) -> Clusters:
        return cut_at(average_linkage(distances), height)

    distances = 1.0 - 0.5 * (K + K.T)[np.ix_(order, order)]
    found = without_small(cut(distances), min_members)
    clusters = np.empty(len(described), dtype=np.intp)
    clusters[order] = found
    return K, describe_clusters(K, clusters, stabilities(distances, found, cut, _REPEATS), known.widths_)


def agreement(known: Recognizer) -> float:
    """Mean similarity from which on movements are of one kind, as the symbols of a recognizer have it.

    Half way from the typical mean similarity within a symbol to that with the nearest other symbol; where each symbol
    was shown once, that at 0.6 of the distance to the nearest other, as the recognizer's calibration takes.
    """
    stored = known.references_.described
    some = evenly_spaced(len(stored), 500)
    K = compare(known.comparison_.similarity, stored.take(some), stored.take(some))
    own, member = known.references_.labels[some], np.unique(known.references_.labels[some], return_inverse=True)[1]
    np.fill_diagonal(K, 0.0)
    H = (member[:, None] == np.arange(member.max() + 1)).astype(float)
    sums, counts = H.T @ K @ H, H.sum(axis=0)
    means = sums / np.maximum(np.outer(counts, counts) - np.diag(counts), 1.0)
    others = np.where(np.eye(len(counts), dtype=bool), -1.0, means).max(axis=1)
    apart = float(np.median(others)) if len(counts) > 1 else 0.0
    several = counts > 1
    if several.any():
        return 0.5 * (float(np.median(np.diag(means)[several])) + apart)
    nearest = np.where(own[:, None] == own, 0.0, K).max(axis=1)
    reach = REACH * in_widths(np.log(np.maximum(nearest, np.finfo(float).tiny)))
    return float(np.exp(-0.5 * np.median(reach) ** 2))


def _at(places: NDArray[np.intp], proposals: Proposals, n: int) -> Proposals:
    """The same proposals, of movements at these places among n."""
    clusters = np.full(n, -1, dtype=np.intp)
    clusters[places] = proposals.clusters
    moved = (replace(one, members=places[one.members], medoid=int(places[one.medoid])) for one in proposals.proposals)
    return Proposals(tuple(moved), clusters, proposals.widths)
