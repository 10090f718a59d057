"""Safe connections: limits on what a hostile file may do, and none that is open over a fork.

According to its authors, SQLite is safe with hostile files if it is set not to trust the definitions in them; see
"Defense Against The Dark Arts", sqlite.org/security.html. It could still cost time and disk: both have limits.

SQLite keeps in memory which locks its connections hold. A fork copies that memory but not the locks: a child that uses
a connection of its parent, or opens its own, assumes locks that it does not hold, reads while others overwrite, or
waits forever; and closing an inherited one would roll back a transaction of the parent. So a fork waits until no thread
reads or writes, all connections are closed, and both sides open them again when needed. If that takes longer than
`_PATIENCE`, or if Python does not prepare the fork, the child refuses to use that library file.
"""

from __future__ import annotations

import ctypes
import os
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from threading import Condition, get_ident
from typing import Any
from weakref import WeakSet

from kineme.errors import DataError
from kineme.library.storage.address import Address
from kineme.runtime import forks

_STEPS = 200_000  # of SQLite's virtual machine between two checks of the limits: some milliseconds
#: Limit of steps for one statement: a minimum, and a number per byte of the file. Reading takes up to three steps per
#: byte of a row, and a hundredth of that for stored features; pages that refer to each other in circles exceed it.
_WORK, _WORK_PER_BYTE = 10_000_000, 10
_SECONDS, _BYTES_PER_SECOND = 60.0, 4e6  # limit of time, with an amount per byte that slow disks keep

#: Settings that Python can change from 3.12 on, by name: features that a library does not need, and features that do
#: not matter for a database that is only read.
_OFF = ("SQLITE_DBCONFIG_ENABLE_TRIGGER", "SQLITE_DBCONFIG_ENABLE_VIEW", "SQLITE_DBCONFIG_TRUSTED_SCHEMA")
_ON = ("SQLITE_DBCONFIG_DEFENSIVE",)


def size_of(path: Path) -> int:
    """Return bytes of a database and of its log."""
    path = file_of(path)
    return sum(file.stat().st_size for file in (path, path.with_name(path.name + "-wal")) if file.exists())


def file_of(path: Path) -> Path:
    """Return the file that a path leads to: logs lie beside it, not beside a link; a link to itself is none."""
    return Path(os.path.realpath(path))


def defend(connection: sqlite3.Connection) -> None:
    """Disable everything that the definitions in a file could run."""
    connection.execute("PRAGMA cell_size_check = ON")
    connection.execute("PRAGMA trusted_schema = OFF")
    _switch(connection, _OFF, False)


def defend_foreign(connection: sqlite3.Connection, path: Path) -> None:
    """Defend against a file that has not been checked: read only, with no value larger than the file."""
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


_PATIENCE = 10.0  # seconds

_changed = Condition()
_busy: dict[int, int] = {}  # thread -> number of its nested uses of a library
_forking: int | None = None  # id of the thread that forks
_lost: set[object] = set()  # device and inode of files, and addresses, that are open in the parent
_sleepers: WeakSet[Any] = WeakSet()


def register(store: Any) -> None:
    """Register a store: before every fork it closes its connections by ``sleep``, until they are needed again.

    In a child its ``carried_over`` are the connections that are open, which must be neither used nor closed.
    """
    _sleepers.add(store)


@contextmanager
def awake() -> Iterator[None]:
    """Hold off forks within the context, which a thread may enter several times."""
    me = get_ident()
    _enter(me)
    try:
        yield
    finally:
        _leave(me)


