"""What anchoring proposes: clusters of movements, for a person to name."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.validation import Array


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
