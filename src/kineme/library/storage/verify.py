"""Verify a library: every page, checksum, value, reference and size.

Checks of contents, which SQLite cannot do, take rows with right checksums whose columns fulfill `schema.CHECKS`.
They yield the keys of invalid rows with a description of what is wrong.
"""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError, KinemeError
from kineme.library.storage import schema
from kineme.library.storage.channels import other_columns
from kineme.library.storage.rows import Database, Row, has_table, parsed, row_name, sealed
from kineme.library.storage.store import Store
from kineme.validation import Array

Strange = Iterator[tuple[Any, str]]

_SLACK = 1e-5  # of the duration: tolerance of the last stamp, in single precision


def _version(rows: Sequence[Row]) -> Strange:
    for key, _, action, text, *_ in rows:
        detail = _json(text)
        if not isinstance(detail, dict):
            yield key, "a detail that is no JSON object"
        elif action == "reject" and not _are(int, detail.get("movements")):
            yield key, "a rejection without its list of movements"
        elif action == "discover" and not _is_discovery(detail):
            yield key, "proposals without their names, sizes, medoids, certainties and movements"
        elif action in schema.RETURNS and not (type(detail.get("to")) is int and 0 <= detail["to"] < key):
            yield key, f"an action {action} without the earlier version that it returned to"


#: What a version that proposes kinds says of each: of what type, and whether there is one for each kind.
_PROPOSED = {"names": str, "sizes": int, "medoids": int, "certainties": float, "movements": int}


def _is_discovery(detail: dict[str, Any]) -> bool:
    """Tell whether there are lists of the right types, as long as each other, and as many movements as they say."""
    if not all(_are(kind, detail.get(name)) for name, kind in _PROPOSED.items()):
        return False
    sizes, n = detail["sizes"], {len(detail[name]) for name in _PROPOSED if name != "movements"}
    return len(n) == 1 and min(sizes, default=1) > 0 and sum(sizes) == len(detail["movements"])


def _json(text: str) -> Any:
    try:
        return parsed(text)
    except ValueError:
        return None


def _are(kind: type, values: Any) -> bool:
    return isinstance(values, list) and all(type(value) is kind for value in values)


def _not_finite(rows: Sequence[Row], *kinds: Any) -> Strange:
    """Find rows with numbers that are not finite; `kinds` are the types of the columns behind the key."""
    for column, kind in enumerate(kinds, start=1):
        if not _finite([row[column] for row in rows], kind):
            yield from ((row[0], "numbers that are not finite") for row in rows if not _finite([row[column]], kind))


def _finite(blobs: Sequence[bytes], kind: Any) -> bool:
    fit = all(len(blob) % np.dtype(kind).itemsize == 0 for blob in blobs)
    return fit and bool(np.isfinite(np.frombuffer(b"".join(blobs), kind)).all())


#: Table -> the check of its contents.
CONTENTS: dict[str, Callable[[Sequence[Row]], Strange]] = {
    "version": _version,
    "source": lambda rows: (
        (row[0], "options that are no JSON object") for row in rows if not isinstance(_json(row[6]), dict)
    ),
    "symbol_state": lambda rows: (
        (row[0], "parents that are no JSON list of ids") for row in rows if not _are(str, _json(row[6]))
    ),
    "primitive": lambda rows: _not_finite(rows, np.float64, np.float32),
    "feature": lambda rows: _not_finite(rows, np.float32),
    "recorded": lambda rows: _not_finite(rows, np.float32),
}


def samples(connection: Database, rows: Sequence[Row], n_dims: int) -> Strange:
    """Check ascending rows of the table `raw` like the functions of `CONTENTS`, beside the rows of movements."""
    yield from _not_finite(rows, np.float64, np.float32)
    query = f"SELECT id, n_samples, t0, duration FROM movement WHERE id BETWEEN ? AND ? AND {schema.GOOD['movement']}"
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
    lengths, t0, durations = (np.array([movement[k] for movement in about]) for k in range(3))
    ends = np.cumsum(lengths)
    times = relative + np.repeat(t0, lengths)
    steps: NDArray[np.bool_] = np.append(times[1:] > times[:-1], True)
    steps[ends - 1] = True  # from one movement to the next
    good = np.logical_and.reduceat(steps, ends - lengths) & (relative[ends - lengths] == 0)
    good &= np.abs(relative[ends - 1] - durations) <= _SLACK * durations
    yield from (
        (row[0], "time stamps that do not lead from zero to the duration") for row in np.array(rows, object)[~good]
    )


