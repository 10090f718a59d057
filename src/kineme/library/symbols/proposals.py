"""Proposals of symbols for unlabeled movements, to be named by a person."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.anchoring.proposals.assign import assign_described
from kineme.anchoring.proposals.proposals import Proposal, Proposals
from kineme.anchoring.proposals.propose import DEFAULT_METHOD
from kineme.anchoring.proposals.propose import propose as propose_clusters
from kineme.errors import SpecificationError
from kineme.library.recognition.members import described, groups_of
from kineme.library.storage import changes, read
from kineme.library.storage.read import Ids
from kineme.library.storage.store import Store, history
from kineme.library.symbols.recognized import Recognized, known_symbols

_SAME = 0.8  # share of members in a rejected proposal from which on a proposal counts as the same


@dataclass(frozen=True, eq=False)
class LibraryProposals:
    """Proposals of symbols for movements of a library.

    Indexing gives a `Proposal` whose members and medoid are ids of movements.

    Attributes
    ----------
    ids : ndarray of shape (n,)
        The movements that were considered.
    by_position : Proposals
        The same with positions among `ids`, for the pictures of `kineme.anchoring`.
    """

    ids: Ids
    by_position: Proposals

    def __len__(self) -> int:
        return len(self.by_position)

    def __getitem__(self, index: int) -> Proposal:
        one = self.by_position[index]
        return replace(one, members=self.ids[one.members], medoid=int(self.ids[one.medoid]))

    def __iter__(self) -> Iterator[Proposal]:
        return (self[index] for index in range(len(self)))

    @property
    def left_over(self) -> Ids:
        """Movements in no proposal."""
        return self.ids[self.by_position.left_over]

    def __repr__(self) -> str:
        clusters = "1 cluster" if len(self) == 1 else f"{len(self)} clusters"
        return f"LibraryProposals({clusters} among {len(self.ids)} movements, {len(self.left_over)} left over)"


def propose(
    store: Store,
    ids: ArrayLike | None = None,
    method: str | None = None,
    n_clusters: int | None = None,
    min_members: int = 3,
    joining: Recognized | None = None,
) -> LibraryProposals:
    """Propose symbols for movements; see `ActionLibrary.propose`.

    Parameters
    ----------
    store : Store
    ids : array_like of int, optional
        By default the movements without a symbol that are not in `joining`.
    method, n_clusters, min_members
        As for `kineme.anchoring.propose`.
    joining : Recognized, optional
        Movements to leave out, and what is known of the symbols.
    """
    joining = Recognized() if joining is None else joining
    chosen = (
        np.setdiff1d(read.unlabeled_ids(store), joining.all_ids())
        if ids is None
        else np.unique(np.asarray(ids, dtype=np.int64))
    )
    if len(chosen) < 3:
        return LibraryProposals(chosen, Proposals((), np.full(len(chosen), -1, dtype=np.intp), np.empty(0)))
    chosen = read.as_ids(store, chosen)
    by_symbols = ids is None and method is None and n_clusters is None
    known = joining.known or known_symbols(store) if by_symbols else None
    if known is not None:
        members = described(store, chosen, known.comparison)
        proposals = assign_described(members, known, min_members=min_members).proposals
    else:
        members, like = described(store, chosen), store.specification.comparison
        how = method or DEFAULT_METHOD
        people = groups_of(store, chosen)
        proposals = propose_clusters(members, how, n_clusters, groups=people, min_members=min_members, like=like)
    if ids is None:
        proposals = _without(proposals, _rejected_before(store, chosen))
    return LibraryProposals(chosen, proposals)


def accept(store: Store, proposal: Proposal, name: str, description: str | None = None) -> int:
    """Assign the members of a proposal to a symbol; return the version. See `ActionLibrary.accept`."""
    members = np.intersect1d(proposal.members, read.unlabeled_ids(store))
    if not len(members):
        raise SpecificationError(
            f"expected movements without a symbol, all {len(proposal.members)} of this proposal show one by now; "
            "propose again"
        )
    return changes.assign(store, members, name, "anchored", proposal.medoid, description)


def reject(store: Store, proposal: Proposal) -> int:
    """Store that these movements are no symbol; return the version. See `ActionLibrary.reject`."""
    with store.writing("reject", {"movements": proposal.members.tolist()}) as change:
        pass
    return change.version


def _rejected_before(store: Store, ids: Ids) -> list[NDArray[np.intp]]:
    """Positions among `ids` of rejected movements, per rejection."""
    rejected = [one.detail.get("movements", []) for one in history(store) if one.action == "reject"]
    return [np.flatnonzero(np.isin(ids, one)) for one in rejected]


def _without(proposed: Proposals, rejected: list[NDArray[np.intp]]) -> Proposals:
    """The proposals that do not repeat a rejected one, renumbered."""
    kept = [
        k
        for k, one in enumerate(proposed.proposals)
        if not any(np.isin(one.members, positions).mean() >= _SAME for positions in rejected)
    ]
    number = np.full(len(proposed) + 1, -1, dtype=np.intp)
    number[kept] = np.arange(len(kept))
    proposals = tuple(
        replace(one, nearest=None if one.nearest is None or number[one.nearest] < 0 else int(number[one.nearest]))
        for one in (proposed.proposals[k] for k in kept)
    )
    return Proposals(proposals, number[proposed.clusters], proposed.widths)
