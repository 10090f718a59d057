"""The members of symbols, ordered by class, as recognition needs them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import SpecificationError
from kineme.library.storage import read
from kineme.library.storage.read import Ids
from kineme.library.storage.rows import ALIVE, among, damage, damaged, listed
from kineme.library.storage.store import Store
from kineme.movements.trajectories.labels import label_array
from kineme.sampling import evenly_spaced
from kineme.similarity.comparison import Comparison, OnDemand, References
from kineme.similarity.describe import Described, describe_rows


@dataclass(frozen=True, eq=False)
class Members:
    """Members of symbols, ordered by the symbol's name, then by id."""

    ids: Ids  # (m,)
    names: NDArray[Any]  # (C,), sorted
    first: NDArray[np.intp]  # (C,)
    groups: NDArray[np.intp] | None  # (m,), numbers of who showed them; None where that is known of none

    @property
    def labels(self) -> NDArray[Any]:
        """The name of each member's symbol, (m,)."""
        return np.repeat(self.names, np.diff(self.first, append=len(self.ids)))


def members_of(store: Store) -> Members:
    """Return all movements that belong to a symbol."""
    with store.reading() as connection:
        query = f"SELECT movement, symbol FROM member WHERE {ALIVE}"
        try:
            pairs = np.fromiter(connection.execute(query, {"v": store.as_of}), dtype=np.dtype((np.int64, 2)))
        except (TypeError, ValueError, OverflowError) as error:
            raise damage(
                "movements and symbols as whole numbers in table member", f"something else ({error})"
            ) from error
        if not len(pairs):
            raise SpecificationError(
                f"expected a library with movements that show a symbol, got none among its {store.counts.movements}; "
                "learn some with labels, or name a proposal"
            )
        keys, which = np.unique(pairs[:, 1], return_inverse=True)
        query = f"SELECT symbol, name FROM symbol_state WHERE {ALIVE} AND {among('symbol')}"
        named: dict[int, str] = dict(connection.execute(query, {"v": store.as_of, "keys": listed(keys)}))
    if lost := set(keys.tolist()) - named.keys():
        raise damaged("symbol", (min(lost),))
    names, place = np.unique(label_array([named[int(key)] for key in keys]), return_inverse=True)
    owner = place[which]
    order = np.lexsort((pairs[:, 0], owner))
    ids = pairs[order, 0]
    return Members(ids, names, np.searchsorted(owner[order], np.arange(len(names))), groups_of(store, ids))


def groups_of(store: Store, ids: Ids) -> NDArray[np.intp] | None:
    """Return numbers of who showed the movements, (k,), all unknown ones as one more; None where all are unknown."""
    people = read.groups(store, ids).tolist()
    if not any(people):
        return None
    return np.asarray(np.unique([person or "" for person in people], return_inverse=True)[1], dtype=np.intp)


def described(store: Store, ids: ArrayLike, comparison: Comparison | None = None) -> Described:
    """Describe movements as the library does, or as a comparison does, from their stored features."""
    chosen: Ids = np.asarray(ids, dtype=np.int64)
    if comparison is not None:
        return comparison.prepared(read.feature_blocks(store, chosen, comparison.specification.stored_rows))
    how = store.specification.comparison.with_points(store.channels)
    return describe_rows(read.features(store, chosen), store.n_dims or 0, how)


def described_references(store: Store, ids: Ids, labels: NDArray[Any]) -> References:
    """Return movements with sorted labels, from their stored features; their samples are read when asked for."""
    return References.of(OnDemand(ids, partial(read.movements, store)), described(store, ids), labels)


def some_of_each(members: Members, most: int) -> Members:
    """Choose at most so many members of each symbol, evenly spaced."""
    ends = np.append(members.first, len(members.ids))
    rows = [start + evenly_spaced(stop - start, most) for start, stop in pairwise(ends)]
    chosen = np.concatenate(rows)
    first = np.cumsum([0, *(len(part) for part in rows[:-1])])
    groups = None if members.groups is None else members.groups[chosen]
    return replace(members, ids=members.ids[chosen], first=first, groups=groups)
