"""Read movements, features and primitives, a few thousand rows at a time, each checked against its checksum."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.recorded_as import RecordedAs
from kineme.errors import SpecificationError
from kineme.library.storage.channels import with_channels
from kineme.library.storage.rows import ALIVE, Database, Row, among, damage, damaged, has_table, listed, select, strange
from kineme.library.storage.schema import COLUMNS
from kineme.library.storage.store import Moment, Store
from kineme.movements.channels.channel import is_plain
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.labels import label_array
from kineme.movements.trajectories.movements import Movements
from kineme.similarity.specification import Representation
from kineme.validation import Array

Ids = NDArray[np.int64]

_ROWS = 4096  # rows fetched at a time


def all_ids(store: Store) -> Ids:
    """Return ids of all movements, ascending."""
    return _ids(store, "", lambda moment: moment.movements)


def unlabeled_ids(store: Store) -> Ids:
    """Return ids of the movements without a symbol, ascending."""
    members = f"EXCEPT SELECT movement FROM member WHERE {ALIVE}"
    return _ids(store, members, lambda moment: moment.movements - moment.members)


def _ids(store: Store, without: str, count_at: Callable[[Moment], int]) -> Ids:
    """Return ids of movements, ascending; refused if their number is not that of the moment."""
    with store.reading() as connection:
        moment = store.moment(connection)
        expected, query = count_at(moment), f"SELECT id FROM movement WHERE {ALIVE} {without} ORDER BY id"
        ids = np.array([key for (key,) in connection.execute(query, {"v": moment.version})], dtype=np.int64)
        last, n = connection.execute("SELECT coalesce(max(id), 0), count(*) FROM movement").fetchone()
    if len(ids) != expected or last != n or (np.diff(ids) <= 0).any():
        raise damage(f"{expected} ids of {last} movements, each once", f"{len(ids)} of {n}: damaged bytes")
    return ids


def returned_ids(store: Store) -> dict[int, int]:
    """Return id -> id now, of movements that were deleted and came back, by an undo or learned again."""
    back = f"(SELECT id, digest FROM movement WHERE {ALIVE}) AS back"
    query = f"SELECT gone.id, back.id FROM movement AS gone JOIN {back} USING (digest) WHERE gone.removed <= :v"
    with store.reading() as connection:
        return dict(connection.execute(query, {"v": store.as_of}))


def as_ids(store: Store, ids: Any) -> Ids:
    """Return a user's ids as an array; all must be in the library."""
    wanted = np.atleast_1d(np.asarray(ids))
    if wanted.dtype.kind not in "iu" or wanted.ndim != 1 or not len(wanted):
        raise SpecificationError(f"expected ids of movements, whole numbers, at least one, got {ids!r}")
    with store.reading() as connection:
        query = f"SELECT id FROM movement WHERE {ALIVE} AND {among('id')}"
        rows = connection.execute(query, {"v": store.as_of, "keys": listed(wanted)})
        missing = np.setdiff1d(wanted, [key for (key,) in rows])
        for table in ("raw", "feature"):  # these have no removed rows: the movement must be there, if not alive
            query = (
                f"SELECT movement FROM {table} WHERE {among('movement')} AND movement NOT IN (SELECT id FROM movement)"
            )
            for row in connection.execute(query, {"keys": listed(missing)}) if len(missing) else ():
                raise damaged("movement", row)
    if len(missing):
        raise SpecificationError(
            f"expected ids of movements in the library, got {missing[0]}, which is not there "
            f"({len(missing)} of {len(wanted)} are not)"
        )
    return wanted.astype(np.int64)


def records(store: Store, ids: Ids) -> list[dict[str, Any]]:
    """Return rows of the table `movement`, as dictionaries, in the order of `ids`."""
    wanted, order = _sorted(ids)
    rows = [row for chunk in _chunks(store, "movement", "id", wanted) for row in chunk]
    return [dict(zip(COLUMNS["movement"], rows[i], strict=True)) for i in order.tolist()]


