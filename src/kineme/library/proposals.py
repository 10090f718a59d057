"""Proposals of symbols for unlabeled movements, to be named by a person."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.anchoring import assignment
from kineme.anchoring.proposals import DEFAULT_METHOD, Proposal, Proposals
from kineme.anchoring.proposals import propose as propose_clusters
from kineme.errors import SpecificationError
from kineme.library.members import Members, described, groups_of, members_of, some_of_each
from kineme.library.recognize import known_members
from kineme.library.storage import changes, read
from kineme.library.storage.read import Ids
from kineme.library.storage.store import Store
from kineme.library.storage.undo import in_effect
from kineme.recognition.answer import KnownClasses, open_set_labels
from kineme.recognition.classifiers import MOST
from kineme.reporting.text import counted
from kineme.sampling import evenly_spaced
from kineme.similarity.describe import Described, recorded_values, values_count, with_recorded
from kineme.similarity.similarity import similarities
from kineme.similarity.specification import ComparisonSpecification

_TILE = 5000  # movements that are read at once
_MOST = 3000  # movements that are compared at most, equally many of each symbol

_DISCOVER = "discover"  # action of the versions that store proposals
_COMPARED = 20  # members of a stored proposal whose similarities are taken

_SAME = 0.8  # share of members in a rejected proposal from which on a proposal counts as the same


@dataclass(frozen=True, eq=False)
class LibraryProposals:
    """Proposals of symbols for movements of a library.

    Indexing gives a `Proposal` whose members and medoid are ids of movements. `ids` (n,) are the movements that were
    considered; `by_position` has positions among them, for the pictures of `kineme.anchoring`.
    """

    ids: Ids
    by_position: Proposals

    def __len__(self) -> int:
        return len(self.by_position)

    def __getitem__(self, index: int) -> Proposal:
        proposal = self.by_position[index]
        return replace(proposal, members=self.ids[proposal.members], medoid=int(self.ids[proposal.medoid]))

    def __iter__(self) -> Iterator[Proposal]:
        return (self[index] for index in range(len(self)))

    @property
    def left_over(self) -> Ids:
        """Movements in no proposal."""
        return self.ids[self.by_position.left_over]

    def __repr__(self) -> str:
        clusters = counted(len(self), "cluster")
        return f"LibraryProposals({clusters} among {len(self.ids)} movements, {len(self.left_over)} left over)"


def propose(
    store: Store,
    ids: ArrayLike | None = None,
    method: str | None = None,
    n_clusters: int | None = None,
    min_members: int = 3,
    joining: Recognized | None = None,
) -> LibraryProposals:
    """Propose symbols for movements but those `joining` one, by the classes there; see `ActionLibrary.propose`."""
    joining = Recognized() if joining is None else joining
    chosen = (
        np.setdiff1d(read.unlabeled_ids(store), joining.all_ids())
        if ids is None
        else np.unique(np.asarray(ids, dtype=np.int64))
    )
    if len(chosen) < 3:
        return LibraryProposals(chosen, Proposals((), np.full(len(chosen), -1, dtype=np.intp), np.empty(0)))
    chosen = read.as_ids(store, chosen)
    by_default = ids is None and method is None and n_clusters is None
    stored = _stored(store, chosen, min_members) if by_default else ()
    free = np.setdiff1d(np.arange(len(chosen)), np.concatenate([np.empty(0, int), *(each.members for each in stored)]))
    if len(free) >= 3 or not stored:
        classes = joining.classes or known_symbols(store) if by_default else None
        proposals = _clustered(store, chosen[free], classes, method, n_clusters, min_members)
    else:
        proposals = Proposals((), np.full(len(free), -1, dtype=np.intp), np.empty(0))
    if stored:
        proposals = _behind(stored, proposals, free, len(chosen))
    if ids is None:
        rejected = [version.detail.get("movements", []) for version in in_effect(store) if version.action == "reject"]
        now = read.returned_ids(store) if rejected else {}
        members = ([now.get(key, key) for key in keys] for keys in rejected)
        proposals = _without(proposals, [np.flatnonzero(np.isin(chosen, keys)) for keys in members])
    return LibraryProposals(chosen, proposals)


def _clustered(
    store: Store, ids: Ids, classes: KnownClasses | None, method: str | None, n_clusters: int | None, min_members: int
) -> Proposals:
    """Cluster movements: by how similar movements of known symbols are, where there are any."""
    if classes is not None:
        members = described_as_known(store, ids, classes)
        return assignment.assign_described(members, classes, min_members=min_members).proposals
    members, like, how = described(store, ids), store.specification.comparison, method or DEFAULT_METHOD
    members = _with_values(store, ids, members, like) if how == DEFAULT_METHOD else members
    return propose_clusters(members, how, n_clusters, groups=groups_of(store, ids), min_members=min_members, like=like)


def _with_values(store: Store, ids: Ids, features: Described, how: ComparisonSpecification) -> Described:
    """Add recorded values where they count; movements are read for that, some at a time."""
    if not values_count(features, how):
        return features
    tiles = (read.movements(store, ids[start : start + _TILE]) for start in range(0, len(ids), _TILE))
    values = np.concatenate([recorded_values(tile, 0, len(tile)) for tile in tiles])
    return with_recorded(features, values, store.channels)


@dataclass(frozen=True, eq=False)
class NamedProposal:
    """A proposal as it is stored: a name, ids of movements, the most typical one, and how certain they belong to it."""

    name: str
    members: Ids
    medoid: int
    certainty: float  # mean probability of the members


def store_proposals(
    store: Store, proposals: Sequence[NamedProposal], held: Sequence[int] = (), continues: int | None = None
) -> int:
    """Store proposals, which `propose` gives before all others, instead of those stored before; return the version.

    `held` are those of their movements that the library held already, not from a discovery; `continues` is the version
    that the same call made before.
    """
    detail = {
        "names": [proposal.name for proposal in proposals],
        "sizes": [len(proposal.members) for proposal in proposals],
        "medoids": [int(proposal.medoid) for proposal in proposals],
        "certainties": [round(float(proposal.certainty), 4) for proposal in proposals],
        "movements": [int(key) for proposal in proposals for key in proposal.members],
        "held": [int(key) for key in held],
    }
    with store.writing(_DISCOVER, detail) as change:
        changes.continue_from(change, continues)
    return change.version


def discovered_ids(store: Store) -> Ids:
    """Return ids of the movements that discoveries brought, and nothing else, as far as that was not taken back."""
    brought: set[int] = set()
    for version in in_effect(store):
        if version.action == _DISCOVER:  # those of earlier programs do not say what was held
            brought |= {*version.detail["movements"]} - {*version.detail.get("held", version.detail["movements"])}
    now = read.returned_ids(store) if brought else {}
    return np.intersect1d(read.all_ids(store), np.array([now.get(key, key) for key in brought], dtype=np.int64))


def stored_proposals(store: Store) -> list[NamedProposal]:
    """Return the proposals that were stored last, as far as that was not taken back."""
    detail = next((version.detail for version in in_effect(store) if version.action == _DISCOVER), None)
    if detail is None:
        return []
    now = read.returned_ids(store)
    ids = np.array([now.get(key, key) for key in (*detail["movements"], *detail["medoids"])], dtype=np.int64)
    *parts, medoids = np.split(ids, np.cumsum(detail["sizes"], dtype=np.intp))
    rows = zip(detail["names"], parts, medoids.tolist(), detail["certainties"], strict=True)
    return [NamedProposal(*row) for row in rows]


def _stored(store: Store, chosen: Ids, min_members: int) -> tuple[Proposal, ...]:
    """Return what is left of stored proposals, with positions among the chosen movements (ascending ids)."""
    names, parts, medoids, certainties = [], [], [], []
    for proposal in stored_proposals(store):
        members = np.flatnonzero(np.isin(chosen, proposal.members))
        if len(members) >= min_members:
            medoid = int(np.searchsorted(chosen, proposal.medoid))
            names.append(proposal.name)
            parts.append(members)
            medoids.append(medoid if medoid in members else int(members[0]))
            certainties.append(proposal.certainty)
    if not parts:
        return ()
    some = [members[evenly_spaced(len(members), _COMPARED)] for members in parts]
    K = similarities(described(store, chosen[np.concatenate(some)]))
    means, _ = assignment.mean_similarities(K, np.repeat(np.arange(len(some)), [len(members) for members in some]))
    within = np.diag(means).copy()
    np.fill_diagonal(means, -1.0)
    alone = len(parts) == 1
    return tuple(
        Proposal(
            members, medoids[k], float(within[k]), certainties[k], None if alone else int(means[k].argmax()),
            0.0 if alone else float(means[k].max()), names[k],
        )
        for k, members in enumerate(parts)
    )  # fmt: skip


def _behind(stored: Sequence[Proposal], others: Proposals, free: NDArray[np.intp], n: int) -> Proposals:
    """Return stored proposals among n movements, and behind them the others, which are among those at `free`."""
    first, others = len(stored), assignment.at_indices(free, others, n)
    clusters = np.where(others.clusters < 0, -1, others.clusters + first)
    for k, proposal in enumerate(stored):
        clusters[proposal.members] = k
    behind = (
        replace(proposal, nearest=None if proposal.nearest is None else proposal.nearest + first)
        for proposal in others.proposals
    )
    return Proposals((*stored, *behind), clusters, others.widths)


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


def _without(proposed: Proposals, rejected: list[NDArray[np.intp]]) -> Proposals:
    """Return the proposals that do not repeat a rejected one, renumbered."""
    remaining = [
        k
        for k, proposal in enumerate(proposed.proposals)
        if not any(np.isin(proposal.members, positions).mean() >= _SAME for positions in rejected)
    ]
    number = np.full(len(proposed) + 1, -1, dtype=np.intp)
    number[remaining] = np.arange(len(remaining))
    proposals = tuple(
        replace(
            proposal,
            nearest=None if proposal.nearest is None or number[proposal.nearest] < 0 else int(number[proposal.nearest]),
        )
        for proposal in (proposed.proposals[k] for k in remaining)
    )
    return Proposals(proposals, number[proposed.clusters], proposed.widths)


@dataclass(frozen=True, eq=False)
class Recognized:
    """Movements without a symbol that are recognized as one."""

    ids: dict[str, Ids] = field(default_factory=dict)  # name of a symbol -> ids of the movements
    classes: KnownClasses | None = None  # what they were recognized by; None if there was nothing to recognize

    def all_ids(self) -> Ids:
        """Return ids of all recognized movements."""
        return np.concatenate([np.empty(0, dtype=np.int64), *self.ids.values()])


def some_members(store: Store) -> Members | None:
    """Choose at most 3000 members of symbols, equally many of each; None without any."""
    if not store.counts.members:
        return None
    members = members_of(store)
    return some_of_each(members, max(1, _MOST // len(members.names)))


def known_symbols(store: Store) -> KnownClasses | None:
    """Fit the recognition of symbols to at most 3000 of their movements; None without any."""
    members = some_members(store)
    if members is None:
        return None
    return known_members(store, members, in_memory=len(members.ids) <= MOST, kernels_alone=False)


def described_as_known(store: Store, ids: Ids, classes: KnownClasses) -> Described:
    """Describe movements as those of known symbols are: they are read for recorded values, if these have some."""
    features = described(store, ids, classes.comparison)
    if classes.references.described.values is None:
        return features
    return _with_values(store, ids, features, classes.comparison.specification)


def recognized(store: Store, error_rate: float = 0.05) -> Recognized:
    """Recognize the movements without a symbol; nothing is changed."""
    named = [np.empty(0, dtype=np.int64), *(proposal.members for proposal in stored_proposals(store))]
    unlabeled = np.setdiff1d(read.unlabeled_ids(store), np.concatenate(named))  # those know their kind better
    classes = known_symbols(store) if len(unlabeled) else None
    if classes is None:
        return Recognized()
    names = open_set_labels(classes, described_as_known(store, unlabeled, classes), error_rate)[0].tolist()
    ids = {
        str(name): unlabeled[np.array([label == name for label in names])]
        for name in dict.fromkeys(name for name in names if name is not None)
    }
    return Recognized(ids, classes)


def assign_recognized(store: Store, joining: Recognized) -> dict[str, int]:
    """Assign movements to the symbols that they are recognized as; how many to each."""
    for name, members in joining.ids.items():
        changes.assign(store, members, name, "recognized")
    return {name: len(members) for name, members in joining.ids.items()}


@dataclass(frozen=True)
class Review:
    """Symbols that could be merged, and symbols that could be split.

    See `kineme.anchoring.suggest_merges` and `suggest_splits`; the parts of these are ids of movements.
    """

    merges: tuple[assignment.Merge, ...]
    splits: tuple[assignment.Split, ...]


def review(store: Store) -> Review:
    """Compare at most 3000 members of symbols; see `ActionLibrary.review`."""
    members = some_members(store)
    if members is None or len(members.names) < 2:
        return Review((), ())
    ids, labels, like = members.ids, members.labels, store.specification.comparison
    movements = described(store, ids)
    splits = assignment.suggest_splits(movements, labels, like=like)
    return Review(
        assignment.suggest_merges(movements, labels, like=like),
        tuple(split._replace(parts=(ids[split.parts[0]], ids[split.parts[1]])) for split in splits),
    )