_SHOWN = 100  # messages per check
_BATCH_BYTES = 1 << 24  # of rows whose contents are checked together
_ROW_BYTES = 512  # memory of a row beside its bytes
#: What rows raise that are valid one by one and do not fit together; seals, which anybody can compute, do not tell.
MISFITS = (LookupError, ArithmeticError, ValueError, TypeError, AttributeError, sqlite3.IntegrityError)
_CHAPTER = __name__.rpartition(".storage.")[0]


@dataclass(frozen=True)
class Problem:
    """One problem of a library."""

    table: str  # empty for the file as a whole
    key: int | str | None  # of the row: the movement, in the tables of samples, primitives and features
    text: str  # what is wrong

    def __str__(self) -> str:
        return self.text


def _problem(table: str, key: Any, words: str) -> Problem:
    return Problem(table, key, f"{row_name(table, key)}: {words}")


def verify(store: Store, *, pages: bool = True) -> list[Problem]:
    """Return all problems of the library at one moment, also of the pages of its file unless these were checked."""
    with store.snapshot() as connection:
        pages = pages and isinstance(connection, sqlite3.Connection)  # a server checks its own
        return problems_of(connection, store, pages=pages)


def problems_of(connection: Database, store: Store, *, pages: bool) -> list[Problem]:
    """Return the problems of the rows that a connection sees, which are those of a store."""
    checks = [
        *((_structure(connection),) if pages else ()),
        *(_rows(connection, table, store) for table in schema.COLUMNS if has_table(connection, table)),
        _without(connection, _REFERENCES),
        _without(connection, _COMPLETE),
        _completeness(connection),
        _without(connection, _sizes(store)),
    ]
    problems = [problem for check in checks for problem in _all_of(check)]
    return problems or _all_of(_without(connection, LIVES))  # of rows that are valid one by one


def blame(store: Store, error: BaseException) -> None:
    """Raise an error of Python while a library is used as the library's, if it does not verify; else return."""
    if isinstance(error, KinemeError) or not isinstance(error, MISFITS) or not _is_ours(error.__traceback__):
        return
    if problems := verify(store):
        raise DataError(
            f"expected the rows of {store.path} to fit together, got {problems[0]}; take it from a backup or an export "
            "that you trust: kineme library verify lists all that is wrong"
        ) from error


def _is_ours(trace: TracebackType | None) -> bool:
    """Tell whether an error comes from this chapter, and not from the program around it."""
    modules = []
    while trace is not None:
        modules.append(str(trace.tb_frame.f_globals.get("__name__")))
        trace = trace.tb_next
    return sum(name.startswith(_CHAPTER) for name in modules) > 1  # one is the call, whose arguments may be wrong


def _all_of(check: Iterator[Problem]) -> list[Problem]:
    """Return the first problems that a check finds; an error that stops it is one too."""
    problems: list[Problem] = []
    try:
        problems.extend(islice(check, _SHOWN))
    except (sqlite3.Error, UnicodeDecodeError) as error:
        problems.append(Problem("", None, f"the file cannot be read to the end ({error})"))
    return problems


def _structure(connection: Database) -> Iterator[Problem]:
    for (text,) in connection.execute(f"PRAGMA integrity_check({_SHOWN})"):
        if text != "ok":
            yield Problem("", None, f"the file: {' '.join(text.split())}")


def _rows(connection: Database, table: str, store: Store) -> Iterator[Problem]:
    """Check the seal of every row, its values, and their contents; contents only of rows without other problems."""
    try:
        good: list[Row] = []
        size = 0
        scan = getattr(connection, "scan", connection.execute)
        for row in scan(f"SELECT {', '.join(schema.COLUMNS[table])}, crc, {schema.ALL_GOOD[table]} FROM {table}"):
            if not row[-1] or not sealed(table, row[:-1]):
                yield from _broken(table, row[:-1]) or _strange(connection, table, row[0])
                continue
            good.append(row[:-2])
            size += _ROW_BYTES + sum(len(value) for value in good[-1] if isinstance(value, bytes))
            if size > _BATCH_BYTES:
                yield from _contents(connection, table, good, store)
                good, size = [], 0
        yield from _contents(connection, table, good, store)
    except (sqlite3.Error, UnicodeDecodeError) as error:
        yield Problem(table, None, f"table {table} cannot be read as a whole ({error})")
        yield from _one_by_one(connection, table)


