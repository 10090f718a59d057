"""Open the database of a library: checks of the file, and settings that keep writes safe, also over a power cut."""

from __future__ import annotations

import os
import sqlite3
import zlib
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any
from urllib.parse import quote

from kineme.errors import DataError, KinemeError
from kineme.library.storage.rows import Database, Row, damage, insert, select
from kineme.library.storage.safety import Connection, defend, file_of, open_connection
from kineme.library.storage.schema import APPLICATION_ID, CREATE, META, MIGRATIONS, PAGE_SIZE, SCHEMA_VERSION
from kineme.reporting.atomic import OF_SQLITE, remove_leftovers, whole_file

_DAMAGED = (
    "expected {path} to be readable, got damaged bytes ({error}); take the file from a backup or an export: where the "
    "file can still be opened, kineme library verify names what is damaged"
)

#: Messages of SQLite about damage without an error code of its own.
_DAMAGE = ("decode", "unsupported file format")

#: Primary result code of SQLite -> message; see sqlite.org/rescode.html for the codes.
_WORDS = {
    sqlite3.SQLITE_BUSY: (
        "expected to write to {path}, got no turn: another process has been writing for more than {wait:g} s; "
        "try again when it has finished"
    ),
    sqlite3.SQLITE_FULL: (
        "expected room to write to {path}, got a full disk; nothing of this step was stored, and what was committed "
        "before is safe: free some space and run it again"
    ),
    sqlite3.SQLITE_IOERR: (
        "expected to read or write {path}, got an input/output error ({error}); nothing of this step was stored, and "
        "what was committed before is safe: check the disk and its free space, and run it again"
    ),
    sqlite3.SQLITE_READONLY: (
        "expected to write to {path}, got a read-only file or folder ({error}); open it with read_only=True or change "
        "the permissions"
    ),
    sqlite3.SQLITE_CANTOPEN: (
        "expected to open {path}, got {error}; check that the folder exists and that you may read and write in it, or "
        "open it with read_only=True; where a crash has left a log (-wal) beside it, reading needs to write once"
    ),
    sqlite3.SQLITE_CORRUPT: _DAMAGED,
    sqlite3.SQLITE_INTERRUPT: (
        "expected {path} to be read within a time that its size allows, got a file whose pages do not end; do not use "
        "it: take it from a backup or an export that you trust"
    ),
    sqlite3.SQLITE_TOOBIG: "expected {path} to hold no value larger than itself, got one ({error}): damaged bytes",
    sqlite3.SQLITE_NOTADB: (
        "expected {path} to be a library, got a file that is no database ({error}); correct the path, or take it from "
        "a backup"
    ),
}
_WORDS[sqlite3.SQLITE_LOCKED] = _WORDS[sqlite3.SQLITE_BUSY]
_WORDS[sqlite3.SQLITE_PERM] = _WORDS[sqlite3.SQLITE_READONLY]

FILE = "library.sqlite"
LOGS = ("-wal", "-journal")  # suffixes of the files beside a database from which SQLite may change it

_WRITER_CACHE_KIB = 65536
_LOG_BYTES = 1 << 26  # size to which the write-ahead log is truncated
_DEFINITIONS = "SELECT type, name, tbl_name, sql FROM sqlite_master ORDER BY type, name"


