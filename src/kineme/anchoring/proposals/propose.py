"""From movements without labels to proposals of symbols."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kineme.anchoring.clustering.clustering import METHODS, Clusters
from kineme.anchoring.clustering.number_of_clusters import count_clusters
from kineme.anchoring.clustering.stability import stabilities
from kineme.anchoring.proposals.proposals import Proposals, describe_clusters
from kineme.anchoring.proposals.subsample import extend, largest_clustered, subsample
from kineme.comparison.describe import describe
from kineme.comparison.described import Described
from kineme.comparison.similarity import AveragedSimilarity, averaged, similarities
from kineme.comparison.specification import Compares
from kineme.errors import SpecificationError
from kineme.movements.trajectories.movements_like import MovementsLike
from kineme.validation import Array, check_choice, check_count

_REPEATS = 20  # subsets that clusters must come again in


def propose(
    movements: MovementsLike | Described,
    method: str = "agglomerative",
    n_clusters: int | None = None,
    *,
    min_members: int = 3,
    like: Compares | None = None,
    max_clustered: int | None = None,
) -> Proposals:
    """Cluster movements without labels.

    Distances are ``1 - K`` of the averaged kernel at `gap_widths`: bounded, so that what is far is just far.

    Parameters
    ----------
    movements : Described, or movements as `Demonstrations.of` accepts them
        At least three.
    method : {"agglomerative", "hdbscan"}, default "agglomerative"
        Average linkage, cut into `n_clusters`; or clusters of density (HDBSCAN), which find their number themselves.
    n_clusters : int, optional
        Number of clusters of the tree, those too small to be proposed included; by default
        `count_clusters`, at least two: whether all movements are one cluster cannot be told from their own distances.
    min_members : int, default 3
        Movements of a proposal, at least; smaller clusters are left over.
    like : Recognizer, Comparison or ComparisonSpecification, optional
        Whose representations, invariances and mean to take; it need not be fitted.
    max_clustered : int, optional
        More movements than this are clustered by a subsample of so many; each of the others is added to the cluster of
        its nearest neighbor in the subsample if it is within the radius of that cluster, else it is left over. By
        default 5000, in space 800.

    Returns
    -------
    Proposals

    Raises
    ------
    SpecificationError
        Parameters out of range, fewer than three movements, or copies of one movement.
    """
    check_choice("method", method, list(METHODS))
    check_count("min_members", min_members, 2)
    described = describe(movements, like)
    _check_count_of(n_clusters, method, len(described))
    limit = largest_clustered(described.n_dims) if max_clustered is None else max_clustered
    check_count("max_clustered", limit, 3)
    if len(described) <= limit:
        similarity = averaged(described)
        K = similarities(described, widths=similarity.widths)
        return _propose(K, similarity, method, n_clusters, min_members)
    sample, similarity = subsample(described, limit)
    K = similarities(described.take(sample), widths=similarity.widths)
    proposals = _propose(K, similarity, method, n_clusters, min_members)
    return extend(described, sample, K, proposals, similarity)


def _check_count_of(n_clusters: int | None, method: str, n: int) -> None:
    if n_clusters is None:
        return
    check_count("n_clusters", n_clusters, 1)
    if method != "agglomerative":
        raise SpecificationError(f"expected no n_clusters with method={method!r}, got {n_clusters!r}; it finds its own")
    if n_clusters > n:
        raise SpecificationError(f"expected n_clusters of at most {n}, the number of movements, got {n_clusters!r}")


def _propose(
    K: Array, similarity: AveragedSimilarity, method: str, n_clusters: int | None, min_members: int
) -> Proposals:
    order = own_order(K)
    distances = 1.0 - K[np.ix_(order, order)]
    clusters, share = np.empty(len(K), dtype=np.intp), n_clusters or 0
    if method == "agglomerative" and n_clusters is None:
        share = count_clusters(distances, _REPEATS)

    def again(some: Array) -> Clusters:
        return METHODS[method](some, share, 1 if method == "agglomerative" else min_members)

    ordered = METHODS[method](distances, share, min_members)
    clusters[order] = ordered
    return describe_clusters(K, clusters, stabilities(distances, ordered, again, _REPEATS), similarity.widths)


def own_order(K: Array) -> NDArray[np.intp]:
    """An order of the movements by their similarities, so that the result does not depend on that of the input."""
    return np.argsort(K.sum(axis=1), kind="stable")
