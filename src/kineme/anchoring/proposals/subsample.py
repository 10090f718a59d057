"""More movements than can be compared with each other: a subsample is clustered, and the others follow it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kineme.anchoring.proposals.proposals import Proposals
from kineme.similarity.described import Described
from kineme.similarity.similarity import AveragedSimilarity, averaged, compare
from kineme.validation import Array

_WITHIN = 0.95  # of the sampled members of all clusters are within the common radius of their nearest neighbor
_TILE = 20_000  # movements at a time


def largest_clustered(n_dims: int) -> int:
    """Movements that are all compared with each other by default; in space a pair costs a decomposition."""
    return 800 if n_dims == 3 else 5000


def subsample(described: Described, size: int, seed: int = 0) -> tuple[NDArray[np.intp], AveragedSimilarity]:
    """Ascending indices of `size` movements of all clusters, rare ones too; and the similarity at their widths.

    Half are drawn evenly. The others are drawn with probability proportional to ``1 - K`` to the nearest of these, the
    squared distance in the kernel's space up to a factor: one round of k-means|| (Bahmani et al., "Scalable
    k-means++", PVLDB 5, 2012). A cluster too rare for the first half is far from it, so the second half finds it.
    """
    random = np.random.default_rng(seed)
    first = random.choice(len(described), size - size // 2, replace=False)
    far = 1.0 - nearest_neighbors(averaged(described.take(first)), described, described.take(first))[1]
    far[first] = 0.0
    candidates = np.flatnonzero(far > 0)
    second = candidates  # usually more than are wanted
    if len(candidates) > size // 2:
        second = random.choice(candidates, size // 2, replace=False, p=far[candidates] / far.sum())
    sample = np.sort(np.concatenate((first, second))).astype(np.intp)
    return sample, averaged(described.take(sample))


def nearest_neighbors(
    similarity: AveragedSimilarity, described: Described, others: Described
) -> tuple[NDArray[np.intp], Array]:
    """Index of the most similar of the others for each movement, and the similarity, (n,) each."""
    which, how = np.empty(len(described), dtype=np.intp), np.empty(len(described))
    for start in range(0, len(described), _TILE):
        rows = slice(start, start + _TILE)
        K = compare(similarity, described.take(rows), others)
        which[rows] = K.argmax(axis=1)
        how[rows] = K.max(axis=1)
    return which, how


def extend(
    described: Described, sample: NDArray[np.intp], K: Array, of_sample: Proposals, similarity: AveragedSimilarity
) -> Proposals:
    """The proposals of a sample, with the movements within the radius of their nearest neighbor's cluster added."""
    radius = np.append(radii(K, of_sample), -np.inf)  # nothing is added to what was left over
    which, how = nearest_neighbors(similarity, described, described.take(sample))
    clusters = of_sample.clusters[which]
    clusters[1.0 - how > radius[clusters]] = -1
    clusters[sample] = of_sample.clusters
    order = np.argsort(-np.bincount(clusters[clusters >= 0], minlength=len(of_sample)), kind="stable")
    rank = np.append(np.argsort(order), -1)
    clusters = rank[clusters]
    proposals = tuple(
        replace(
            of_sample[int(k)],
            members=np.flatnonzero(clusters == i),
            medoid=int(sample[of_sample[int(k)].medoid]),
            nearest=None if of_sample[int(k)].nearest is None else int(rank[of_sample[int(k)].nearest]),
        )
        for i, k in enumerate(order)
    )
    return Proposals(proposals, clusters, of_sample.widths)


def radii(K: Array, proposals: Proposals) -> Array:
    """How far ``1 - K`` a movement of each cluster may be from its nearest member, shape (c,).

    As far as any member is from its nearest neighbor in the cluster, so that another movement of the same class is
    beyond it once in m + 1 times; but at least as far as 95 % of the members of all clusters, since the largest of few
    distances says little.
    """
    same = (proposals.clusters[:, None] == proposals.clusters) & (proposals.clusters[:, None] >= 0)
    np.fill_diagonal(same, False)
    away = 1.0 - np.where(same, K, -np.inf).max(axis=1)
    member = proposals.clusters >= 0
    if not member.any():
        return np.empty(0)
    common = float(np.quantile(away[member], _WITHIN))
    return np.array([max(common, float(away[one.members].max())) for one in proposals.proposals])
