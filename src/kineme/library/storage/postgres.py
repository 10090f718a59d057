"""Connections to the schema of a library on a PostgreSQL server.

The rest of the storage speaks the SQL of SQLite; here its statements are translated. What differs:

- Columns have types, so that a check of a type becomes one of presence.
- Rows are added by COPY.
- Writers take turns by advisory locks. Whoever changes what is there holds the lock of the library throughout. Whoever
  learns holds it only to reserve keys, behind those of all who learn, whose locks say where these end; it writes beside
  them, and commits if the one before it did, so that versions and keys have no gaps. Where two learn the same, or one
  fails, unique indexes and the order of versions show it: it is written again, with other keys.
"""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache
from hashlib import sha256
from typing import Any

from kineme.errors import DataError, KinemeError
from kineme.io.records import needs
from kineme.library.storage.address import Address
from kineme.library.storage.connection import BusyError, ConflictError
from kineme.library.storage.rows import Row, next_key
from kineme.library.storage.schema import COLUMNS, CREATE, MIGRATIONS

_CUT = (
    "expected the connection to {path} to last, got it cut ({error}); nothing of this step was stored, and what was "
    "committed before is safe: run it again"
)
_CONFLICT = (
    "expected to write to {path}, got in the way of another process ({error}); nothing of this step was stored: run it "
    "again"
)
_BUSY = (
    "expected to write to {path}, got no turn: another process has been writing for more than {wait:g} s; try again "
    "when it has finished"
)
_CHANGED = (
    "expected {path} to hold the tables of a library, got others ({error}); it was deleted or changed: restore it from "
    "a backup or an export"
)

#: Code of PostgreSQL, or how it begins -> message; the longest that fits counts.
_WORDS = {
    "55P03": _BUSY,
    "40": _CONFLICT,
    "23505": _CONFLICT,
    "23P01": _CONFLICT,  # of `symbol_name`, which is no unique index here
    "08": _CUT,
    "57P": _CUT,
    "25P03": _CUT,  # a transaction without a word for too long
    "53": (
        "expected room on the server of {path}, got none ({error}); nothing of this step was stored, and what was "
        "committed before is safe: free some space, memory or connections and run it again"
    ),
    "42501": "expected permission to read or write {path}, got none ({error}); ask who manages the server for it",
    "25006": "expected to write to {path}, got a connection that only reads ({error}); open it again to write",
    "42P01": _CHANGED,
    "42703": _CHANGED,
    "3F": _CHANGED,
    "XX": (
        "expected {path} to be readable, got damaged pages ({error}); restore it from a backup or an export: kineme "
        "library verify names what is damaged"
    ),
    "22": "expected values that a PostgreSQL server can store in {path}, got others ({error}); nothing was stored",
}
_UNREACHED = (
    "expected a connection to {path}, got none ({error}); check the address, that the server runs, and the password, "
    "which may stand in PGPASSWORD or in a password file"
)

_TYPES = {"INTEGER": "BIGINT", "REAL": "DOUBLE PRECISION", "TEXT": 'TEXT COLLATE "C"', "BLOB": "BYTEA"}
_COPIED = {"INTEGER": "int8", "REAL": "float8", "TEXT": "text", "BLOB": "bytea"}
_COLUMN = re.compile(r"\b(\w+) (INTEGER|REAL|TEXT|BLOB)\b")
_REFERENCE = re.compile(r"\s+REFERENCES\s+\w+")
_TABLE = re.compile(r"CREATE TABLE (\w+)")

#: Indexes of texts, which may be longer than an entry of an ordinary index.
_INDEXES = {
    "movement_place": "CREATE UNIQUE INDEX movement_place ON movement (source, md5(place)) "
    "WHERE removed IS NULL AND source IS NOT NULL",
    "symbol_name": "ALTER TABLE symbol_state ADD CONSTRAINT symbol_name "
    "EXCLUDE USING hash (name WITH =) WHERE (removed IS NULL)",
    "source_sha256": "CREATE INDEX source_sha256 ON source USING hash (sha256)",
}

#: What SQLite writes in another way, in this order.
_DIALECT = (
    (re.compile("%"), "%%"),
    (re.compile(r"typeof\((\w+)\) = '\w+'"), r"\1 IS NOT NULL"),
    (re.compile(r"length\(CAST\((\w+) AS BLOB\)\)"), r"octet_length(\1)"),
    (re.compile(r"instr\(\w+, char\(0\)\) = 0"), "TRUE"),  # no text holds it
    (re.compile(r"GLOB '([^'*]*)\*'"), r"~ '^\1'"),
    (re.compile(r"GLOB '([^'*]*)'"), r"~ '^\1$'"),
    (re.compile(r"IN \(SELECT value FROM json_each\(:(\w+)\)\)"), r"= ANY(%(\1)s)"),
    (re.compile(r" IS \?"), " IS NOT DISTINCT FROM ?"),
    (re.compile(r"\?"), "%s"),
    (re.compile(r"(?<![:\w]):(\w+)"), r"%(\1)s"),
)