def _broken(table: str, row: Row) -> list[Problem]:
    """Return the problem of a row that does not match its seal."""
    return [] if sealed(table, row) else [_problem(table, row[0], "damaged bytes")]


def _strange(connection: Database, table: str, key: Any) -> Iterator[Problem]:
    """Return the problems of a row with invalid values."""
    checks = schema.CHECKS[table]
    fits = ", ".join(f"({check.condition}) IS TRUE" for check in checks.values())
    row = connection.execute(f"SELECT {fits} FROM {table} WHERE {schema.COLUMNS[table][0]} IS ?", (key,)).fetchone()
    for (column, check), good in zip(checks.items(), row or (), strict=False):
        if not good:
            yield _problem(table, key, f"{column} is not {check.words}")


def _contents(connection: Database, table: str, rows: list[Row], store: Store) -> Iterator[Problem]:
    if not rows:
        return
    if table == "raw":
        invalid = samples(connection, rows, store.n_dims or 0)
    else:
        invalid = CONTENTS[table](rows) if table in CONTENTS else iter(())
    yield from (_problem(table, key, f"holds {words}") for key, words in invalid)


def _one_by_one(connection: Database, table: str) -> Iterator[Problem]:
    """Return the movements whose rows cannot be read, in a table that cannot be read as a whole."""
    if table not in schema.BLOBS:
        return
    for (key,) in connection.execute("SELECT id FROM movement").fetchall():
        try:
            row = connection.execute(f"SELECT *, movement FROM {table} WHERE movement = ?", (key,)).fetchone()
        except (sqlite3.Error, UnicodeDecodeError) as error:
            yield _problem(table, key, f"cannot be read ({error})")
        else:
            yield from _broken(table, row[:-1]) if row is not None else ()


def _completeness(connection: Database) -> Iterator[Problem]:
    for table in ("version", "movement"):
        last, n = connection.execute(f"SELECT coalesce(max(id), 0), count(*) FROM {table}").fetchone()
        if last != n:
            yield Problem(table, None, f"table {table}: expected {last} rows, numbered from 1, got {n}")
    keys = {key for (key,) in connection.execute("SELECT key FROM meta").fetchall()}
    allowed = schema.META | schema.LATER_META
    if strange := keys - allowed:
        yield Problem("meta", min(strange), f"table meta: expected nothing but {sorted(allowed)}, got {min(strange)!r}")
    if n and "n_dims" not in keys:
        yield Problem("meta", "n_dims", "row n_dims of table meta: not there")


class Constraint(NamedTuple):
    """Rows of a table that must not be there: a query of their keys, and what is wrong with them."""

    table: str
    query: str
    words: str


def _without(connection: Database, constraints: Iterable[Constraint]) -> Iterator[Problem]:
    """Check that no row breaks one of these constraints."""
    for table, query, words in constraints:
        if has_table(connection, table):
            yield from (_problem(table, key, words) for (key,) in connection.execute(f"{query} LIMIT {_SHOWN}"))


#: Each movement has its samples, primitive and features.
_COMPLETE = [
    Constraint(table, f"SELECT id FROM movement EXCEPT SELECT movement FROM {table}", "not there")
    for table in schema.BLOBS
]


def _refers(table: str, column: str, parent: str) -> Constraint:
    """Return the constraint that a column holds the key of a row of another table, or nothing."""
    there = f"{parent} AS parent ON parent.{schema.COLUMNS[parent][0]} = {table}.{column}"
    query = (
        f"SELECT {table}.{schema.COLUMNS[table][0]} FROM {table} LEFT JOIN {there} WHERE {table}.{column} IS NOT NULL"
    )
    words = f"refers to a row of table {parent} that is not there"
    return Constraint(table, f"{query} AND parent.{schema.COLUMNS[parent][0]} IS NULL", words)


