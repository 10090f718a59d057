"""One batch of movements into the tables, in one transaction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.library.learning.deduplicate import Batch, Known, look_up
from kineme.library.learning.serialize import evenly_sampled, pack
from kineme.library.storage.rows import Row, among, as_text, listed, next_key
from kineme.library.storage.source import Source
from kineme.library.storage.store import Store
from kineme.library.storage.symbols import join, keys_by_name
from kineme.library.storage.versions import Change
from kineme.movements.trajectories.demonstrations import Demonstrations


@dataclass(frozen=True, eq=False)
class Committed:
    """What one batch became."""

    added: int
    symbols: tuple[str, ...]
    ids: NDArray[np.int64]


def describe(store: Store, demos: Demonstrations, batch: Batch, new: list[int]) -> None:
    """Compute the rows of the new movements of a batch."""
    chosen = demos if len(new) == len(demos) else demos[new]
    batch.packed = pack(chosen, evenly_sampled(chosen), store.specification)
    batch.packed_rows = dict(zip(new, range(len(new)), strict=True))


def commit(store: Store, batch: Batch) -> Committed:
    """Store what is new, and let labels make and join symbols; where nothing changes, no version is made."""
    if not batch.packed_rows and (ids := _all_known(store, batch)) is not None:
        return Committed(0, (), ids)
    detail: dict[str, Any] = {}
    with store.writing("learn", detail) as change:
        known = look_up(change.connection, batch)  # again: another writer may have been first
        _insert_sources(change, batch, known)
        keys, new = _keys(change, batch, known)
        if new:
            if not batch.packed_rows.keys() >= set(new.values()):  # what was known has been deleted meanwhile
                describe(store, batch.demos, batch, list(new.values()))
            _insert_movements(change, batch, new, known)
        made = _join(change, batch, keys)
        detail |= {"added": len(new), "known": len(keys) - len(new), "symbols": list(made)}
    return Committed(len(new), made, np.array(keys, dtype=np.int64))


def _all_known(store: Store, batch: Batch) -> NDArray[np.int64] | None:
    """The ids, if every movement is there and has a symbol if it should: then there is nothing to store."""
    with store.reading() as connection:
        known = look_up(connection, batch)
        found = [known.id_of(batch, i) for i in range(len(batch.digests))]
        ids = [key for key in found if key is not None]
        if len(ids) < len(found) or _without_symbol(connection, batch, ids):
            return None
        return np.array(ids, dtype=np.int64)


def _keys(change: Change, batch: Batch, known: Known) -> tuple[list[int], dict[int, int]]:
    """The id of every movement of the batch, and new id -> movement of the batch."""
    key = next_key(change.connection, "movement")
    keys: list[int] = []
    new: dict[int, int] = {}
    for i in range(len(batch.digests)):
        found = known.id_of(batch, i)
        if found is None:
            found = key + len(new)
            new[found] = i
            known.remember(batch, i, found)
        keys.append(found)
    return keys, new


def _insert_sources(change: Change, batch: Batch, known: Known) -> None:
    key = next_key(change.connection, "source")
    rows: list[Row] = []
    unknown: dict[tuple[str, str], Source] = {
        (source.sha256, source.options_json): source for source in batch.sources if source is not None
    }
    for (sha256, options), source in unknown.items():
        if (sha256, options) not in known.sources:
            known.sources[sha256, options] = key + len(rows)
            about = (as_text(source.path), sha256, int(source.size), source.read_at, source.kind, options)
            rows.append((key + len(rows), *about, change.version))
    change.insert("source", rows)


def _insert_movements(change: Change, batch: Batch, new: dict[int, int], known: Known) -> None:
    demos, packed = batch.demos, batch.packed
    assert packed is not None
    if change.connection.execute("SELECT 1 FROM meta WHERE key = 'n_dims'").fetchone() is None:
        change.insert("meta", [("n_dims", str(demos.n_dims))])
    lengths, durations = demos.lengths.tolist(), demos.durations.tolist()
    starts = np.zeros(len(demos)) if demos.movements.times is None else demos.times[demos.offsets[:-1]]
    t0, names = starts.tolist(), demos.names or (None,) * len(demos)
    movements = []
    for key, i in new.items():
        source, place = known.place_of(batch, i) or (None, None)
        name = None if names[i] is None else as_text(names[i])
        about = (batch.digests[i], name, batch.labels[i], lengths[i], t0[i], durations[i])
        movements.append((key, source, place, *about, change.version, None))
    rows = [(key, batch.packed_rows[i]) for key, i in new.items()]
    change.insert("movement", movements)
    change.insert("raw", [(key, *packed.raw[k]) for key, k in rows])
    change.insert("primitive", [(key, *packed.primitives[k]) for key, k in rows])
    change.insert("feature", [(key, packed.features[k]) for key, k in rows])


def _without_symbol(connection: Any, batch: Batch, keys: list[int]) -> dict[int, str]:
    """Movement -> label, of those with a label that show no symbol yet."""
    labeled = {key: label for key, label in zip(keys, batch.labels, strict=True) if label is not None}
    if not labeled:
        return {}
    query = f"SELECT movement FROM member WHERE removed IS NULL AND {among('movement')}"
    for (movement,) in connection.execute(query, {"keys": listed(labeled)}):
        labeled.pop(movement)
    return labeled


def _join(change: Change, batch: Batch, keys: list[int]) -> tuple[str, ...]:
    """Labels make symbols and join them. Who has a symbol keeps it: a person may have named it anew."""
    joining = _without_symbol(change.connection, batch, keys)
    names = list(dict.fromkeys(joining.values()))
    symbols, made = keys_by_name(change, names)
    join(change, [(movement, symbols[name]) for movement, name in joining.items()], "label")
    return made
