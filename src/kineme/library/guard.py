"""What a database from elsewhere may not do, and how long reading it may take.

SQLite survives hostile files, as its authors say, if it is told to trust none of what they define; see "Defense
Against The Dark Arts", sqlite.org/security.html.
"""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_STEPS = 200_000  # of SQLite's virtual machine, between two looks at the clock: some milliseconds
_SECONDS, _BYTES_PER_SECOND = 60.0, 4e6  # a file may take this long, and longer by its size: a slow disk is faster

#: Switches that Python can set from 3.12 on, by name: what a library needs none of, and what makes no difference to one
#: that is only read.
_OFF = ("SQLITE_DBCONFIG_ENABLE_TRIGGER", "SQLITE_DBCONFIG_ENABLE_VIEW", "SQLITE_DBCONFIG_TRUSTED_SCHEMA")
_ON = ("SQLITE_DBCONFIG_DEFENSIVE",)


def size_of(path: Path) -> int:
    """Bytes of a database and of its log."""
    return sum(one.stat().st_size for one in (path, path.with_name(path.name + "-wal")) if one.exists())


def defend(connection: sqlite3.Connection) -> None:
    """Let nothing that a file defines act by itself."""
    connection.execute("PRAGMA cell_size_check = ON")
    connection.execute("PRAGMA trusted_schema = OFF")
    _switch(connection, _OFF, False)


def defend_foreign(connection: sqlite3.Connection, path: Path) -> None:
    """As `defend`, for a file that nobody has looked at yet: it is only read, and holds nothing larger than itself."""
    defend(connection)
    connection.execute("PRAGMA query_only = ON")
    connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, max(1 << 20, min(path.stat().st_size, (1 << 31) - 1)))
    connection.setlimit(sqlite3.SQLITE_LIMIT_ATTACHED, 0)
    connection.setlimit(sqlite3.SQLITE_LIMIT_TRIGGER_DEPTH, 0)
    _switch(connection, _ON, True)


def _switch(connection: sqlite3.Connection, names: tuple[str, ...], on: bool) -> None:
    if setconfig := getattr(connection, "setconfig", None):
        for name in names:
            setconfig(getattr(sqlite3, name), on)


@contextmanager
def limited(connection: sqlite3.Connection, path: Path) -> Iterator[None]:
    """Interrupt what takes longer than reading every byte of the file could: pages that lead in circles never end."""
    end = time.monotonic() + _SECONDS + size_of(path) / _BYTES_PER_SECOND
    connection.set_progress_handler(lambda: time.monotonic() > end, _STEPS)
    try:
        yield
    finally:
        connection.set_progress_handler(None, 0)
