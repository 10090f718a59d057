"""Opening the database of a library: what it must be, and what keeps its writes safe.

Write-ahead log: one writer and any number of readers, and a transaction is there as a whole or not at all.
``synchronous = FULL``: a commit is on the disk when it returns, also after a power cut. It costs one fsync a commit,
and learning commits thousands of movements at a time.
"""

from __future__ import annotations

import os
import sqlite3
import zlib
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from urllib.parse import quote

from kineme.errors import DataError
from kineme.library.faults import in_plain_words
from kineme.library.over_forks import Connection, open_connection
from kineme.library.placing import placed
from kineme.library.rows import insert
from kineme.library.schema import APPLICATION_ID, CREATE, MIGRATIONS, PAGE_SIZE, SCHEMA_VERSION

FILE = "library.sqlite"
_WRITER_CACHE_KIB = 65536
_LOG_BYTES = 1 << 26  # what the write-ahead log is cut back to


def connect(path: Path, mode: str, wait: float) -> Connection:
    """A connection in ``mode`` "ro", "rw" or "rwc"; transactions are begun by hand."""
    address = f"file:{quote(str(path))}?mode={mode}"
    if mode == "ro" and _cannot_keep_a_log(path):
        address += "&immutable=1"
    connection = open_connection(address, uri=True, timeout=wait, isolation_level=None, check_same_thread=False)
    try:
        connection.execute("PRAGMA synchronous = FULL")
        connection.execute("PRAGMA cell_size_check = ON")
        connection.execute("PRAGMA trusted_schema = OFF")  # an imported file may say anything
        connection.execute("PRAGMA temp_store = MEMORY")
        if mode != "ro":
            connection.execute(f"PRAGMA cache_size = -{_WRITER_CACHE_KIB}")
            connection.execute(f"PRAGMA journal_size_limit = {_LOG_BYTES}")
    except BaseException:
        connection.close()
        raise
    return connection


def _cannot_keep_a_log(path: Path) -> bool:
    """Whether the folder is read-only to us and holds no log: then SQLite cannot lock, and reads without.

    It takes the file for one that does not change. Should another user, who may write there, do so meanwhile, what is
    read is refused as damaged until the library is opened again.
    """
    return (
        not os.access(path.parent, os.W_OK, effective_ids=os.access in os.supports_effective_ids)
        and not path.with_name(path.name + "-wal").exists()
    )


def create(path: Path, meta: dict[str, str]) -> None:
    """Make an empty library: all of it or, if anything fails, nothing."""
    with in_plain_words(path, 0.0), suppress(FileExistsError):  # another process may make it at the same time
        path.parent.mkdir(parents=True, exist_ok=True)
        with placed(path) as beside, closing(open_connection(beside, isolation_level=None)) as connection:
            connection.execute(f"PRAGMA page_size = {PAGE_SIZE}")
            connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("BEGIN")
            for statement in CREATE:
                connection.execute(statement)
            insert(connection, "meta", [*meta.items(), ("schema", schema_seal(connection))])
            connection.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
            connection.execute("COMMIT")


def check_kind(connection: sqlite3.Connection, path: Path) -> int:
    """The schema version of a library; refuses another program's database and a later version."""
    if connection.execute("PRAGMA application_id").fetchone()[0] != APPLICATION_ID:
        raise DataError(f"expected {path} to be a library of kineme, got another program's database")
    version = int(connection.execute("PRAGMA user_version").fetchone()[0])
    if not 1 <= version <= SCHEMA_VERSION:
        raise DataError(
            f"expected {path} to have schema version {SCHEMA_VERSION} or earlier, got {version}; upgrade kineme"
        )
    return version


def migrate(connection: sqlite3.Connection, path: Path) -> None:
    """Bring an older library to today's schema, in one transaction."""
    with transaction(connection):
        for version in range(check_kind(connection, path), SCHEMA_VERSION):
            for statement in MIGRATIONS[version]:
                connection.execute(statement)
        connection.execute("DELETE FROM meta WHERE key = 'schema'")
        insert(connection, "meta", [("schema", schema_seal(connection))])
        connection.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")


def schema_seal(connection: sqlite3.Connection) -> str:
    """A checksum of the tables' definitions, without which the other checksums would mean nothing."""
    query = "SELECT type, name, tbl_name, sql FROM sqlite_master ORDER BY type, name"
    return str(zlib.crc32(repr(connection.execute(query).fetchall()).encode()))


@contextmanager
def transaction(connection: sqlite3.Connection) -> Iterator[None]:
    """All or nothing. Waits for its turn to write at the beginning, never in the middle."""
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield
        connection.execute("COMMIT")
    except BaseException:
        if connection.in_transaction:
            connection.execute("ROLLBACK")
        raise