def movements(store: Store, ids: Ids, labels: Sequence[str | None] | None = None) -> Demonstrations:
    """Return the recordings, in the order of `ids`; with labels if every one has a label."""
    wanted, order = _sorted(ids)
    about = records(store, wanted)
    d, lengths = store.n_dims or 0, np.array([record["n_samples"] for record in about])
    offsets = np.concatenate(([0], np.cumsum(lengths)))
    if 4 * d * int(offsets[-1]) > store.size:  # no memory for more samples than the file could contain
        raise strange("movement", (max(about, key=lambda record: int(record["n_samples"]))["id"],))
    t0, durations = (np.array([record[name] for record in about]) for name in ("t0", "duration"))
    positions = np.empty((offsets[-1], d))
    stamps: dict[int, bytes] = {}
    done = 0
    for rows in _chunks(store, "raw", "movement", wanted):
        part = slice(done, done + len(rows))
        for row, n in zip(rows, lengths[part].tolist(), strict=True):
            stamped = row[3] is None or len(row[3]) in {4 * n, 8 * n}
            if len(row[1]) != 8 * d or len(row[2]) != 4 * d * n or not stamped:
                raise strange("raw", row)
        starts = np.frombuffer(b"".join(row[1] for row in rows)).reshape(len(rows), d)
        relative = np.frombuffer(b"".join(row[2] for row in rows), np.float32).reshape(-1, d)
        block = positions[offsets[done] : offsets[part.stop]]
        np.add(relative, np.repeat(starts, lengths[part], axis=0), out=block)
        _check_finite("raw", rows, block, lengths[part])
        stamps.update((done + k, row[3]) for k, row in enumerate(rows) if row[3] is not None)
        done = part.stop
    times = times_of(stamps, offsets, t0, durations) if stamps or t0.any() else None
    if times is not None:
        increasing = times[1:] > times[:-1]
        increasing[offsets[1:-1] - 1] = True  # from one movement to the next
        if not increasing.all():
            first = int(np.searchsorted(offsets, np.argmin(increasing), side="right")) - 1
            raise strange("raw", (wanted[first],))
    stored = Movements(positions, offsets, durations, times, None, _names(about))
    if channels := store.channels:
        chunks = () if is_plain(channels) else _chunks(store, "recorded", "movement", wanted)
        stored = with_channels(stored, channels, [row for chunk in chunks for row in chunk])
    if not np.array_equal(wanted, ids):
        stored = stored.take(order)
    return Demonstrations.of_movements(replace(stored, labels=_labels(labels)))


def _check_finite(table: str, rows: Sequence[Row], block: NDArray[Any], lengths: Any = 1) -> None:
    """Refuse rows with values that are not finite; `lengths` are the numbers of block rows per row of the table."""
    if not (good := np.isfinite(block).all(axis=1)).all():
        first = np.cumsum(np.broadcast_to(lengths, len(rows)))
        raise strange(table, rows[int(np.searchsorted(first, np.argmin(good), side="right"))])


def times_of(stamps: dict[int, bytes], offsets: NDArray[np.intp], t0: Array, durations: Array) -> Array:
    """Return the time stamps of all samples: the stored ones, and even ones for movements without."""
    lengths = np.diff(offsets)
    k = np.arange(offsets[-1]) - np.repeat(offsets[:-1], lengths)
    times: Array = np.repeat(t0, lengths) + np.repeat(durations / (lengths - 1), lengths) * k
    for i, blob in stamps.items():
        kind = np.float32 if len(blob) == 4 * lengths[i] else np.float64
        times[offsets[i] : offsets[i + 1]] = t0[i] + np.frombuffer(blob, kind)
    return times


def features(store: Store, ids: Ids) -> NDArray[np.float32]:
    """Return rows of `ComparisonSpecification.stored_rows`, concatenated, shape (k, sum of d * S)."""
    wanted, order = _sorted(ids)
    width, done = sum(store.specification.widths(store.n_dims or 0)), 0
    result = np.empty((len(wanted), width), dtype=np.float32)
    for rows in _chunks(store, "feature", "movement", wanted):
        block = result[done : done + len(rows)]
        block[:] = _concatenated("feature", rows, 1, np.float32, width)
        _check_finite("feature", rows, block)
        done += len(rows)
    return result if np.array_equal(wanted, ids) else result[order]


def feature_blocks(
    store: Store, ids: Ids, representations: Sequence[Representation]
) -> tuple[NDArray[np.float32], ...]:
    """Return the rows (k, d * S) of some of `ComparisonSpecification.stored_rows`, a block for each."""
    specification = store.specification
    ends = np.cumsum(specification.widths(store.n_dims or 0))
    blocks = dict(
        zip(specification.comparison.stored_rows, np.split(features(store, ids), ends[:-1], axis=1), strict=True)
    )
    return tuple(blocks[representation] for representation in representations)