_COMMENT = re.compile(r"library of kineme, schema version (\d+)")
_KEYS = 1 << 31  # keys of locks, from 0
_FETCHED = 256  # rows of a scan that are fetched at a time
_PAUSE = 0.1  # seconds between two questions
_PATIENCE = 5.0  # seconds, at least, in which an interrupted commit is asked for
_SILENCE = "60s"  # a process that says nothing for so long within a transaction loses its turn


@lru_cache(maxsize=512)
def translated(statement: str) -> str:
    """Return a statement of SQLite as PostgreSQL takes it."""
    for pattern, words in _DIALECT:
        statement = pattern.sub(words, statement)
    return statement


def column_types(statements: Sequence[str]) -> dict[str, list[tuple[str, str]]]:
    """Return table -> its columns with their types, of the statements that create them in SQLite."""
    created = [(match[1], statement) for statement in statements if (match := _TABLE.match(statement))]
    return {table: _COLUMN.findall(text) for table, text in created}


_COPY = {
    table: [_COPIED[kind] for _, kind in columns]
    for table, columns in column_types([*CREATE, *(text for later in MIGRATIONS.values() for text in later)]).items()
}


def definitions(statements: Sequence[str]) -> list[str]:
    """Return the statements that create a library, or a part of it, on a server.

    References are not enforced, as `verify` checks them; bytes are not compressed, which floats would not gain by.
    """
    result = []
    for statement in statements:
        name = statement.partition(" INDEX ")[2].partition(" ")[0]
        plain = _REFERENCE.sub("", _INDEXES.get(name, statement))
        result.append(_COLUMN.sub(lambda match: f"{match[1]} {_TYPES[match[2]]}", plain))
    for table, columns in column_types(statements).items():
        blobs = [name for name, kind in columns if kind == "BLOB"]
        result += [f"ALTER TABLE {table} ALTER COLUMN {name} SET STORAGE EXTERNAL" for name in blobs]
        result += [f"ALTER TABLE {table} SET (toast_tuple_target = 8160)"] * bool(blobs)
    return result


