"""Review the symbols of a library: which could be merged, and which could be split."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kineme.anchoring.proposals.merge_split import Merge, Split, suggest_merges, suggest_splits
from kineme.library.recognition.members import described
from kineme.library.storage.store import Store
from kineme.library.symbols.some_members import evenly_many_members


@dataclass(frozen=True)
class Review:
    """Symbols that could be merged, and symbols that could be split.

    Attributes
    ----------
    merges : tuple of Merge
        See `kineme.anchoring.suggest_merges`.
    splits : tuple of Split
        See `kineme.anchoring.suggest_splits`; the parts are ids of movements.
    """

    merges: tuple[Merge, ...]
    splits: tuple[Split, ...]


def review(store: Store) -> Review:
    """Compare at most 3000 members of symbols; see `ActionLibrary.review`."""
    ids, labels = evenly_many_members(store)
    if len(np.unique(labels)) < 2:
        return Review((), ())
    members, like = described(store, ids), store.specification.comparison
    splits = suggest_splits(members, labels, like=like)
    return Review(
        suggest_merges(members, labels, like=like),
        tuple(one._replace(parts=(ids[one.parts[0]], ids[one.parts[1]])) for one in splits),
    )
