"""Proposals of symbols: clusters of movements for a person to name, of a subsample where they are many."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.similarity.described import Described
from kineme.similarity.similarity import AveragedSimilarity, averaged, compare
from kineme.validation import Array

_WITHIN = 0.95  # of the sampled members of all clusters are within the common radius of their nearest neighbor
_TILE = 20_000  # movements at a time


@dataclass(frozen=True, eq=False)
class Proposal:
    """A cluster of movements that could be one symbol.

    Attributes
    ----------
    members : ndarray of shape (m,)
        Indices of the movements, ascending.
    medoid : int
        Index of the member most similar to the others.
    cohesion : float
        Mean similarity of two members, from 0 to 1.
    stability : float
        How well the cluster comes again when a fifth of the movements is left out: mean Jaccard coefficient, from 0 to
        1; 0.75 and more is a valid cluster to Hennig (2007).
    nearest : int or None
        Index of the proposal most similar to this one.
    nearness : float
        Mean similarity of its members to these.
    """

    members: NDArray[np.intp]
    medoid: int
    cohesion: float
    stability: float
    nearest: int | None
    nearness: float

    def __len__(self) -> int:
        return len(self.members)

    def __repr__(self) -> str:
        return (
            f"Proposal({len(self)} movements, medoid {self.medoid}, "
            f"cohesion {self.cohesion:.2f}, stability {self.stability:.2f})"
        )


@dataclass(frozen=True, eq=False)
class Proposals:
    """Proposals, the largest first, and what is left over.

    Attributes
    ----------
    proposals : tuple of Proposal
    clusters : ndarray of shape (n,)
        Index of the proposal of each movement, -1 for those left over.
    widths : ndarray of shape (R,)
        Of the kernels that they were compared with.
    """

    proposals: tuple[Proposal, ...]
    clusters: NDArray[np.intp]
    widths: Array

    @property
    def left_over(self) -> NDArray[np.intp]:
        """Indices of the movements in no proposal, ascending."""
        return np.flatnonzero(self.clusters < 0)

    def __len__(self) -> int:
        return len(self.proposals)

    def __iter__(self) -> Iterator[Proposal]:
        return iter(self.proposals)

    def __getitem__(self, index: int) -> Proposal:
        if not -len(self) <= index < len(self):
            raise IndexError(f"expected the index of one of {len(self)} proposals, got {index}")
        return self.proposals[index]

    def __repr__(self) -> str:
        return f"Proposals({len(self)} clusters among {len(self.clusters)} movements, {len(self.left_over)} left over)"


def describe_clusters(K: Array, clusters: NDArray[np.intp], stabilities: Array, widths: Array) -> Proposals:
    """Proposals, the largest first, of clusters of movements whose similarities K (n, n) are given."""
    c = int(clusters.max(initial=-1)) + 1
    sizes = np.bincount(clusters[clusters >= 0], minlength=c)
    seed = np.array([np.flatnonzero(clusters == k)[0] for k in range(c)], dtype=np.intp)
    order = np.lexsort((seed, -sizes))
    rank = np.append(np.argsort(order), -1)
    ranked = rank[clusters]
    H = (ranked[:, None] == np.arange(c)).astype(np.float64)
    sums = K @ H  # of each movement to each cluster
    between = (H.T @ sums) / np.maximum(np.outer(H.sum(0), H.sum(0)), 1.0)
    np.fill_diagonal(between, -1.0)
    proposals = []
    for k in range(c):
        members, m = np.flatnonzero(ranked == k), sizes[order[k]]
        inside = sums[members, k] - 1.0
        near = int(between[k].argmax()) if c > 1 else None
        proposals.append(
            Proposal(
                members,
                int(members[inside.argmax()]),
                float(inside.sum() / max(m * (m - 1), 1)),
                float(stabilities[order[k]]),
                near,
                0.0 if near is None else float(between[k, near]),
            )
        )
    return Proposals(tuple(proposals), ranked, widths)


def check_members(proposal: Proposal, n: int) -> None:
    """Refuse a proposal made of more movements than are given."""
    if len(proposal.members) and proposal.members[-1] >= n:
        raise SpecificationError(
            f"expected the movements that the proposal was made from, at least {proposal.members[-1] + 1}, got {n}"
        )


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
    """Return how far ``1 - K`` a movement of each cluster may be from its nearest member, shape (c,).

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
    return np.array([max(common, float(away[proposal.members].max())) for proposal in proposals.proposals])