class ServerConnection:
    """A connection to the schema of a library, for one thread at a time; opened again where it was cut in between."""

    def __init__(self, address: Address, wait: float, *, read_only: bool = False) -> None:
        with needs("psycopg", "open a library on PostgreSQL", "postgres"):
            import psycopg
        self._driver, self.address, self.wait, self._read_only = psycopg, address, wait, read_only
        digest = sha256(address.schema.encode()).digest()
        self._lock = int.from_bytes(digest[:8], signed=True)
        number = int.from_bytes(digest[8:12]) % _KEYS // len(_COPY) * len(_COPY)
        self._places = {table: number + k for k, table in enumerate(_COPY)}  # of the locks of writers under way
        self._version: int | None = None
        self._scans = 0
        self._inside = False  # of a transaction
        self._version_row: Row | None = None  # that this transaction has written
        self._session: Any = None
        self._session = self._open()

    def _open(self) -> Any:
        names = {part.partition("=")[0] for part in self.address.uri.partition("?")[2].split("&")}
        options: dict[str, Any] = {"client_encoding": "utf8", "fallback_application_name": "kineme"}
        if "connect_timeout" not in names and "PGCONNECT_TIMEOUT" not in os.environ:
            options["connect_timeout"] = max(2, round(self.wait))
        with self._in_plain_words(_UNREACHED):
            session = self._driver.connect(self.address.uri, autocommit=True, **options)
        settings = {
            "search_path": f"{self.quoted_schema}, pg_temp",
            "lock_timeout": str(max(1, round(1000 * self.wait))),
            "default_transaction_isolation": "read committed",
            "default_transaction_read_only": "on" if self._read_only else "off",
            "idle_in_transaction_session_timeout": _SILENCE,
            "work_mem": "64MB",
        }
        changes = ", ".join(["set_config(%s, %s, false)"] * len(settings))
        try:
            with self._in_plain_words():
                session.execute(f"SELECT {changes}", [text for pair in settings.items() for text in pair])
        except BaseException:
            session.close()
            raise
        return session

    @contextmanager
    def _in_plain_words(self, otherwise: str = "") -> Iterator[None]:
        """Convert errors of the server to `DataError`, without a password."""
        try:
            yield
        except self._driver.Error as error:
            code = error.sqlstate or ""
            words = otherwise or next((_WORDS[code[:k]] for k in range(5, 1, -1) if code[:k] in _WORDS), "")
            if not words:
                words = _CUT if self._session is None or self._session.closed else _WORDS["22"]
            text = self.address.without_secrets(" ".join(str(error).split()))
            kind = {_CONFLICT: ConflictError, _BUSY: BusyError}.get(words, DataError)
            raise kind(words.format(path=self.address, wait=self.wait, error=text)) from None

    def execute(self, statement: str, parameters: Any = ()) -> Any:
        """Execute a statement of SQLite; see `transaction` for those that begin and end one."""
        if isinstance(parameters, Mapping) and "json_each" in statement:
            parameters = {**parameters, "keys": json.loads(parameters["keys"])}
        for value in parameters.values() if isinstance(parameters, Mapping) else parameters:
            if isinstance(value, str) and "\0" in value:
                raise UnicodeEncodeError("utf-8", value, value.index("\0"), value.index("\0") + 1, "in no database")
        return self.run(translated(statement), parameters)

    def run(self, query: str, parameters: Any = None) -> Any:
        """Execute a statement of PostgreSQL."""
        if self._session.closed and not self._inside:
            self._session = self._open()
        with self._in_plain_words():
            try:
                return self._session.execute(query, parameters, binary=True)
            except self._driver.OperationalError:
                if self._inside or not self._session.closed:
                    raise
        self._session = self._open()  # it was cut before, as by a restart of the server
        with self._in_plain_words():
            return self._session.execute(query, parameters, binary=True)

    def executemany(self, statement: str, parameters: Any) -> None:
        """Execute a statement of SQLite with each of several parameters."""
        with self._in_plain_words(), self._session.cursor() as cursor:
            cursor.executemany(translated(statement), parameters)

    def scan(self, statement: str) -> Iterator[Row]:
        """Yield the rows of a statement of SQLite, of which few are in memory; within a transaction."""
        self._scans += 1
        with self._session.cursor(f"scan {self._scans}") as cursor:
            with self._in_plain_words():
                cursor.execute(translated(statement), binary=True)
                rows = cursor.fetchmany(_FETCHED)
            while rows:
                yield from rows
                with self._in_plain_words():
                    rows = cursor.fetchmany(_FETCHED)

    def copy_rows(self, table: str, rows: Sequence[Row]) -> None:
        """Add rows with their seals to a table."""
        if not rows:
            return
        if table == "version":
            self._version_row = rows[0]
        statement = f"COPY {table} FROM STDIN (FORMAT BINARY)"
        with self._in_plain_words(), self._session.cursor() as cursor, cursor.copy(statement) as copy:
            copy.set_types(_COPY[table])
            for row in rows:
                copy.write_row(row)

    @property
    def quoted_schema(self) -> str:
        """The name of the schema as a statement holds it."""
        return '"' + self.address.schema.replace('"', '""') + '"'

    def size(self) -> int:
        """Return the bytes of the tables."""
        query = """SELECT coalesce(sum(pg_total_relation_size(pg_class.oid)), 0)::bigint FROM pg_class
            JOIN pg_namespace ON pg_namespace.oid = relnamespace WHERE nspname = %s AND relkind = 'r'"""
        return int(self.run(query, [self.address.schema]).fetchone()[0])

    def set_schema_version(self, version: int | None) -> None:
        """Note which version the tables have; None where another connection did."""
        if version is not None:
            self.run(f"COMMENT ON SCHEMA {self.quoted_schema} IS 'library of kineme, schema version {version}'")
        self._version = version

    @property
    def schema_version(self) -> int:
        """The version of the library's tables; 0 where there is no library."""
        if self._version is None:
            query = "SELECT obj_description(oid, 'pg_namespace') FROM pg_namespace WHERE nspname = %s"
            row = self.run(query, [self.address.schema]).fetchone()
            match = _COMMENT.fullmatch(row[0] or "") if row else None
            self._version = int(match[1]) if match else None
        return self._version or 0

    def definitions(self) -> list[Row]:
        """Return table, column and type of every column of the library's tables, in order."""
        query = """SELECT relname::text, attname::text, format_type(atttypid, atttypmod) FROM pg_attribute
            JOIN pg_class ON pg_class.oid = attrelid JOIN pg_namespace ON pg_namespace.oid = relnamespace
            WHERE nspname = %s AND relname = ANY(%s) AND relkind = 'r' AND attnum > 0 AND NOT attisdropped
            ORDER BY relname, attnum"""
        return list(self.run(query, [self.address.schema, list(_COPY)]).fetchall())

    def begin(self, how: str = "") -> None:
        """Begin a transaction, which ends with the connection unless `transaction` ends it."""
        self.run(f"BEGIN {how}")
        self._inside, self._version_row = True, None

    @contextmanager
    def transaction(self, reserve: Mapping[str, int]) -> Iterator[dict[str, int]]:
        """Return a transaction in which no other writes; or beside others, with the first of its keys in each table."""
        self.begin()
        try:
            first = self._reserved(reserve) if reserve else {}
            if not first:
                self._lock_all()
            yield first
            self._commit()
            self._inside = False
        except BaseException:
            with suppress(KinemeError):  # of a connection that is cut nothing is stored, and no lock is left
                if not self._session.closed:
                    self.run("ROLLBACK")
                    self.run("SELECT pg_advisory_unlock_all()")  # which a transaction does not hold
            self._inside = False
            raise

    def _lock_all(self) -> None:
        """Wait for the lock of the library, and for all writers under way, which need that no more."""
        self.run("SELECT pg_advisory_xact_lock(%s)", [self._lock])
        for place, end in self._ends():
            self.run("SELECT pg_advisory_xact_lock_shared(%s, %s)", [place, end])

    def _ends(self) -> list[tuple[int, int]]:
        """Return the locks of writers under way, that hold one of a version: table, and last key in it `% _KEYS`."""
        query = """WITH held AS (
            SELECT pid, classid::bigint AS place, objid::int AS key FROM pg_locks
            JOIN pg_database ON pg_database.oid = database WHERE datname = current_database() AND granted
            AND locktype = 'advisory' AND classid::bigint = ANY(%s) AND objsubid = 2 AND mode = 'ExclusiveLock')
            SELECT place, key FROM held WHERE pid IN (SELECT pid FROM held WHERE place = %s)"""
        return list(self.run(query, [list(self._places.values()), self._places["version"]]).fetchall())

    def _reserved(self, reserve: Mapping[str, int]) -> dict[str, int]:
        """Return the first of so many keys in each table, behind those of all writers under way."""
        self.run("SELECT pg_advisory_lock(%s)", [self._lock])
        while True:
            ends = self._ends()  # before the rows that are committed: no key is in neither
            beyond = self._beyond("version", ends)
            if {reach for reach, _ in beyond} == set(range(1, len(beyond) + 1)):
                break
            for _, end in beyond:  # one has failed, and so will those behind it
                self.run("SELECT pg_advisory_lock_shared(%s, %s)", [self._places["version"], end])
                self.run("SELECT pg_advisory_unlock_shared(%s, %s)", [self._places["version"], end])
        first = {}
        for table, n in reserve.items():
            place = self._places[table]
            first[table] = next_key(self, table) + max((reach for reach, _ in self._beyond(table, ends)), default=0)
            if n:
                self.run("SELECT pg_advisory_xact_lock(%s, %s)", [place, (first[table] + n - 1) % _KEYS])
        self.run("SELECT pg_advisory_unlock(%s)", [self._lock])
        return first

    def _beyond(self, table: str, ends: list[tuple[int, int]]) -> list[tuple[int, int]]:
        """Return how far the keys of a table that are reserved reach beyond the committed ones, with their locks."""
        last = next_key(self, table) - 1
        reaches = [((end - last) % _KEYS, end) for place, end in ends if place == self._places[table]]
        return [(reach, end) for reach, end in reaches if 0 < reach < _KEYS // 2]

    def wait_for_turn(self, first: Mapping[str, int]) -> None:
        """Wait until the version before is committed; a ConflictError if it is not, or left other keys in a table."""
        before = (first["version"] - 1) % _KEYS
        self.run("SELECT pg_advisory_xact_lock_shared(%s, %s)", [self._places["version"], before])
        for table, key in first.items():
            column = COLUMNS[table][0]
            query = f"SELECT coalesce(max({column}), 0) FROM {table} WHERE {column} < %s"
            if self.run(query, [key]).fetchone()[0] != key - 1:
                raise ConflictError(_CONFLICT.format(path=self.address, error="a writer before it failed"))

    def _commit(self) -> None:
        """Commit; where the connection is cut meanwhile, look by another one whether the version is there."""
        try:
            self.run("COMMIT")
        except DataError as error:
            if not self._session.closed:
                raise
            stored = self._is_stored()
            if stored is None:
                raise DataError(
                    f"expected {self.address} to answer whether the last step was stored, got a connection that was "
                    "cut and no other; it was stored as a whole or not at all: look at kineme library history, and "
                    "run it again where it is missing; what is learned again is stored once"
                ) from error
            if not stored:
                raise

    def _is_stored(self) -> bool | None:
        """Tell whether the version of the last transaction is stored; None if the server cannot be asked in time."""
        late = time.monotonic() + max(_PATIENCE, self.wait)
        while self._version_row is not None and time.monotonic() < late:
            with suppress(DataError):
                self._session = self._open()
                self.run("BEGIN")
                self._lock_all()  # which whatever is left of that transaction holds until it ends
                row = self.run("SELECT * FROM version WHERE id = %s", self._version_row[:1]).fetchone()
                self.run("ROLLBACK")
                return bool(row == self._version_row)
            self._session.close()
            time.sleep(_PAUSE)
        return None

    def close(self) -> None:
        """Close the connection."""
        self._session.close()
