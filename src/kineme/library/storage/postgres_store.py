"""The open library on a PostgreSQL server, and moving a library to it; see `postgres` for its connections."""

from __future__ import annotations

import os
import sqlite3
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from hashlib import sha256
from itertools import islice
from pathlib import Path
from stat import S_ISDIR, S_IWGRP, S_IWOTH
from tempfile import TemporaryDirectory
from typing import Any

from kineme.errors import DataError
from kineme.library.storage import safety
from kineme.library.storage.address import Address
from kineme.library.storage.connection import FILE, connect, define, schema_seal, statements
from kineme.library.storage.postgres import ServerConnection, column_types, definitions
from kineme.library.storage.rows import Database, Row, has_table, insert, select
from kineme.library.storage.schema import COLUMNS, LATER_META, MIGRATIONS, SCHEMA_VERSION
from kineme.library.storage.store import Store
from kineme.library.storage.verify import problems_of

_TYPES = {"INTEGER": "bigint", "REAL": "double precision", "TEXT": "text", "BLOB": "bytea"}
_COPIED_ROWS = 4096  # rows of a table that are moved at a time
_META = ("id", "recognizer", "dmp", "schema", *sorted(LATER_META, reverse=True))  # as SQLite's libraries have them

#: Indexes that keep a recording, a name and a membership unique.
_UNIQUE = {"movement_digest", "movement_place", "symbol_name", "symbol_now", "member_now"}


class PostgresStore(Store):
    """The open library in a schema of a database on a server; as `Store`, with an address instead of a path."""

    path: Address
    many_write = True

    @classmethod
    def exists(cls, path: Address, wait: float = 10.0) -> bool:
        """Tell whether there is a library."""
        with closing(ServerConnection(path, wait, read_only=True)) as connection:
            return connection.schema_version > 0

    def _missing(self) -> str:
        return "none"

    def _create(self, meta: dict[str, str]) -> None:
        with closing(self._connect()) as connection, connection.transaction({}):
            if not connection.schema_version:  # no other process was faster
                create(connection)
                insert(connection, "meta", [*meta.items(), ("schema", schema_seal(connection))])

    def _connect(self) -> ServerConnection:
        safety.refuse_if_lost(self.path)
        return ServerConnection(self.path, self.wait, read_only=self.read_only)

    def _kind(self) -> int:
        return check_kind(self._reader)

    def _migrate(self) -> None:
        with closing(self._connect()) as connection, connection.transaction({}):
            for version in range(check_kind(connection), SCHEMA_VERSION):
                for statement in definitions(MIGRATIONS[version]):
                    connection.run(statement)
            connection.execute("DELETE FROM meta WHERE key = 'schema'")
            insert(connection, "meta", [("schema", schema_seal(connection))])
            connection.set_schema_version(SCHEMA_VERSION)
        self._reader.set_schema_version(None)

    @property
    def folder(self) -> Address:
        """The address of the library."""
        return self.path

    @property
    def name(self) -> str:
        """The name of the library's schema."""
        return self.path.schema

    @property
    def size(self) -> int:
        """Bytes of the library's tables."""
        with self.reading():
            return int(self._reader.size())

    def cache_path(self, name: str) -> Path | None:
        """Return the path of a cache file in a folder that only this user can write; None if there is none."""
        key = sha256(f"{self.path}\0{self.id}".encode()).hexdigest()[:32]
        with suppress(OSError, RuntimeError):  # no permission, or no home
            folder = _user_cache()
            folder.mkdir(parents=True, exist_ok=True)
            for part in ("kineme", "libraries", key):
                folder /= part
                folder.mkdir(exist_ok=True, mode=0o700)
                status = folder.lstat()
                foreign = hasattr(os, "geteuid") and status.st_uid != os.geteuid()
                if foreign or not S_ISDIR(status.st_mode) or status.st_mode & (S_IWGRP | S_IWOTH):
                    return None
            return folder / name
        return None

    def _check_there(self, done: str) -> None:
        """Leave it to each statement, and to the id of the library in each transaction."""

    @contextmanager
    def _transaction(self, writer: Any, reserve: Mapping[str, int]) -> Iterator[dict[str, int]]:
        with writer.transaction(reserve) as first:
            if select(writer, "meta", "key = 'id'") != [("id", self.id)]:
                raise DataError(f"expected {self.path} as it was opened, but it was replaced; open the library again")
            yield first

    @contextmanager
    def snapshot(self) -> Iterator[ServerConnection]:
        """Context manager: a connection of its own that sees the library at one moment."""
        with closing(ServerConnection(self.path, self.wait, read_only=True)) as connection:
            connection.begin("ISOLATION LEVEL REPEATABLE READ")
            yield connection

    @contextmanager
    def database(self, copy: Path) -> Iterator[sqlite3.Connection]:
        """Context manager: the library as a database of SQLite, opened as files are; its row "schema" alone differs.

        It is a file, opened again to read only: else VACUUM writes the entries of indexes in another order.
        """
        with TemporaryDirectory() as folder:
            file = Path(folder) / FILE
            with closing(sqlite3.connect(file, isolation_level=None)) as database:
                define(database, {})
                database.execute("PRAGMA journal_mode = OFF")  # nobody else sees it
                database.execute("PRAGMA synchronous = OFF")
                seals = {"schema": database.execute("SELECT * FROM meta").fetchone()}
                database.execute("DELETE FROM meta")
                database.execute("BEGIN")
                with self.snapshot() as connection:
                    for table, rows in _all_rows(connection, connection.scan):
                        ordered = sorted(rows, key=lambda row: _META.index(row[0])) if table == "meta" else rows
                        marks = ", ".join("?" * (len(COLUMNS[table]) + 1))
                        database.executemany(
                            f"INSERT INTO {table} VALUES ({marks})", [seals.get(row[0], row) for row in ordered]
                        )
                database.execute("COMMIT")
            with closing(connect(file, "ro", self.wait)) as written:
                yield written


