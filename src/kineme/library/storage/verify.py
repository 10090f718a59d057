"""Verify a library: every page, checksum, value, reference and size."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from types import TracebackType
from typing import Any

from kineme.errors import DataError, KinemeError
from kineme.library.storage.channels import other_columns
from kineme.library.storage.column_checks import ALL_GOOD, CHECKS
from kineme.library.storage.connection import connect
from kineme.library.storage.content_checks import CONTENTS, samples
from kineme.library.storage.defense import limited
from kineme.library.storage.lifetimes import lives
from kineme.library.storage.rows import Row, has_table, row_name, sealed
from kineme.library.storage.schema import BLOBS, COLUMNS, LATER_META, META
from kineme.library.storage.store import Store

_SHOWN = 100  # messages per check
_BATCH_BYTES = 1 << 24  # of rows whose contents are checked together
_ROW_BYTES = 512  # memory of a row beside its bytes
#: What rows raise that are valid one by one and do not fit together; seals, which anybody can compute, do not tell.
MISFITS = (LookupError, ArithmeticError, ValueError, TypeError, AttributeError, sqlite3.IntegrityError)
_CHAPTER = __name__.rpartition(".storage.")[0]


@dataclass(frozen=True)
class Problem:
    """One problem of a library.

    Attributes
    ----------
    table : str
        Empty for the file as a whole.
    key : int, str or None
        Key of the row: the movement, in the tables of samples, primitives and features.
    text : str
        What is wrong.
    """

    table: str
    key: int | str | None
    text: str

    def __str__(self) -> str:
        return self.text


Check = Callable[[sqlite3.Connection], Iterator[Problem]]


def verify(store: Store, *, pages: bool = True) -> list[Problem]:
    """All problems of the library at one moment; an empty list if there are none.

    `pages` is False if the pages of the file have been checked already.
    """
    with closing(connect(store.path, "ro", store.wait)) as connection, limited(connection, store.path):
        connection.execute("BEGIN")
        checks: list[Check] = [
            *((_structure,) if pages else ()),
            *(_rows(table, store) for table in COLUMNS if has_table(connection, table)),
            _references,
            _completeness,
            _sizes(store),
        ]
        problems = [problem for check in checks for problem in _all_of(check, connection)]
        return problems or _all_of(_lives, connection)  # relations between rows are checked only if each row is valid


def blame(store: Store, error: BaseException) -> None:
    """Raise an error of Python while a library is used as the library's, if it does not verify; else return.

    Raises
    ------
    DataError
        The message names the first problem.
    """
    if isinstance(error, KinemeError) or not isinstance(error, MISFITS) or not _is_ours(error.__traceback__):
        return
    if problems := verify(store):
        raise DataError(
            f"expected the rows of {store.path} to fit together, got {problems[0]}; take it from a backup or an export "
            "that you trust: kineme library verify lists all that is wrong"
        ) from error


def _is_ours(trace: TracebackType | None) -> bool:
    """Whether an error comes from this chapter, and not from the program around it."""
    modules = []
    while trace is not None:
        modules.append(str(trace.tb_frame.f_globals.get("__name__")))
        trace = trace.tb_next
    return sum(name.startswith(_CHAPTER) for name in modules) > 1  # one is the call, whose arguments may be wrong


def _all_of(check: Check, connection: sqlite3.Connection) -> list[Problem]:
    """All problems that a check finds; an error that stops it is one too."""
    problems: list[Problem] = []
    try:
        for problem in check(connection):
            problems.append(problem)
            if len(problems) >= _SHOWN:
                break
    except (sqlite3.Error, UnicodeDecodeError) as error:
        problems.append(Problem("", None, f"the file cannot be read to the end ({error})"))
    return problems


def _structure(connection: sqlite3.Connection) -> Iterator[Problem]:
    for (text,) in connection.execute(f"PRAGMA integrity_check({_SHOWN})"):
        if text != "ok":
            yield Problem("", None, f"the file: {' '.join(text.split())}")


def _rows(table: str, store: Store) -> Check:
    """Check the seal of every row, its values, and their contents; contents only of rows without other problems."""

    def check(connection: sqlite3.Connection) -> Iterator[Problem]:
        try:
            good: list[Row] = []
            size = 0
            for row in connection.execute(f"SELECT {', '.join(COLUMNS[table])}, crc, {ALL_GOOD[table]} FROM {table}"):
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

    return check


def _broken(table: str, row: Row) -> list[Problem]:
    """The problem of a row that does not match its seal."""
    return [] if sealed(table, row) else [Problem(table, row[0], f"{row_name(table, row[0])}: damaged bytes")]


def _strange(connection: sqlite3.Connection, table: str, key: Any) -> Iterator[Problem]:
    """The problems of a row with invalid values."""
    checks = CHECKS[table]
    fits = ", ".join(f"({one.condition}) IS TRUE" for one in checks.values())
    row = connection.execute(f"SELECT {fits} FROM {table} WHERE {COLUMNS[table][0]} IS ?", (key,)).fetchone()
    for (column, one), good in zip(checks.items(), row or (), strict=False):
        if not good:
            yield Problem(table, key, f"{row_name(table, key)}: {column} is not {one.words}")


def _contents(connection: sqlite3.Connection, table: str, rows: list[Row], store: Store) -> Iterator[Problem]:
    if not rows:
        return
    invalid = samples(connection, rows, store.n_dims or 0) if table == "raw" else CONTENTS.get(table, _nothing)(rows)
    yield from (Problem(table, key, f"{row_name(table, key)}: holds {words}") for key, words in invalid)


def _nothing(rows: Sequence[Row]) -> Iterator[tuple[Any, str]]:
    yield from ()


def _one_by_one(connection: sqlite3.Connection, table: str) -> Iterator[Problem]:
    """The movements whose rows cannot be read, in a table that cannot be read as a whole."""
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
    for table in ("version", "movement"):
        last, n = connection.execute(f"SELECT coalesce(max(id), 0), count(*) FROM {table}").fetchone()
        if last != n:
            yield Problem(table, None, f"table {table}: expected {last} rows, numbered from 1, got {n}")
    keys = {key for (key,) in connection.execute("SELECT key FROM meta").fetchall()}
    if strange := keys - META - LATER_META:
        yield Problem(
            "meta", min(strange), f"table meta: expected nothing but {sorted(META | LATER_META)}, got {min(strange)!r}"
        )
    if n and "n_dims" not in keys:
        yield Problem("meta", "n_dims", "row n_dims of table meta: not there")


def _lives(connection: sqlite3.Connection) -> Iterator[Problem]:
    yield from (Problem(table, key, f"{row_name(table, key)}: {words}") for table, key, words in lives(connection))


def _sizes(store: Store) -> Check:
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

    def check(connection: sqlite3.Connection) -> Iterator[Problem]:
        for table, fits in expected.items():
            if not has_table(connection, table):
                continue
            query = f"SELECT id FROM {table} JOIN movement ON id = movement WHERE NOT ({fits}) LIMIT {_SHOWN}"
            for (key,) in connection.execute(query):
                yield Problem(table, key, f"{row_name(table, key)}: of the wrong size")

    return check
