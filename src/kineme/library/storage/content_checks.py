"""Checks of contents that SQLite cannot do: numbers inside bytes, and JSON.

Each function takes rows with right checksums whose columns fulfill `column_checks.CHECKS`, and yields the keys of
invalid rows with a description of what is wrong.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.library.storage.column_checks import GOOD
from kineme.library.storage.rows import Row, parsed
from kineme.library.storage.schema import RETURNS
from kineme.validation import Array

Strange = Iterator[tuple[Any, str]]

_SLACK = 1e-5  # of the duration: tolerance of the last stamp, in single precision

_FINITE = "numbers that are not finite"


def _version(rows: Sequence[Row]) -> Strange:
    for key, _, action, text, *_ in rows:
        detail = _json(text)
        if not isinstance(detail, dict):
            yield key, "a detail that is no JSON object"
        elif action == "reject" and not _are(int, detail.get("movements")):
            yield key, "a rejection without its list of movements"
        elif action in RETURNS and not (type(detail.get("to")) is int and 0 <= detail["to"] < key):
            yield key, f"an action {action} without the earlier version that it returned to"


def _source(rows: Sequence[Row]) -> Strange:
    yield from ((row[0], "options that are no JSON object") for row in rows if not isinstance(_json(row[6]), dict))


def _symbol_state(rows: Sequence[Row]) -> Strange:
    yield from ((row[0], "parents that are no JSON list of ids") for row in rows if not _are(str, _json(row[6])))


def _json(text: str) -> Any:
    try:
        return parsed(text)
    except ValueError:
        return None


def _are(kind: type, values: Any) -> bool:
    return isinstance(values, list) and all(type(value) is kind for value in values)


def _primitive(rows: Sequence[Row]) -> Strange:
    yield from _not_finite(rows, 1, np.float64)
    yield from _not_finite(rows, 2, np.float32)


def _feature(rows: Sequence[Row]) -> Strange:
    yield from _not_finite(rows, 1, np.float32)


def _not_finite(rows: Sequence[Row], column: int, kind: Any) -> Strange:
    size = np.dtype(kind).itemsize
    if all(len(row[column]) % size == 0 for row in rows) and _finite([row[column] for row in rows], kind):
        return
    for row in rows:
        if len(row[column]) % size or not _finite([row[column]], kind):
            yield row[0], _FINITE


def _finite(blobs: Sequence[bytes], kind: Any) -> bool:
    return bool(np.isfinite(np.frombuffer(b"".join(blobs), kind)).all())


#: Table -> the check of its contents.
CONTENTS: dict[str, Callable[[Sequence[Row]], Strange]] = {
    "version": _version,
    "source": _source,
    "symbol_state": _symbol_state,
    "primitive": _primitive,
    "feature": _feature,
    "recorded": _feature,
}


def samples(connection: sqlite3.Connection, rows: Sequence[Row], n_dims: int) -> Strange:
    """Like the functions of `CONTENTS`, for ascending rows of the table `raw`, compared with the rows of movements."""
    yield from _not_finite(rows, 1, np.float64)
    yield from _not_finite(rows, 2, np.float32)
    query = f"SELECT id, n_samples, t0, duration FROM movement WHERE id BETWEEN ? AND ? AND {GOOD['movement']}"
    about = {row[0]: row[1:] for row in connection.execute(query, (rows[0][0], rows[-1][0]))}
    fitting = [row for row in rows if row[0] in about and len(row[2]) == 4 * n_dims * about[row[0]][0]]
    if not fitting:
        return
    keys = np.array([row[0] for row in fitting])
    lengths = np.array([about[row[0]][0] for row in fitting])
    moved = np.abs(np.frombuffer(b"".join(row[2] for row in fitting), np.float32)).reshape(-1, n_dims).max(axis=1)
    still = np.maximum.reduceat(moved, np.cumsum(lengths) - lengths) == 0
    yield from ((int(key), "a movement that does not move") for key in keys[still])
    for kind in (np.float32, np.float64):
        size = np.dtype(kind).itemsize
        some = [row for row in fitting if row[3] is not None and len(row[3]) == size * about[row[0]][0]]
        if some:
            yield from _stamps(some, [about[row[0]] for row in some], kind)


def _stamps(rows: Sequence[Row], about: Sequence[tuple[Any, ...]], kind: Any) -> Strange:
    """Check that stamps (total,) begin at zero, increase strictly, also with t0 added, and end at the duration."""
    relative: Array = np.frombuffer(b"".join(row[3] for row in rows), kind).astype(np.float64)
    lengths, t0, durations = (np.array([one[k] for one in about]) for k in range(3))
    ends = np.cumsum(lengths)
    times = relative + np.repeat(t0, lengths)
    steps: NDArray[np.bool_] = np.append(times[1:] > times[:-1], True)
    steps[ends - 1] = True  # from one movement to the next
    good = np.logical_and.reduceat(steps, ends - lengths) & (relative[ends - lengths] == 0)
    good &= np.abs(relative[ends - 1] - durations) <= _SLACK * durations
    yield from (
        (row[0], "time stamps that do not lead from zero to the duration") for row in np.array(rows, object)[~good]
    )
