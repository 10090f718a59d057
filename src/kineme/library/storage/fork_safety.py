"""Connections to libraries over a fork: all are closed before it, and opened again on both sides when needed.

SQLite remembers in the memory of a process which locks the process holds on a file: those of the connections that are
open. A fork copies that memory but not the locks, which the system keeps for each process. A child that used a
connection of its parent, or opened one of its own while SQLite remembers the parent's, would believe in locks that it
does not have: it would read while others overwrite, write into a log that the parent deletes, or wait for ever for a
transaction of a thread that is not there. Nor may it close what it inherited: that rolls back a transaction that goes
on in the parent, in memory that both share. So the memory has to be empty at the fork. A closed connection leaves
none: the locks are given back, the log is written into the file, and both sides begin with nothing.

A fork waits until no thread reads or writes, and others wait until it is done; within a transaction a library does
nothing but that, so it is short. Should it take longer than `_PATIENCE`, or should the fork not be one that Python
prepares, then connections stay open in the parent, and the child refuses to use that library file.
"""

from __future__ import annotations

import ctypes
import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Condition, get_ident
from typing import Any, Protocol
from weakref import WeakSet

from kineme.errors import DataError
from kineme.library.storage.defense import Watched
from kineme.runtime import forks

_PATIENCE = 10.0  # seconds

_changed = Condition()
_busy: dict[int, int] = {}  # thread -> how many times over it reads or writes
_forking: int | None = None  # the thread
_lost: set[tuple[int, int]] = set()  # device and number of files that are open in the parent


class Sleeper(Protocol):
    """What holds connections between calls."""

    path: Path

    def sleep(self) -> None:
        """Close them, to be opened again when needed."""

    def carried_over(self) -> list[sqlite3.Connection]:
        """Called in a child: those that are open, none of which must be used or closed."""


_sleepers: WeakSet[Any] = WeakSet()


def register(sleeper: Sleeper) -> None:
    """Put its connections to sleep before every fork."""
    _sleepers.add(sleeper)


@contextmanager
def awake() -> Iterator[None]:
    """No fork while this lasts; a thread may enter it again."""
    me = get_ident()
    _enter(me)
    try:
        yield
    finally:
        _leave(me)


class Connection(Watched):
    """Keeps forks waiting until it is closed, or until who holds it lets it `rest`."""

    _thread: int | None = None

    def rest(self) -> Connection:
        """Do not keep forks waiting any more; the holder is registered, and will close it."""
        if self._thread is not None:
            _leave(self._thread)
            self._thread = None
        return self

    def close(self) -> None:
        """As SQLite's."""
        super().close()
        self.rest()


def open_connection(address: str | Path, **options: Any) -> Connection:
    """``sqlite3.connect``, for a connection that keeps forks waiting."""
    me = get_ident()
    _enter(me)
    try:
        connection: Connection = sqlite3.connect(address, factory=Connection, **options)
    except BaseException:
        _leave(me)
        raise
    connection._thread = me
    return connection


def is_lost(path: Path) -> bool:
    """Whether a library file was open in the parent at the fork, and could not be closed."""
    return bool(_lost) and path.exists() and _identity(path) in _lost


def refuse_if_lost(path: Path) -> None:
    """Refuse a library file that is lost to this process."""
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
    """Before a fork: nobody reads or writes, and no connection is open."""
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
    if _busy:  # what they had open cannot be told from what sleeps
        _lost.update(_identity(sleeper.path) for sleeper in list(_sleepers) if sleeper.path.exists())
    for thread in _busy.keys() - {get_ident()}:
        del _busy[thread]
    for sleeper in list(_sleepers):
        for connection in sleeper.carried_over():
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(connection))  # so that not even the end of Python closes it
            if sleeper.path.exists():
                _lost.add(_identity(sleeper.path))


def _identity(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_dev, status.st_ino


forks.at_fork(_all_asleep, _in_child, first=True)