def connect(path: Path, mode: str, wait: float) -> Connection:
    """Return a connection in ``mode`` "ro", "rw" or "rwc"; transactions are begun explicitly."""
    path = file_of(path)
    address = f"file:{quote(os.fsencode(path))}?mode={mode}"
    # Where the folder is read-only for this user and has no log, SQLite cannot lock, and reads without. It then assumes
    # that the file does not change: if another user writes to it meanwhile, rows are refused as damaged until the
    # library is opened again.
    if mode == "ro" and (
        not os.access(path.parent, os.W_OK, effective_ids=os.access in os.supports_effective_ids)
        and not path.with_name(path.name + "-wal").exists()
    ):
        address += "&immutable=1"
    connection = open_connection(address, uri=True, timeout=wait, isolation_level=None, check_same_thread=False)
    try:
        connection.execute("PRAGMA synchronous = FULL")
        defend(connection)
        connection.watch(path)
        connection.execute("PRAGMA temp_store = MEMORY")
        if mode != "ro":
            connection.execute(f"PRAGMA cache_size = -{_WRITER_CACHE_KIB}")
            connection.execute(f"PRAGMA journal_size_limit = {_LOG_BYTES}")
            # After every commit, so that the file is complete if somebody copies it alone.
            connection.execute("PRAGMA wal_autocheckpoint = 1")
    except BaseException:
        connection.close()
        raise
    return connection


def create(path: Path, meta: dict[str, str]) -> None:
    """Create an empty library, atomically."""
    with in_plain_words(path, 0.0), suppress(FileExistsError):  # another process may create it at the same time
        path.parent.mkdir(parents=True, exist_ok=True)
        check_alone(path)
        with new_database(path) as beside, closing(open_connection(beside, isolation_level=None)) as connection:
            define(connection, meta)


def define(connection: sqlite3.Connection, meta: dict[str, str]) -> None:
    """Make an empty database an empty library."""
    connection.execute(f"PRAGMA page_size = {PAGE_SIZE}")
    connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("BEGIN")
    for statement in statements(SCHEMA_VERSION):
        connection.execute(statement)
    insert(connection, "meta", [*meta.items(), ("schema", schema_seal(connection))])
    connection.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
    connection.execute("COMMIT")


def check_alone(path: Path) -> None:
    """Refuse to create a library beside the log of a deleted one: SQLite would apply that log to the new one."""
    left = logs_of(path)
    if left and not path.exists():  # in this order: the log of a library that is created now appears after it
        raise DataError(
            f"expected no log without its library, found {left[0]} and no {path.name}; put the library back, or delete "
            "the log, which is of no use without it"
        )


def logs_of(path: Path) -> list[Path]:
    """Return the logs with changes of a database."""
    file = file_of(path)
    logs = [file.with_name(file.name + end) for end in LOGS]
    return [log for log in logs if log.exists() and log.stat().st_size]


def check_kind(connection: sqlite3.Connection, path: Path) -> int:
    """Return the schema version; refuse another program's database, a later version, definitions that are not ours."""
    if connection.execute("PRAGMA application_id").fetchone()[0] != APPLICATION_ID:
        got = "another program's database" if path.stat().st_size else "an empty file"
        raise DataError(
            f"expected {path} to be a library of kineme, got {got}; correct the path, or take it from a backup"
        )
    version = int(connection.execute("PRAGMA user_version").fetchone()[0])
    if not 1 <= version <= SCHEMA_VERSION:
        raise DataError(
            f"expected {path} to have schema version {SCHEMA_VERSION} or earlier, got {version}; upgrade kineme"
        )
    _check_definitions(connection, path, version)
    return version


def _check_definitions(connection: sqlite3.Connection, path: Path, version: int) -> None:
    """Refuse definitions that differ from those of a library in any character: a trigger or view could do anything."""
    encoding = connection.execute("PRAGMA encoding").fetchone()[0]
    expected = _definitions(statements(version))
    stored = connection.execute(f"{_DEFINITIONS} LIMIT {len(expected) + 1}").fetchall()
    if stored == expected and encoding == "UTF-8":
        return
    strange = [definition for definition in stored if definition not in expected]
    got = f"the {strange[0][0]} {strange[0][1]!r}, which is none of them" if strange else "fewer"
    raise DataError(
        f"expected {path} to define the tables and indexes of a library and nothing else, got "
        f"{got if stored != expected else f'texts in {encoding}'}; do not use this file: take it from a backup or an "
        "export that you trust"
    )