def _all_rows(connection: Database, scan: Callable[[str], Iterable[Row]]) -> Iterator[tuple[str, list[Row]]]:
    """Yield rows of all tables with their seals, some of a table at a time, those of `meta` at once."""
    for table, columns in COLUMNS.items():
        if has_table(connection, table):
            rows = iter(scan(f"SELECT {', '.join(columns)}, crc FROM {table} ORDER BY {columns[0]}"))
            while some := list(islice(rows, _COPIED_ROWS)):
                yield table, some


def move_in(store: Store, address: Address) -> Address:
    """Create a library at an address that holds all rows of another one, after checking them there; return it."""
    with closing(ServerConnection(address, store.wait)) as connection, connection.transaction({}):
        if connection.schema_version:
            raise DataError(f"expected a new library, but {address} is there already; choose another schema")
        create(connection)
        with store.reading() as source:
            for table, rows in _all_rows(source, source.execute):
                if table == "meta":
                    insert(connection, "meta", [("schema", schema_seal(connection))])
                connection.copy_rows(table, [row for row in rows if row[0] != "schema"])
        if problems := problems_of(connection, store, pages=False):
            raise DataError(
                f"expected {address} to hold what was moved there, got {problems[0]}; nothing was stored: report this"
            )
    return address


def create(connection: ServerConnection) -> None:
    """Create the tables of an empty library, in a schema that is not there or empty."""
    encoding = connection.run("SHOW server_encoding").fetchone()[0]
    if encoding != "UTF8":
        raise DataError(
            f"expected a database in UTF8 at {connection.address}, got one in {encoding}, which cannot store every "
            "name; create one by: createdb --encoding=UTF8 --template=template0"
        )
    schema = [connection.address.schema]
    if not connection.run("SELECT 1 FROM pg_namespace WHERE nspname = %s", schema).fetchone():
        connection.run(f"CREATE SCHEMA {connection.quoted_schema}")
    query = "SELECT relname FROM pg_class JOIN pg_namespace n ON n.oid = relnamespace WHERE nspname = %s LIMIT 1"
    if other := connection.run(query, schema).fetchone():
        raise DataError(
            f"expected an empty schema, or none, for the library at {connection.address}, got one that holds "
            f"{other[0]!r}; choose another by ?schema=name"
        )
    for statement in definitions(statements(SCHEMA_VERSION)):
        connection.run(statement)
    connection.set_schema_version(SCHEMA_VERSION)


def check_kind(connection: ServerConnection) -> int:
    """Return the schema version; refuse a later one, and definitions that are not ours."""
    version, address = connection.schema_version, connection.address
    if version > SCHEMA_VERSION:
        raise DataError(
            f"expected {address} to have schema version {SCHEMA_VERSION} or earlier, got {version}; upgrade kineme"
        )
    expected = [
        (table, name, _TYPES[kind])
        for table, columns in sorted(column_types(statements(version)).items())
        for name, kind in columns
    ]
    stored = connection.definitions()
    query = """SELECT relname::text FROM pg_index JOIN pg_class ON pg_class.oid = indexrelid
        JOIN pg_namespace ON pg_namespace.oid = relnamespace WHERE nspname = %s AND indisvalid"""
    indexes = {name for (name,) in connection.run(query, [address.schema])}
    if stored != expected or not indexes >= _UNIQUE:
        strange = sorted({*map(str, stored)} ^ {*map(str, expected)}) or sorted(_UNIQUE - indexes)
        raise DataError(
            f"expected {address} to define the tables and indexes of a library, got a difference in "
            f"{strange[0]}; restore it from a backup or an export"
        )
    return version


def _user_cache() -> Path:
    """Return the folder for caches of this user, by the convention of the system."""
    given = os.environ.get("LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME", "")
    if os.path.isabs(given):
        return Path(given)
    return Path.home() / ("Library/Caches" if sys.platform == "darwin" else ".cache")
