"""Defense against hostile databases: what they must not do, and limits on time and size.

According to its authors, SQLite is safe with hostile files if it is set not to trust the definitions in them; see
"Defense Against The Dark Arts", sqlite.org/security.html.
"""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

_STEPS = 200_000  # of SQLite's virtual machine between two checks of the limits: some milliseconds
#: Limit of steps for one statement: a minimum, and a number per byte of the file. Reading takes up to three steps per
#: byte of a row, and a hundredth of that for stored features; pages that refer to each other in circles exceed it.
_WORK, _WORK_PER_BYTE = 10_000_000, 10
_ROOM = 1 << 24  # bytes that a copy may have beyond twice the size of the file
_SECONDS, _BYTES_PER_SECOND = 60.0, 4e6  # limit of time, with an amount per byte that slow disks keep

#: Settings that Python can change from 3.12 on, by name: features that a library does not need, and features that do
#: not matter for a database that is only read.
_OFF = ("SQLITE_DBCONFIG_ENABLE_TRIGGER", "SQLITE_DBCONFIG_ENABLE_VIEW", "SQLITE_DBCONFIG_TRUSTED_SCHEMA")
_ON = ("SQLITE_DBCONFIG_DEFENSIVE",)


def size_of(path: Path) -> int:
    """Bytes of a database and of its log."""
    return sum(one.stat().st_size for one in (path, path.with_name(path.name + "-wal")) if one.exists())


def defend(connection: sqlite3.Connection) -> None:
    """Disable everything that the definitions in a file could run."""
    connection.execute("PRAGMA cell_size_check = ON")
    connection.execute("PRAGMA trusted_schema = OFF")
    _switch(connection, _OFF, False)


def defend_foreign(connection: sqlite3.Connection, path: Path) -> None:
    """As `defend`, for a file that has not been checked: read only, with no value larger than the file."""
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


class Watched(sqlite3.Connection):
    """A connection that interrupts statements that take more work than reading every byte of the file.

    For one thread at a time.
    """

    _path: Path

    def __init__(self, *database: Any, **options: Any) -> None:
        self._checks = 0  # checks during the current statement
        self._too_much: Callable[[], bool] = bool
        super().__init__(*database, **options)

    def watch(self, path: Path) -> None:
        """Start the limit, for the file of that path."""
        self._path = path
        self.set_progress_handler(self._is_endless, _STEPS)

    def execute(self, *statement: Any) -> sqlite3.Cursor:
        """As `sqlite3.Connection.execute`."""
        self._checks = 0
        return super().execute(*statement)

    def _is_endless(self) -> bool:
        self._checks += 1
        more = _STEPS * self._checks - _WORK
        return self._too_much() or (more > 0 and more > _WORK_PER_BYTE * size_of(self._path))

    @contextmanager
    def stopping(self, too_much: Callable[[], bool]) -> Iterator[None]:
        """Within the context, interrupt also once `too_much()` is true."""
        self._too_much = too_much
        try:
            yield
        finally:
            self._too_much = bool


def limited(connection: Watched, path: Path) -> AbstractContextManager[None]:
    """Within the context, interrupt also once all statements together take too long for the size of the file."""
    end = time.monotonic() + _SECONDS + size_of(path) / _BYTES_PER_SECOND
    return connection.stopping(lambda: time.monotonic() > end)


def limited_copy(connection: Watched, path: Path, copy: Path) -> AbstractContextManager[None]:
    """Within the context, interrupt also once the copy is far larger than the file."""
    most = 2 * size_of(path) + _ROOM
    return connection.stopping(lambda: size_of(copy) > most)
