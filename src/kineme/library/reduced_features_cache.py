"""Reduced features of every movement of a library, in a cache file beside the database.

The file is written atomically. It is used if its key names this library, this specification and this history, and if
its checksum is right; otherwise it is silently built again from the database.
"""

from __future__ import annotations

import json
import os
import sqlite3
import zlib
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.library.storage import read
from kineme.library.storage.read import Ids
from kineme.library.storage.store import Store
from kineme.reporting.atomic import whole_file
from kineme.sampling import evenly_spaced
from kineme.similarity.bounds import N_REDUCED, ReducedFeatures, fit_bases, reduce_features
from kineme.validation import Array

FILE = "reduced_features.cache"

_FORMAT = 1
_HEADER = 4096  # bytes; the arrays begin on a new page
_SAMPLE = 2000  # movements that the reduced features are fitted to
_ROWS = 8192  # movements reduced at a time
_GROWN = 0.1  # share of new movements from which on the file is written again
_FEW = 2000  # fewer new ones are never written

Bytes = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class ReducedMovements:
    """Reduced features of movements, ids ascending, in one block or two: from the file, and of later movements."""

    ids: Ids
    bases: tuple[Array, ...]
    blocks: tuple[tuple[ReducedFeatures, ...], ...]


def open_cache(store: Store, held: ReducedMovements | None = None) -> ReducedMovements:
    """Return reduced features of all movements ever stored: held or in the cache, and computed for those not in it."""
    path = store.cache_path(FILE)
    reduced = held or _load(store, path)
    last = int(reduced.ids[-1]) if reduced is not None else -1
    later = _ids_after(store, last)
    if reduced is not None and len(later) <= max(_FEW, _GROWN * len(reduced.blocks[0][0].values)):
        return reduced if not len(later) else extended(store, reduced, later)
    if held is not None:
        return open_cache(store)
    everything = _ids_after(store, -1)
    if path is not None and not store.read_only:
        with suppress(OSError):  # disk full or no permission: kept in memory only
            _write(store, path, everything)
            if (reduced := _load(store, path)) is not None:
                return reduced
    buffer = np.zeros(_HEADER + _layout(store, len(everything))[1], dtype=np.uint8)
    _fill(store, buffer, everything)
    return _arrays_in(store, buffer, len(everything))


def extended(store: Store, reduced: ReducedMovements, later: Ids) -> ReducedMovements:
    """Return the same with the reduced features of later movements appended."""
    new = reduce_features(reduced.bases, _features(store, later), store.n_dims or 0)
    if len(reduced.blocks) > 1:
        pairs = zip(reduced.blocks[1], new, strict=True)
        new = tuple(ReducedFeatures(*map(np.concatenate, zip(*pair, strict=True))) for pair in pairs)
    return ReducedMovements(np.concatenate((reduced.ids, later)), reduced.bases, (reduced.blocks[0], new))


def _ids_after(store: Store, key: int) -> Ids:
    with store.reading() as connection:
        rows = connection.execute("SELECT id FROM movement WHERE id > ? ORDER BY id", (key,))
        return np.fromiter((key for (key,) in rows), dtype=np.int64)


def _features(store: Store, ids: Ids) -> tuple[NDArray[np.float32], ...]:
    """Return rows (n, d * S) of each representation that is compared sample by sample."""
    return read.feature_blocks(store, ids, store.specification.comparison.by_rows)


def _layout(store: Store, n: int) -> tuple[list[tuple[type[Any], tuple[int, ...]]], int]:
    """Return types and shapes of the arrays in the file, in order, and their total bytes."""
    d = store.n_dims or 0
    parts: list[tuple[type[Any], tuple[int, ...]]] = [(np.int64, (n,))]
    for representation in store.specification.comparison.by_rows:
        k = min(N_REDUCED, representation.n_points)
        single = [(np.float32, shape) for shape in ((n, d * k), (n,), (n,))]
        parts += [(np.float64, (representation.n_points, k)), *single]
    return parts, sum(_size(*part) for part in parts)


