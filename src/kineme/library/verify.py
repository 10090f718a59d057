"""Looking for damage: every page, every checksum, every reference, every size."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass

from kineme.library.connection import connect
from kineme.library.rows import Row, row_name, seal
from kineme.library.schema import BLOBS, COLUMNS
from kineme.library.store import Store

_SHOWN = 100  # messages of one check


@dataclass(frozen=True)
class Problem:
    """One thing that is not as it was stored.

    Attributes
    ----------
    table : str
        Empty where the file as a whole is meant.
    key : int, str or None
        Of the row: the movement, in the tables of samples, primitives and features.
    text : str
        What is wrong.
    """

    table: str
    key: int | str | None
    text: str

    def __str__(self) -> str:
        return self.text


def verify(store: Store) -> list[Problem]:
    """All that is damaged, as it is at one moment; an empty list if nothing is."""
    with closing(connect(store.path, "ro", store.wait)) as connection:
        connection.execute("BEGIN")
        checks: list[Callable[[sqlite3.Connection], Iterator[Problem]]] = [
            _structure,
            *(_seals(table) for table in COLUMNS),
            _references,
            _completeness,
            _sizes(store),
        ]
        return [problem for check in checks for problem in _all_of(check, connection)]


def _all_of(check: Callable[[sqlite3.Connection], Iterator[Problem]], connection: sqlite3.Connection) -> list[Problem]:
    """What a check finds; that it cannot go on is a finding too."""
    found: list[Problem] = []
    try:
        for problem in check(connection):
            found.append(problem)
            if len(found) >= _SHOWN:
                break
    except (sqlite3.Error, UnicodeDecodeError) as error:
        found.append(Problem("", None, f"the file cannot be read to the end ({error})"))
    return found


def _structure(connection: sqlite3.Connection) -> Iterator[Problem]:
    for (text,) in connection.execute(f"PRAGMA integrity_check({_SHOWN})"):
        if text != "ok":
            yield Problem("", None, f"the file: {' '.join(text.split())}")


def _seals(table: str) -> Callable[[sqlite3.Connection], Iterator[Problem]]:
    def check(connection: sqlite3.Connection) -> Iterator[Problem]:
        try:
            for row in connection.execute(f"SELECT {', '.join(COLUMNS[table])}, crc FROM {table}"):
                yield from _broken(table, row)
        except (sqlite3.Error, UnicodeDecodeError) as error:
            yield Problem(table, None, f"table {table} cannot be read as a whole ({error})")
            yield from _one_by_one(connection, table)

    return check


def _broken(table: str, row: Row) -> Iterator[Problem]:
    try:
        fits = seal(table, row[:-1]) == row[-1]
    except (TypeError, UnicodeError):  # a value of another type than was stored
        fits = False
    if not fits:
        yield Problem(table, row[0], f"{row_name(table, row[0])}: damaged bytes")


def _one_by_one(connection: sqlite3.Connection, table: str) -> Iterator[Problem]:
    """Which movements' rows cannot be read, in a table that cannot be read in one go."""
    if table not in BLOBS:
        return
    for (key,) in connection.execute("SELECT id FROM movement").fetchall():
        try:
            row = connection.execute(f"SELECT *, movement FROM {table} WHERE movement = ?", (key,)).fetchone()
        except (sqlite3.Error, UnicodeDecodeError) as error:
            yield Problem(table, key, f"{row_name(table, key)}: cannot be read ({error})")
        else:
            yield from _broken(table, row[:-1]) if row is not None else ()


def _references(connection: sqlite3.Connection) -> Iterator[Problem]:
    for table, key, parent, _ in connection.execute("PRAGMA foreign_key_check"):
        yield Problem(table, key, f"{row_name(table, key)}: refers to a row of table {parent} that is not there")


def _completeness(connection: sqlite3.Connection) -> Iterator[Problem]:
    for table in BLOBS:
        query = f"SELECT id FROM movement WHERE id NOT IN (SELECT movement FROM {table}) LIMIT {_SHOWN}"
        for (key,) in connection.execute(query):
            yield Problem(table, key, f"{row_name(table, key)}: not there")
    last, n = connection.execute("SELECT coalesce(max(id), 0), count(*) FROM version").fetchone()
    if last != n:
        yield Problem("version", None, f"table version: expected {last} versions, got {n}")


def _sizes(store: Store) -> Callable[[sqlite3.Connection], Iterator[Problem]]:
    specification, d = store.specification, store.n_dims or 0
    n_features, n_weights = sum(specification.widths(d)), d * specification.dmp.n_basis
    expected = {
        "raw": f"length(start) = {8 * d} AND length(positions) = {4 * d} * n_samples "
        "AND (times IS NULL OR length(times) IN (4 * n_samples, 8 * n_samples))",
        "primitive": f"length(boundary) = {32 * d} AND length(weights) = {4 * n_weights}",
        "feature": f"length(rows) = {4 * n_features}",
    }

    def check(connection: sqlite3.Connection) -> Iterator[Problem]:
        for table, fits in expected.items():
            query = f"SELECT id FROM {table} JOIN movement ON id = movement WHERE NOT ({fits}) LIMIT {_SHOWN}"
            for (key,) in connection.execute(query):
                yield Problem(table, key, f"{row_name(table, key)}: of the wrong size")

    return check