def checked_meta(connection: Database, path: Any) -> dict[str, str]:
    """Return the rows of the table `meta`, after a check that the definitions of the tables are undamaged."""
    try:
        meta: dict[str, str] = dict(select(connection, "meta"))
        if meta.keys() >= META and meta["schema"] == schema_seal(connection):
            return meta
    except sqlite3.OperationalError as error:
        if "no such" not in str(error):  # table or column
            raise
    raise damage(f"the definitions of tables in {path}, and its specification, as they were stored", "damaged bytes")


def statements(version: int) -> tuple[str, ...]:
    """Return the statements that create a library of this schema version, equal in every character to migration's."""
    return (*CREATE, *(statement for earlier in range(1, version) for statement in MIGRATIONS[earlier]))


@lru_cache(maxsize=8)
def _definitions(statements: tuple[str, ...]) -> list[Row]:
    with closing(sqlite3.connect(":memory:", isolation_level=None)) as connection:
        for statement in statements:
            connection.execute(statement)
        return connection.execute(_DEFINITIONS).fetchall()


def migrate(connection: sqlite3.Connection, path: Path) -> None:
    """Migrate an older library to the current schema, in one transaction."""
    with transaction(connection):
        for version in range(check_kind(connection, path), SCHEMA_VERSION):
            for statement in MIGRATIONS[version]:
                connection.execute(statement)
        connection.execute("DELETE FROM meta WHERE key = 'schema'")
        insert(connection, "meta", [("schema", schema_seal(connection))])
        connection.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
        _check_definitions(connection, path, SCHEMA_VERSION)


def schema_seal(connection: Database) -> str:
    """Return a checksum of the tables' definitions."""
    of_server = getattr(connection, "definitions", None)
    rows = connection.execute(_DEFINITIONS).fetchall() if of_server is None else of_server()
    return str(zlib.crc32(repr(rows).encode()))


@contextmanager
def transaction(connection: sqlite3.Connection) -> Iterator[None]:
    """Return an atomic transaction. It waits for the write lock at its beginning, never later."""
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield
        connection.execute("COMMIT")
    except BaseException:
        if connection.in_transaction:
            connection.execute("ROLLBACK")
        raise


@contextmanager
def new_database(path: Path) -> Iterator[Path]:
    """Context manager: a name beside `path` for a new database, renamed to `path`; a FileExistsError if that exists."""
    if not path.exists():
        remove_leftovers(path.parent, ".+", _is_library)  # of any name: that of an export is often never used again
    with whole_file(path, replace=False, companions=OF_SQLITE) as beside:
        yield beside


def _is_library(path: Path) -> bool:
    """Tell whether a file begins like a library."""
    if path.is_symlink() or not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(72)
    return head[:16] == b"SQLite format 3\0" and head[68:] == APPLICATION_ID.to_bytes(4, "big")


class BusyError(DataError):
    """Another process writes; the same may be tried again later."""


class ConflictError(BusyError):
    """Two writers on a server were in each other's way; the same may be tried again at once."""


@contextmanager
def in_plain_words(path: Path, wait: float) -> Iterator[None]:
    """Convert errors of the database to `DataError`; programming errors stay as they are."""
    try:
        yield
    except (KinemeError, FileExistsError):  # the latter is handled by the caller
        raise
    except OSError as error:
        raise DataError(f"expected to read or write {path}, got an error of the system ({error})") from error
    except UnicodeDecodeError as error:  # of a name of a column
        raise DataError(_DAMAGED.format(path=path, error=error)) from error
    except sqlite3.Error as error:
        code = getattr(error, "sqlite_errorcode", None)
        words = _WORDS.get(code & 0xFF) if code is not None else None
        if words is None and any(said in str(error) for said in _DAMAGE):
            words = _DAMAGED
        if words is None:
            raise
        kind = BusyError if words == _WORDS[sqlite3.SQLITE_BUSY] else DataError
        raise kind(words.format(path=path, wait=wait, error=error)) from error
