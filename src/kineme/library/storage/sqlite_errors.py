"""Errors of SQLite as `DataError`: what was expected, what came, what to do next."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from kineme.errors import DataError, KinemeError

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


class BusyError(DataError):
    """Another process writes; the same may be tried again later."""


@contextmanager
def in_plain_words(path: Path, wait: float) -> Iterator[None]:
    """Convert errors of the database to `DataError`; programming errors stay as they are."""
    try:
        yield
    except KinemeError:
        raise
    except FileExistsError:  # handled by the caller
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
