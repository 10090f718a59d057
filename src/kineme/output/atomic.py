"""Writing files so that a reader sees the old one or the new one, never half of one."""

from __future__ import annotations

import os
import re
import secrets
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_IDLE = 3600.0  # seconds since the last write after which the file of a process that no longer runs is a leftover


def write_atomically(path: Path, data: bytes) -> Path:
    """Write `data` to a hidden file beside `path`, flush it to the disk, and rename it to `path`.

    Raises
    ------
    OSError
        The folder is missing, read-only or full; an existing file at `path` is unchanged.
    """
    if not path.name or path.is_dir():  # an empty text is the current folder
        raise IsADirectoryError(f"expected the name of a file to write, got the folder {str(path)!r}; add a name")
    if not path.parent.is_dir():
        raise FileNotFoundError(f"expected a folder {path.parent} to write {path.name} into, there is none; create it")
    with replaced(path) as beside:
        beside.write_bytes(data)
    return path


@contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """Context manager: a hidden name beside `path` to write to; on success that file is flushed and renamed to `path`.

    Leftovers of killed processes are removed.
    """
    remove_leftovers(path)
    beside = name_beside(path)
    try:
        yield beside
        bring_to_disk(beside)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def bring_to_disk(path: Path) -> None:
    """Return once the bytes of a file are on the disk, where a power cut leaves them."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def name_beside(path: Path) -> Path:
    """A unique hidden name beside `path`; it contains the process id, which `remove_leftovers` reads."""
    return path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}")


def remove_leftovers(path: Path) -> None:
    """Remove files of `name_beside` that killed processes left beside `path`, with SQLite's files beside them.

    A file is removed if it belongs to this user, its process does not run, and nobody wrote to it for an hour: in a
    folder that several machines share, the process may run on another one. Files that cannot be removed stay.
    """
    pattern = re.compile(rf"\.{re.escape(path.name)}\.(\d+)(?:\.[0-9a-f]{{8}})?(?:-wal|-shm|-journal)?")
    with suppress(OSError):
        for entry in os.scandir(path.parent):
            if (found := pattern.fullmatch(entry.name)) and not _is_at_work(int(found[1])):
                with suppress(OSError):
                    _remove_if_idle(Path(entry.path))


def _remove_if_idle(path: Path) -> None:
    known = path.lstat()
    own = not hasattr(os, "getuid") or known.st_uid == os.getuid()
    if own and stat.S_ISREG(known.st_mode) and time.time() - known.st_mtime > _IDLE:
        path.unlink()


def _is_at_work(process: int) -> bool:
    """Whether a process of that id runs on this machine; True where that cannot be found out."""
    if os.name != "posix":  # on Windows, signal 0 would end the process
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # another user's process, or a number too large for a process id
        return True
    return True
