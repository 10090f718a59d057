"""What a database from elsewhere may not do, and how long reading it may take.

SQLite survives hostile files, as its authors say, if it is told to trust none of what they define; see "Defense
Against The Dark Arts", sqlite.org/security.html.
"""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

_STEPS = 200_000  # of SQLite's virtual machine, between two looks at the clock: some milliseconds
#: What one statement may take, in such steps: at least, and for each byte of the file. Reading takes up to three for
#: each byte of a row, a hundredth of that where features are stored; endless pages hold more rows than bytes.
_WORK, _WORK_PER_BYTE = 10_000_000, 10
_ROOM = 1 << 24  # bytes that a copy may have more than twice those of the file
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


class Watched(sqlite3.Connection):
    """Interrupts a statement that takes more work than reading every byte of the file could.

    One thread uses it at a time.
    """

    _path: Path

    def __init__(self, *database: Any, **options: Any) -> None:
        self._looks = 0  # at the statement under way
        self._too_much: Callable[[], bool] = bool
        super().__init__(*database, **options)

    def watch(self, path: Path) -> None:
        """Begin to do so, for the file of that path."""
        self._path = path
        self.set_progress_handler(self._is_endless, _STEPS)

    def execute(self, *statement: Any) -> sqlite3.Cursor:
        """As SQLite's."""
        self._looks = 0
        return super().execute(*statement)

    def _is_endless(self) -> bool:
        self._looks += 1
        more = _STEPS * self._looks - _WORK
        return self._too_much() or (more > 0 and more > _WORK_PER_BYTE * size_of(self._path))

    @contextmanager
    def stopping(self, too_much: Callable[[], bool]) -> Iterator[None]:
        """Interrupt also once `too_much()` is true."""
        self._too_much = too_much
        try:
            yield
        finally:
            self._too_much = bool


def limited(connection: Watched, path: Path) -> AbstractContextManager[None]:
    """Interrupt also what all together takes longer than reading every byte of the file could."""
    end = time.monotonic() + _SECONDS + size_of(path) / _BYTES_PER_SECOND
    return connection.stopping(lambda: time.monotonic() > end)


def limited_copy(connection: Watched, path: Path, copy: Path) -> AbstractContextManager[None]:
    """Interrupt also what makes a copy far larger than the file."""
    most = 2 * size_of(path) + _ROOM
    return connection.stopping(lambda: size_of(copy) > most)