def primitives(store: Store, ids: Ids, labels: Sequence[str | None] | None = None) -> Primitives:
    """Return the primitives, in the order of `ids`; with labels if every one has a label."""
    wanted, order = _sorted(ids)
    dmp, d = store.specification.dmp, store.n_dims or 0
    about = records(store, ids)
    rows = [row for chunk in _chunks(store, "primitive", "movement", wanted) for row in chunk]
    boundary = _concatenated("primitive", rows, 1, np.float64, 4 * d)
    weights = _concatenated("primitive", rows, 2, np.float32, d * dmp.n_basis)
    for block in (boundary, weights):
        _check_finite("primitive", rows, block)
    boundary, weights = boundary.reshape(-1, 4, d)[order], weights.reshape(-1, d, dmp.n_basis)[order]
    return Primitives(
        dmp,
        scaled_weights=weights.astype(np.float64),
        starts=boundary[:, 0],
        goals=boundary[:, 1],
        velocities=boundary[:, 2],
        durations=np.array([record["duration"] for record in about]),
        extents=boundary[:, 3],
        labels=_labels(labels),
        names=_names(about),
        recorded_as=None if store.channels is None else RecordedAs(store.channels),
    )


def _concatenated(table: str, rows: Sequence[Row], column: int, kind: Any, width: int) -> NDArray[Any]:
    """Return the bytes of a column as an array (rows, width)."""
    size = np.dtype(kind).itemsize * width
    for row in rows:
        if len(row[column]) != size:
            raise strange(table, row)
    return np.frombuffer(b"".join(row[column] for row in rows), kind).reshape(-1, width)


def _labels(labels: Sequence[str | None] | None) -> NDArray[Any] | None:
    return None if labels is None or any(label is None for label in labels) else label_array(labels)


def _names(about: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    return tuple(record["name"] or f"movement {record['id']}" for record in about)


def names_of(store: Store, ids: Ids) -> list[str | None]:
    """Return the name of each movement's symbol; None for movements without."""
    keys = {"keys": listed(ids), "v": store.as_of}
    with store.reading() as connection:
        names = {state[1]: state[2] for state in select(connection, "symbol_state", ALIVE, {"v": store.as_of})}
        members = select(connection, "member", f"{among('movement')} AND {ALIVE}", keys)
    if lost := {row[2] for row in members} - names.keys():
        raise damaged("symbol", (min(lost),))
    name_of = {row[1]: names[row[2]] for row in members}
    return [name_of.get(key) for key in ids.tolist()]


def groups(store: Store, ids: Ids) -> NDArray[np.object_]:
    """Return who showed each movement, shape (k,); None where that is not known."""
    people: dict[int, str] = {}
    for k in range(0, len(ids), _ROWS):
        with store.reading() as connection:
            people |= people_by_movement(connection, ids[k : k + _ROWS].tolist(), store.as_of)
    result = np.empty(len(ids), dtype=object)
    result[:] = [people.get(key) for key in ids.tolist()]
    return result


def people_by_movement(connection: Database, keys: Sequence[int], version: int) -> dict[int, str]:
    """Return movement -> who showed it, of those of which that was known at a version."""
    if not has_table(connection, "shown_by") or not connection.execute("SELECT 1 FROM shown_by LIMIT 1").fetchone():
        return {}
    keyed = {"keys": listed(keys), "v": version}
    return {row[0]: row[1] for row in select(connection, "shown_by", f"{among('movement')} AND added <= :v", keyed)}


def _chunks(store: Store, table: str, column: str, wanted: Ids) -> Iterator[list[Row]]:
    """Return rows of a table with ascending keys, in chunks."""
    for k in range(0, len(wanted), _ROWS):
        with store.reading() as connection:
            rows = select(connection, table, among(column), {"keys": listed(wanted[k : k + _ROWS])})
        if len(rows) != len(wanted[k : k + _ROWS]):
            lost = set(wanted[k : k + _ROWS].tolist()) - {row[0] for row in rows}
            raise damaged(table, (min(lost),))
        yield rows


def _sorted(ids: Ids) -> tuple[Ids, NDArray[np.intp]]:
    """Return the unique ids, ascending, and the position of each of `ids` among them."""
    if not len(ids):
        raise SpecificationError("expected at least one movement, got none: the library or the symbol has none yet")
    wanted, order = np.unique(ids, return_inverse=True)
    return wanted, order
