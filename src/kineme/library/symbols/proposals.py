"""Anchoring in a library: kinds of movement among those without a symbol, for a person to name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.anchoring.proposals.assign import place
from kineme.anchoring.proposals.merge_split import Merge, Split, suggest_merges, suggest_splits
from kineme.anchoring.proposals.proposals import Proposal, Proposals
from kineme.anchoring.proposals.propose import propose
from kineme.comparison.describe import describe_rows
from kineme.comparison.sampling import evenly_spaced
from kineme.errors import SpecificationError
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.labels import label_array
from kineme.recognition.recognizer import Recognizer

if TYPE_CHECKING:
    from kineme.library.library import ActionLibrary

Ids = NDArray[np.int64]

_AGAIN = 0.8  # of a proposal's members in one that was rejected: it is the same one
_KNOWN = 3000  # movements of symbols that new ones are compared with, at most, evenly many of each symbol


@dataclass(frozen=True, eq=False)
class LibraryProposals:
    """Proposals of kinds among movements of a library.

    Indexing gives a `Proposal` whose members and medoid are ids of movements.

    Attributes
    ----------
    ids : ndarray of shape (n,)
        The movements looked at.
    found : Proposals
        The same in places among `ids`, as the pictures of `kineme.anchoring` want them.
    """

    ids: Ids
    found: Proposals

    def __len__(self) -> int:
        return len(self.found)

    def __getitem__(self, index: int) -> Proposal:
        one = self.found[index]
        return replace(one, members=self.ids[one.members], medoid=int(self.ids[one.medoid]))

    @property
    def left_over(self) -> Ids:
        """Movements in no proposal."""
        return self.ids[self.found.left_over]

    def __repr__(self) -> str:
        kinds = "1 kind" if len(self) == 1 else f"{len(self)} kinds"
        return f"LibraryProposals({kinds} of {len(self.ids)} movements, {len(self.left_over)} left over)"

    def movements(self, library: ActionLibrary) -> Demonstrations:
        """The recordings, for the pictures."""
        return library.movements(ids=self.ids)


def propose_kinds(
    library: ActionLibrary,
    ids: Any = None,
    method: str | None = None,
    n_clusters: int | None = None,
    min_members: int = 3,
    leave: ArrayLike = (),
) -> LibraryProposals:
    """Kinds among the movements without a symbol but those to `leave`, or among `ids`; see `ActionLibrary.propose`."""
    chosen = (
        np.setdiff1d(library.unlabeled(), np.asarray(leave, dtype=np.int64))
        if ids is None
        else np.unique(np.asarray(ids, dtype=np.int64))
    )
    if len(chosen) < 3:
        return LibraryProposals(chosen, Proposals((), np.full(len(chosen), -1, dtype=np.intp), np.empty(0)))
    if ids is None and method is None and n_clusters is None and library.symbols():
        found = place(library.movements(ids=chosen), known_recognizer(library), min_members=min_members).proposals
    else:
        like = library.specification.recognizer()
        described = describe_rows(library.features(chosen), library.n_dims or 0, like)
        found = propose(described, method or "agglomerative", n_clusters, min_members=min_members, like=like)
    return LibraryProposals(chosen, _without(found, _rejected_before(library, chosen)) if ids is None else found)


def joinable(library: ActionLibrary, error_rate: float = 0.05) -> dict[str, Ids]:
    """Name of a symbol -> the movements without one that are recognized as it."""
    waiting = library.unlabeled()
    if not len(waiting) or not any(map(len, library.symbols())):
        return {}
    names = known_recognizer(library).predict_known(library.movements(ids=waiting), error_rate)
    return {
        str(name): waiting[np.array([one == name for one in names])]
        for name in dict.fromkeys(name for name in names if name is not None)
    }


def join_symbols(library: ActionLibrary, error_rate: float = 0.05) -> dict[str, int]:
    """Let movements without a symbol join those that they are recognized as; see `ActionLibrary.join`."""
    return join(library, joinable(library, error_rate))


def join(library: ActionLibrary, found: Mapping[str, Ids]) -> dict[str, int]:
    """Let movements join symbols, as `joinable` has found them; how many joined each."""
    for name, members in found.items():
        library.assign(members, name, "recognized")
    return {name: len(members) for name, members in found.items()}


def known_recognizer(library: ActionLibrary) -> Recognizer:
    """A recognizer of the symbols, fitted to at most 3000 of their movements, evenly many of each symbol."""
    ids, labels = some_of_each(library)
    return library.specification.recognizer().fit(library.movements(ids=ids), labels)


def accept(library: ActionLibrary, proposal: Proposal, name: str, description: str | None = None) -> None:
    """Let the members of a proposal show a symbol; see `ActionLibrary.accept`."""
    members = np.intersect1d(proposal.members, library.unlabeled())
    if not len(members):
        raise SpecificationError(
            f"expected movements without a symbol, all {len(proposal.members)} of this proposal show one by now; "
            "propose again"
        )
    new = name not in library
    library.assign(members, name, "anchored")
    if new and proposal.medoid in members:
        library.describe(name, description, prototype=proposal.medoid)
    elif description is not None:
        library.describe(name, description)


def reject(library: ActionLibrary, proposal: Proposal) -> None:
    """Remember that these movements are no kind; see `ActionLibrary.reject`."""
    with library.store.writing("reject", {"movements": proposal.members.tolist()}):
        pass


def _rejected_before(library: ActionLibrary, ids: Ids) -> list[NDArray[np.intp]]:
    """Places among `ids` of what was rejected, per rejection."""
    rejected = [one.detail.get("movements", []) for one in library.history() if one.action == "reject"]
    return [np.flatnonzero(np.isin(ids, one)) for one in rejected]


def _without(found: Proposals, rejected: list[NDArray[np.intp]]) -> Proposals:
    """The proposals that are not a rejected one again, renumbered."""
    kept = [
        k
        for k, one in enumerate(found.proposals)
        if not any(np.isin(one.members, places).mean() >= _AGAIN for places in rejected)
    ]
    number = np.full(len(found) + 1, -1, dtype=np.intp)
    number[kept] = np.arange(len(kept))
    proposals = tuple(
        replace(one, nearest=None if one.nearest is None or number[one.nearest] < 0 else int(number[one.nearest]))
        for one in (found.proposals[k] for k in kept)
    )
    return Proposals(proposals, number[found.clusters], found.widths)


@dataclass(frozen=True)
class Review:
    """Symbols that could be one, and symbols that are of two kinds.

    Attributes
    ----------
    merges : tuple of Merge
        See `kineme.anchoring.suggest_merges`.
    splits : tuple of Split
        See `kineme.anchoring.suggest_splits`; the parts are ids of movements.
    """

    merges: tuple[Merge, ...]
    splits: tuple[Split, ...]


def review_symbols(library: ActionLibrary) -> Review:
    """Look at the symbols again, at most 3000 movements of them; see `ActionLibrary.review`."""
    ids, labels = some_of_each(library)
    if len(np.unique(labels)) < 2:
        return Review((), ())
    like = library.specification.recognizer()
    described = describe_rows(library.features(ids), library.n_dims or 0, like)
    splits = suggest_splits(described, labels, like=like)
    return Review(
        suggest_merges(described, labels, like=like),
        tuple(one._replace(parts=(ids[one.parts[0]], ids[one.parts[1]])) for one in splits),
    )


def some_of_each(library: ActionLibrary) -> tuple[Ids, NDArray[Any]]:
    """At most 3000 movements that show a symbol, evenly many of each, and the names of their symbols."""
    symbols = [symbol for symbol in library.symbols() if len(symbol)]
    share = max(1, _KNOWN // max(1, len(symbols)))
    some = [one.members[evenly_spaced(len(one), share)] for one in symbols]
    labels = np.repeat(label_array([one.name for one in symbols]), [len(members) for members in some])
    return np.concatenate([np.empty(0, dtype=np.int64), *some]), labels