def _size(kind: type[Any], shape: tuple[int, ...]) -> int:
    return -(-int(np.prod(shape)) * np.dtype(kind).itemsize // 64) * 64


def _arrays_in(store: Store, buffer: Bytes, n: int) -> ReducedMovements:
    arrays, offset = [], _HEADER
    for kind, shape in _layout(store, n)[0]:
        count = int(np.prod(shape))
        arrays.append(np.frombuffer(buffer, kind, count, offset).reshape(shape))
        offset += _size(kind, shape)
    ids, *rest = arrays
    block = tuple(ReducedFeatures(*rest[r + 1 : r + 4]) for r in range(0, len(rest), 4))
    return ReducedMovements(ids, tuple(rest[::4]), (block,))


def _fill(store: Store, buffer: Bytes, ids: Ids) -> None:
    """Write the reduced features of all movements into a buffer."""
    reduced = _arrays_in(store, buffer, len(ids))
    reduced.ids[:] = ids
    sample = ids[evenly_spaced(len(ids), _SAMPLE)]
    for to, basis in zip(reduced.bases, fit_bases(_features(store, sample), store.n_dims or 0), strict=True):
        to[:] = basis
    for start in range(0, len(ids), _ROWS):
        rows = slice(start, start + _ROWS)
        some = reduce_features(reduced.bases, _features(store, ids[rows]), store.n_dims or 0)
        for block, features in zip(reduced.blocks[0], some, strict=True):
            for into, values in zip(block, features, strict=True):
                into[rows] = values


def _write(store: Store, path: Path, ids: Ids) -> None:
    with whole_file(path) as beside:
        size = _HEADER + _layout(store, len(ids))[1]
        with beside.open("wb") as file:
            os.posix_fallocate(file.fileno(), 0, size) if hasattr(os, "posix_fallocate") else file.truncate(size)
        buffer: Any = np.memmap(beside, np.uint8, "r+")
        _fill(store, buffer, ids)
        header = {**_validity_key(store, store.version), "n": len(ids), "crc": zlib.crc32(buffer[_HEADER:])}
        text = json.dumps(header).encode()
        buffer[: len(text)] = np.frombuffer(text, np.uint8)
        buffer.flush()
        del buffer


def _validity_key(store: Store, version: int) -> dict[str, Any]:
    """Cache validity key: the library, its specification, and its history, since a copy may have changed."""
    with store.reading() as connection:
        row = connection.execute("SELECT at FROM version WHERE id = ?", (version,)).fetchone()
    described, at = zlib.crc32(json.dumps(store.specification.to_json()).encode()), row[0] if row else None
    library = {"format": _FORMAT, "library": store.id, "seen": described, "dims": store.n_dims}
    return {**library, "version": version, "at": at}


def _load(store: Store, path: Path | None) -> ReducedMovements | None:
    """Return the reduced features in a file; None if there is no valid one."""
    if path is None or not path.is_file():  # not a pipe, which would block
        return None
    try:
        buffer: Any = np.memmap(path, np.uint8, "r")
        header = json.loads(bytes(buffer[:_HEADER]).rstrip(b"\0"))
        key = _validity_key(store, int(header["version"]))
        n = int(header["n"])
        fits = all(header[name] == value for name, value in key.items()) and key["at"] is not None
        complete = len(buffer) == _HEADER + _layout(store, n)[1] and zlib.crc32(buffer[_HEADER:]) == header["crc"]
    except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError, sqlite3.Error):
        return None
    if not (fits and complete and n > 0):
        return None
    reduced = _arrays_in(store, buffer, n)
    plausible = (  # anybody can write a file with the right checksum
        (reduced.ids == np.arange(1, n + 1)).all()
        and all(np.isfinite(P).all() and np.allclose(P.T @ P, np.eye(P.shape[1])) for P in reduced.bases)
        and all(np.isfinite(part).all() for features in reduced.blocks[0] for part in features)
        and all((part >= 0).all() for features in reduced.blocks[0] for part in features[1:])
    )
    return reduced if plausible else None