class Connection(sqlite3.Connection):
    """A connection that interrupts statements that take more work than reading every byte of the file.

    For one thread at a time. It holds off forks until it is closed, or until its owner calls `allow_forks`.
    """

    _path: Path
    _thread: int | None = None

    def __init__(self, *database: Any, **options: Any) -> None:
        self._checks = 0  # checks during the current statement
        self._too_much: Callable[[], bool] = bool
        super().__init__(*database, **options)

    def watch(self, path: Path) -> None:
        """Start the limit, for the file of that path."""
        self._path = path
        self.set_progress_handler(self._is_endless, _STEPS)

    def execute(self, *statement: Any) -> sqlite3.Cursor:
        """Execute a statement within the limits."""
        self._checks = 0
        return super().execute(*statement)

    def _is_endless(self) -> bool:
        self._checks += 1
        more = _STEPS * self._checks - _WORK
        return self._too_much() or (more > 0 and more > _WORK_PER_BYTE * size_of(self._path))

    @contextmanager
    def stopping(self, too_much: Callable[[], bool]) -> Iterator[None]:
        """Interrupt, within the context, also once `too_much()` is true."""
        self._too_much = too_much
        try:
            yield
        finally:
            self._too_much = bool

    def allow_forks(self) -> Connection:
        """Hold off forks no more; the owner is registered, and closes the connection before a fork."""
        if self._thread is not None:
            _leave(self._thread)
            self._thread = None
        return self

    def close(self) -> None:
        """Close the connection, and hold off forks no more."""
        super().close()
        self.allow_forks()


def open_connection(address: str | Path, **options: Any) -> Connection:
    """Return ``sqlite3.connect``, for a connection that holds off forks."""
    me = get_ident()
    _enter(me)
    try:
        connection: Connection = sqlite3.connect(address, factory=Connection, **options)
    except BaseException:
        _leave(me)
        raise
    connection._thread = me
    return connection


def limited(connection: Connection, path: Path) -> AbstractContextManager[None]:
    """Interrupt, within the context, also once all statements together take too long for the size of the file."""
    end = time.monotonic() + _SECONDS + size_of(path) / _BYTES_PER_SECOND
    return connection.stopping(lambda: time.monotonic() > end)


def is_lost(path: Path | Address) -> bool:
    """Tell whether a library was open in the parent at the fork, and could not be closed."""
    return bool(_lost) and not _lost.isdisjoint(_identity(path))


def refuse_if_lost(path: Path | Address) -> None:
    """Refuse a library that was open in the parent at the fork."""
    if is_lost(path):
        raise DataError(
            f"expected a process that opens {path} itself, got one that was forked while the library was being read or "
            "written; start it with multiprocessing's 'spawn', or fork when no thread uses the library"
        )


def _enter(thread: int) -> None:
    with _changed:
        while _forking not in {None, thread} and thread not in _busy:
            _changed.wait()
        _busy[thread] = _busy.get(thread, 0) + 1


def _leave(thread: int) -> None:
    with _changed:
        _busy[thread] = _busy.get(thread, 0) - 1
        if _busy[thread] <= 0:
            del _busy[thread]
            _changed.notify_all()


@contextmanager
def _all_asleep() -> Iterator[None]:
    """Wait, before a fork, until no thread reads or writes, and close all connections."""
    global _forking  # noqa: PLW0603
    with _changed:
        _forking = get_ident()
        late = time.monotonic() + _PATIENCE
        while _busy.keys() - {_forking} and time.monotonic() < late:
            _changed.wait(late - time.monotonic())
        if not _busy:
            for sleeper in list(_sleepers):
                sleeper.sleep()
    try:
        yield
    finally:
        with _changed:
            _forking = None
            _changed.notify_all()


def _in_child() -> None:
    global _changed  # noqa: PLW0603
    _changed = Condition()
    if _busy:  # it is unknown which connections were open
        _lost.update(*(_identity(sleeper.path) for sleeper in list(_sleepers)))
    for thread in _busy.keys() - {get_ident()}:
        del _busy[thread]
    for sleeper in list(_sleepers):
        for connection in sleeper.carried_over():
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(connection))  # so that even the end of Python does not close it
            _lost.update(_identity(sleeper.path))


def _identity(path: Path | Address) -> set[object]:
    """Return a set of device and inode of a file, none where there is no file, or of an address on a server."""
    if isinstance(path, Path) and not path.exists():
        return set()
    return {path if isinstance(path, Address) else (path.stat().st_dev, path.stat().st_ino)}


forks.at_fork(_all_asleep, _in_child, first=True)
