"""Serialize one batch of movements, and write it to the tables in one transaction.

Positions and times are stored in single precision relative to the start of the movement, which is stored in double.
Even times are not stored, but computed from the duration.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.dmp.discrete.encode import check_movement
from kineme.errors import TrajectoryError
from kineme.library.storage.channels import channels_to_text, to_bytes
from kineme.library.storage.connection import ConflictError
from kineme.library.storage.read import people_by_movement
from kineme.library.storage.rows import Database, Row, among, as_text, listed
from kineme.library.storage.schema import CONTINUES
from kineme.library.storage.source import Source
from kineme.library.storage.specification import Specification
from kineme.library.storage.store import NOW, Change, Store, repeated
from kineme.library.storage.symbols import add_members, keys_by_name, stored_keys
from kineme.movements.channels.coordinates import with_periods
from kineme.movements.preparation.glitches import RemoveGlitches
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.similarity.describe import feature_rows
from kineme.validation import Array, describe

#: Table -> its rows of a batch, without their keys.
Tables = dict[str, list[Row]]

_TRIES = 3  # to write a batch beside others, before it is written alone
_EVEN = 1e-9  # of a step: stamps closer to an even grid are not stored
_SMALL, _LARGE = 1e-30, 1e30  # between which single precision keeps its relative error


@dataclass(frozen=True, eq=False)
class Committed:
    """The result of storing one batch, which made `version`; None if nothing changed."""

    added: int
    symbols: tuple[str, ...]
    ids: NDArray[np.int64]
    version: int | None


def serialize_new(store: Store, demos: Demonstrations, batch: Batch, new: list[int]) -> None:
    """Serialize the new movements of a batch."""
    chosen = demos if len(new) == len(demos) else demos[new]
    batch.tables = serialize(chosen, evenly_sampled(chosen), store.specification)
    batch.row_of = dict(zip(new, range(len(new)), strict=True))


@repeated
def commit(store: Store, batch: Batch, continues: int | None = None) -> Committed:
    """Store what is new, and assign it to the symbols of its labels; where nothing changes, no version is made.

    `continues` is the version of what was learned before in the same call: an undo takes back both.
    """
    if not batch.row_of:
        with store.reading() as connection:
            ids = _all_stored(connection, batch, find_stored(connection, batch))
        if ids is not None:
            return Committed(0, (), ids, None)
    for _ in range(_TRIES if store.many_write else 0):
        with suppress(ConflictError):  # others learn the same at the same time, or have failed: once more
            return _commit(store, batch, continues, _n_rows(store, batch))
    return _commit(store, batch, continues, None)


def stored_ids(store: Store, batch: Batch) -> list[int]:
    """Return the id of each movement of a batch; of what is new, copies alike, one below 0."""
    with store.reading() as connection:
        return _keys(-len(batch.digests), batch, find_stored(connection, batch))[0]


def _n_rows(store: Store, batch: Batch) -> dict[str, int]:
    """Return how many rows a batch adds to each table whose rows are numbered, if nothing changes meanwhile."""
    with store.reading() as connection:
        stored = find_stored(connection, batch)
        keys, new = _keys(-len(batch.digests), batch, stored)  # of new ones below 0
        labeled = _without_symbol(connection, batch, keys)
        names = set(labeled.values())
        n_symbols = len(names - stored_keys(connection, names).keys())
    sources = {(source.sha256, source.options_json) for source in batch.sources if source is not None}
    n_sources = len(sources - stored.sources.keys())
    counts = {"version": 1, "source": n_sources, "movement": len(new), "member": len(labeled)}
    return counts | {"symbol": n_symbols, "symbol_state": n_symbols}


class _NothingNewError(Exception):
    """Nothing is left to store, since another process has learned the same meanwhile."""


def _commit(store: Store, batch: Batch, continues: int | None, reserve: dict[str, int] | None) -> Committed:
    ids = None
    with suppress(_NothingNewError), store.writing("learn", reserve=reserve) as change:
        stored = find_stored(change.connection, batch)  # again, since another process may have written meanwhile
        if (ids := _all_stored(change.connection, batch, stored)) is not None:
            raise _NothingNewError
        _insert_sources(change, batch, stored)
        keys, new = _keys(change.next_key("movement"), batch, stored)
        if new:
            if not batch.row_of.keys() >= set(new.values()):  # what was stored has been deleted meanwhile
                serialize_new(store, batch.demos, batch, list(new.values()))
            _insert_movements(change, batch, new, stored)
        labeled = _without_symbol(change.connection, batch, keys)  # movements that have a symbol keep it
        symbols, new_symbols = keys_by_name(change, dict.fromkeys(labeled.values()))
        add_members(change, [(movement, symbols[label]) for movement, label in labeled.items()], "label")
        change.detail.update(added=len(new), known=len(keys) - len(new), symbols=list(new_symbols))
        if people := _without_person(change.connection, batch, keys):
            change.insert("shown_by", [(key, person, change.version) for key, person in people.items()])
            change.detail["people"] = sorted(set(people.values()))
        if continues is not None:
            change.detail[CONTINUES] = continues
        for table, rows in batch.tables.items() if new else ():  # last: what others learn, too, shows before
            change.insert(table, [(key, *rows[batch.row_of[i]]) for key, i in new.items()])
    if ids is not None:
        return Committed(0, (), ids, None)
    return Committed(len(new), new_symbols, np.array(keys, dtype=np.int64), change.version)


def _all_stored(connection: Database, batch: Batch, stored: Stored) -> NDArray[np.int64] | None:
    """Return the ids, if all movements are stored, with what is said of them, so that nothing changes; else None."""
    keys = [stored.id_of(batch, i) for i in range(len(batch.digests))]
    ids = [key for key in keys if key is not None]
    if len(ids) < len(keys) or _without_symbol(connection, batch, ids) or _without_person(connection, batch, ids):
        return None
    return np.array(ids, dtype=np.int64)


def _keys(key: int, batch: Batch, stored: Stored) -> tuple[list[int], dict[int, int]]:
    """Return the id of every movement of the batch, and new id, from `key` on, -> movement of the batch."""
    keys: list[int] = []
    new: dict[int, int] = {}
    for i in range(len(batch.digests)):
        movement = stored.id_of(batch, i)
        if movement is None:
            movement = key + len(new)
            new[movement] = i
            stored.remember(batch, i, movement)
        keys.append(movement)
    return keys, new


def _insert_sources(change: Change, batch: Batch, stored: Stored) -> None:
    key = change.next_key("source")
    rows: list[Row] = []
    unknown: dict[tuple[str, str], Source] = {
        (source.sha256, source.options_json): source for source in batch.sources if source is not None
    }
    for (sha256, options), source in unknown.items():
        if (sha256, options) not in stored.sources:
            stored.sources[sha256, options] = key + len(rows)
            about = (as_text(source.path), sha256, int(source.size), source.read_at, source.kind, options)
            rows.append((key + len(rows), *about, change.version))
    change.insert("source", rows)


def _insert_movements(change: Change, batch: Batch, new: dict[int, int], stored: Stored) -> None:
    demos = batch.demos
    stored_dims = change.connection.execute("SELECT value FROM meta WHERE key = 'n_dims'").fetchone()
    if stored_dims is not None and stored_dims[0] != str(demos.n_dims):
        raise TrajectoryError(
            f"expected movements of {stored_dims[0]} dimensions, as another process has learned meanwhile, got "
            f"{demos.n_dims}; choose the columns, or make another library"
        )
    if stored_dims is None:
        change.insert("meta", [("n_dims", str(demos.n_dims))])
        if demos.channels is not None:
            change.insert("meta", [("channels", channels_to_text(with_periods(demos.channels, demos.recorded)))])
    lengths, durations = demos.lengths.tolist(), demos.durations.tolist()
    starts = np.zeros(len(demos)) if demos.movements.times is None else demos.times[demos.offsets[:-1]]
    t0, names = starts.tolist(), demos.names or (None,) * len(demos)
    movements = []
    for key, i in new.items():
        source, place = stored.place_of(batch, i) or (None, None)
        name = None if names[i] is None else as_text(names[i])
        about = (batch.digests[i], name, batch.labels[i], lengths[i], t0[i], durations[i])
        movements.append((key, source, place, *about, change.version, None))
    change.insert("movement", movements)


def _without_symbol(connection: Any, batch: Batch, keys: list[int]) -> dict[int, str]:
    """Return movement -> label, for movements with a label that belong to no symbol yet."""
    labeled = _first_names(keys, batch.labels)
    if not labeled:
        return {}
    query = f"SELECT movement FROM member WHERE removed IS NULL AND {among('movement')}"
    for (movement,) in connection.execute(query, {"keys": listed(labeled)}):
        labeled.pop(movement)
    return labeled


def _without_person(connection: Any, batch: Batch, keys: list[int]) -> dict[int, str]:
    """Return movement -> who showed it, for movements of which that is said and was not known."""
    said = _first_names(keys, batch.groups)
    people = people_by_movement(connection, list(said), NOW) if said else {}
    return {key: group for key, group in said.items() if key not in people}


def _first_names(keys: list[int], names: list[str | None]) -> dict[int, str]:
    """Return movement -> the first name that is said of it: copies later in the batch change nothing."""
    first: dict[int, str] = {}
    for key, name in zip(keys, names, strict=True):
        if name is not None:
            first.setdefault(key, name)
    return first


@dataclass
class Batch:
    """Movements to be stored, with labels and sources."""

    demos: Demonstrations
    digests: list[int]
    labels: list[str | None]
    groups: list[str | None]
    sources: list[Source | None]
    places: list[str | None]
    tables: Tables = field(default_factory=dict)
    row_of: dict[int, int] = field(default_factory=dict)  # movement of the batch -> its row in these


@dataclass(frozen=True)
class Stored:
    """Movements and sources of a batch that the library holds already, and their keys."""

    by_digest: dict[int, int]
    sources: dict[tuple[str, str], int]  # (sha256, options) -> source
    by_place: dict[tuple[int, str], int]  # (source, place) -> movement

    def id_of(self, batch: Batch, i: int) -> int | None:
        """Return the id of movement i of the batch; None if it is new."""
        key = self.by_digest.get(batch.digests[i])
        where = self.place_of(batch, i)
        return self.by_place.get(where) if key is None and where is not None else key

    def place_of(self, batch: Batch, i: int) -> tuple[int, str] | None:
        """Return (source, position in it) of movement i, if its source is stored."""
        source, place = batch.sources[i], batch.places[i]
        key = None if source is None else self.sources.get((source.sha256, source.options_json))
        return None if key is None or place is None else (key, as_text(place))

    def remember(self, batch: Batch, i: int, key: int) -> None:
        """Note that movement i has been stored: a copy of it later in the batch is not new."""
        self.by_digest[batch.digests[i]] = key
        if (where := self.place_of(batch, i)) is not None:
            self.by_place[where] = key


def find_stored(connection: Database, batch: Batch) -> Stored:
    """Find the movements of a batch that the library holds already."""
    hashes = {source.sha256 for source in batch.sources if source is not None}
    query = f"SELECT sha256, options, id FROM source WHERE {among('sha256')}"
    rows = connection.execute(query, {"keys": listed(hashes)}) if hashes else ()
    sources = {(sha256, options): key for sha256, options, key in rows}
    query = f"SELECT source, place, id FROM movement WHERE removed IS NULL AND source IS NOT NULL AND {among('source')}"
    rows = connection.execute(query, {"keys": listed(sources.values())}) if sources else ()
    by_place = {(source, place): key for source, place, key in rows}
    query = f"SELECT digest, id FROM movement WHERE removed IS NULL AND {among('digest')}"
    by_digest = dict(connection.execute(query, {"keys": listed(batch.digests)}))
    return Stored(by_digest, sources, by_place)


def check(demos: Demonstrations) -> None:
    """Refuse movements that cannot be stored, before any is stored."""
    first = demos.offsets[:-1]
    extents = np.maximum.reduceat(demos.positions, first) - np.minimum.reduceat(demos.positions, first)
    check_movement(demos, demos.positions[first], extents)
    largest = extents.max(axis=1)
    outside = (largest < _SMALL) | (largest > _LARGE)
    if outside.any():
        i = int(np.argmax(outside))
        raise TrajectoryError(
            f"{describe(i, demos.names)}: expected an extent from {_SMALL:g} to {_LARGE:g}, got {largest[i]:g}; "
            "choose a unit in which it is"
        )


def evenly_sampled(demos: Demonstrations) -> NDArray[np.bool_]:
    """Tell which movements have even time stamps, (n,)."""
    if demos.movements.times is None:
        return np.ones(len(demos), dtype=bool)
    times, first, lengths = demos.times, demos.offsets[:-1], demos.lengths
    step = demos.durations / (lengths - 1)
    k = np.arange(len(times)) - np.repeat(first, lengths)
    off = np.abs(times - np.repeat(times[first], lengths) - np.repeat(step, lengths) * k)
    slack = _EVEN * step + 2 * np.spacing(np.abs(times[demos.offsets[1:] - 1]))
    return np.asarray(np.maximum.reduceat(off, first) <= slack)


def relative_times(demos: Demonstrations) -> Array:
    """Return times (total,) from the start of each movement."""
    return demos.times - np.repeat(demos.times[demos.offsets[:-1]], demos.lengths)


def serialize(demos: Demonstrations, even: NDArray[np.bool_], specification: Specification) -> Tables:
    """Return the rows of a batch that has been checked."""
    starts = demos.positions[demos.offsets[:-1]]
    relative = (demos.positions - np.repeat(starts, demos.lengths, axis=0)).astype(np.float32)
    offsets = demos.offsets.tolist()
    times: list[bytes | None] = [None] * len(demos)
    if not even.all():
        stamps = relative_times(demos)
        for i in np.flatnonzero(~even).tolist():
            times[i] = stored_times(stamps[offsets[i] : offsets[i + 1]])
    blob, row = relative.tobytes(), 4 * demos.n_dims
    positions = [blob[row * a : row * b] for a, b in pairwise(offsets)]
    features = np.concatenate(feature_rows(demos, specification.comparison), axis=1, dtype=np.float32)
    tables: Tables = {
        "raw": list(zip(_cut(starts), positions, times, strict=True)),
        "primitive": _primitives(demos, specification),
        "feature": list(zip(_cut(features), strict=True)),
    }
    if (recorded := demos.movements.recorded) is not None:  # columns that positions do not say
        tables["recorded"] = list(zip(to_bytes(recorded, demos.offsets, demos.channels or ()), strict=True))
    return tables


def stored_times(stamps: Array) -> bytes:
    """Return times in single precision; in double if single overflows, or makes two stamps equal."""
    if not _SMALL <= stamps[-1] <= _LARGE:
        return stamps.tobytes()
    short = stamps.astype(np.float32)
    return (short if (np.diff(short) > 0).all() else stamps).tobytes()


def _primitives(demos: Demonstrations, specification: Specification) -> list[Row]:
    learned = specification.dmp.learn(Demonstrations.of_movements(RemoveGlitches().apply(demos)))
    boundary = np.stack([learned.starts, learned.goals, learned.velocities, learned.extents], axis=1)
    with np.errstate(over="ignore"):  # refused below
        weights = learned.scaled_weights.astype(np.float32)
    if not (good := np.isfinite(weights).all(axis=(1, 2))).all():
        who = describe(int(np.argmin(good)), demos.names)
        raise TrajectoryError(
            f"{who}: expected weights up to {np.finfo(np.float32).max:.1g}, got larger ones; smooth the movement, "
            "or choose a unit in which it is smaller"
        )
    return list(zip(_cut(boundary), _cut(weights), strict=True))


def _cut(block: NDArray[np.floating]) -> list[bytes]:
    """Return each movement's bytes of a block (n, ...)."""
    blob, size = block.tobytes(), block[0].nbytes
    return [blob[k : k + size] for k in range(0, len(blob), size)]
