"""Assign movements without a symbol to the symbols that they are recognized as."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kineme.library.storage import changes, read
from kineme.library.storage.read import Ids
from kineme.library.storage.store import Store
from kineme.library.storage.symbols import symbols
from kineme.library.symbols.described_members import evenly_many_members
from kineme.recognition.recognizer import Recognizer


def recognizer_of_symbols(store: Store) -> Recognizer:
    """A recognizer of the symbols, fitted to at most 3000 of their members, equally many of each."""
    ids, labels = evenly_many_members(store)
    return store.specification.recognizer().fit(read.movements(store, ids), labels)


def recognized(store: Store, error_rate: float = 0.05) -> dict[str, Ids]:
    """Name of a symbol -> the unlabeled movements that are recognized as it."""
    unlabeled = read.unlabeled_ids(store)
    if not len(unlabeled) or not any(map(len, symbols(store))):
        return {}
    names = recognizer_of_symbols(store).predict_known(read.movements(store, unlabeled), error_rate)
    return {
        str(name): unlabeled[np.array([one == name for one in names])]
        for name in dict.fromkeys(name for name in names if name is not None)
    }


def assign_recognized(store: Store, found: Mapping[str, Ids]) -> dict[str, int]:
    """Assign the movements of `recognized` to their symbols; return the numbers per symbol."""
    for name, members in found.items():
        changes.assign(store, members, name, "recognized")
    return {name: len(members) for name, members in found.items()}
