"""Assign movements without a symbol to the symbols that they are recognized as."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kineme.library.recognition.members import described, described_references, groups_of
from kineme.library.storage import changes, read
from kineme.library.storage.read import Ids
from kineme.library.storage.store import Store
from kineme.library.storage.symbols import symbols
from kineme.library.symbols.some_members import evenly_many_members
from kineme.recognition.known_classes import KnownClasses, fit_known_classes, open_set_labels


@dataclass(frozen=True, eq=False)
class Recognized:
    """Movements without a symbol that are recognized as one.

    Attributes
    ----------
    ids : dict
        Name of a symbol -> ids of the movements.
    known : KnownClasses or None
        By what they were recognized; None if there was nothing to recognize, or no symbol.
    """

    ids: dict[str, Ids] = field(default_factory=dict)
    known: KnownClasses | None = None

    def all_ids(self) -> Ids:
        """Ids of all recognized movements."""
        return np.concatenate([np.empty(0, dtype=np.int64), *self.ids.values()])


def known_symbols(store: Store) -> KnownClasses | None:
    """What recognizes the symbols, fitted to at most 3000 of their movements; None without any."""
    if not any(map(len, symbols(store))):
        return None
    ids, labels = evenly_many_members(store)
    how, references = store.specification, described_references(store, ids, labels)
    return fit_known_classes(
        how.comparison, references, how.weights, how.classifier, groups_of(store, ids), store.channels
    )


def recognized(store: Store, error_rate: float = 0.05) -> Recognized:
    """Recognize the movements without a symbol; nothing is changed."""
    unlabeled = read.unlabeled_ids(store)
    known = known_symbols(store) if len(unlabeled) else None
    if known is None:
        return Recognized()
    names = open_set_labels(known, described(store, unlabeled, known.comparison), error_rate)[0].tolist()
    ids = {
        str(name): unlabeled[np.array([one == name for one in names])]
        for name in dict.fromkeys(name for name in names if name is not None)
    }
    return Recognized(ids, known)


def assign_recognized(store: Store, joining: Recognized) -> dict[str, int]:
    """Assign movements to the symbols that they are recognized as; how many to each."""
    for name, members in joining.ids.items():
        changes.assign(store, members, name, "recognized")
    return {name: len(members) for name, members in joining.ids.items()}