_REFERENCES = [
    _refers(created[1], column, parent)
    for statement in (*schema.CREATE, *(later for statements in schema.MIGRATIONS.values() for later in statements))
    if (created := re.match(r"CREATE TABLE (\w+)", statement))
    for column, parent in re.findall(r"(\w+) INTEGER[^,]*?REFERENCES (\w+)", statement)
]


def _sizes(store: Store) -> list[Constraint]:
    """Return the constraints on the sizes of rows, which follow from the specification."""
    specification, d = store.specification, store.n_dims or 0
    n_features, n_weights = sum(specification.widths(d)), d * specification.dmp.n_basis
    expected = {
        "raw": f"length(start) = {8 * d} AND length(positions) = {4 * d} * n_samples "
        "AND (times IS NULL OR length(times) IN (4 * n_samples, 8 * n_samples))",
        "primitive": f"length(boundary) = {32 * d} AND length(weights) = {4 * n_weights}",
        "feature": f"length(rows) = {4 * n_features}",
    }
    if channels := store.channels:
        expected["recorded"] = f"length(columns) = {4 * len(other_columns(channels))} * n_samples"
    return [
        Constraint(
            table, f"SELECT id FROM {table} JOIN movement ON id = movement WHERE NOT ({fits})", "of the wrong size"
        )
        for table, fits in expected.items()
    ]


_END = f"coalesce(removed, {schema.LARGEST_ID})"


def _counted(table: str, name: str) -> Constraint:
    """Return the constraint that versions state how many rows of a table are alive."""
    gone = f"SELECT removed, -1 FROM {table} WHERE removed IS NOT NULL"
    changes = f"SELECT added AS since, 1 AS n FROM {table} UNION ALL {gone}"
    alive = (
        f"SELECT id, {name} AS stated, sum(coalesce(n, 0)) OVER (ORDER BY id) AS alive FROM version "
        f"LEFT JOIN (SELECT since, sum(n) AS n FROM ({changes}) AS changes GROUP BY since) AS changed ON since = id"
    )
    return Constraint(
        "version", f"SELECT id FROM ({alive}) AS counted WHERE stated != alive", f"counts other {name} than there are"
    )


def _apart(table: str, owner: str, words: str, compared: str = "added < before") -> Constraint:
    """Return the constraint on each lifetime of one owner and the one `before` it."""
    before = f"lag({_END}) OVER (PARTITION BY {owner} ORDER BY added, {_END}, id) AS before"
    return Constraint(
        table, f"SELECT id FROM (SELECT id, added, {before} FROM {table}) AS lives WHERE {compared}", words
    )


def _within(table: str, column: str, owners: str, whose: str) -> Constraint:
    """Return the constraint that a row is alive only while the row that it refers to is."""
    alive = (
        f"SELECT id AS key, {column} AS whose, added AS begin, {_END} AS until FROM {table} WHERE {column} IS NOT NULL"
    )
    owned = f"SELECT id AS owner, added AS first, {_END} AS last FROM {owners}"
    is_there = "begin = until OR (first <= begin AND until <= last)"
    both = f"({alive}) AS alive LEFT JOIN ({owned}) AS owned ON owner = whose"
    query = f"SELECT key FROM {both} WHERE owner IS NULL OR NOT ({is_there})"
    return Constraint(table, query, f"is there when {whose} is not")


_SYMBOLS = f"(SELECT symbol AS id, min(added) AS added, max({_END}) AS removed FROM symbol_state GROUP BY symbol) AS s"
_RETURNED = f"SELECT id FROM version WHERE action IN ('{schema.RETURNS[0]}', '{schema.RETURNS[1]}')"

#: Constraints on the lifetimes of rows that are valid one by one. A symbol is not there for a while only if it was
#: deleted, and comes back by the version that takes this back.
LIVES = (
    *(_counted(table, name) for table, name in schema.COUNTED.items()),
    _apart("member", "movement", "the movement shows two symbols at a time"),
    _apart("symbol_state", "symbol", "the symbol has two states at a time"),
    _apart(
        "symbol_state", "symbol", "the symbol is not there for a while",
        f"added > before AND added NOT IN ({_RETURNED})",
    ),
    _apart("symbol_state", "name", "two symbols have its name at a time"),
    _within("member", "movement", "movement", "its movement"),
    _within("member", "symbol", _SYMBOLS, "its symbol"),
    _within("symbol_state", "prototype", "movement", "its prototype"),
)  # fmt: skip
