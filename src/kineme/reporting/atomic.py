"""Writing files so that a reader sees the old one or the new one, never half of one."""

from __future__ import annotations

import errno
import os
import re
import secrets
import shutil
import stat
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

FULL = (errno.ENOSPC, errno.EDQUOT)  # the disk, or what a user may take of it
_LONGEST_NAME = 228  # bytes: the hidden name beside it is longer, and file systems take 255
OF_SQLITE = ("-wal", "-shm", "-journal")  # ends of the names of files that it makes beside a database
_IDLE, _DAY = 3600.0, 86400.0  # seconds since the last write, see `remove_leftovers`


def write_atomically(path: Path, data: bytes) -> Path:
    """Write `data` to a hidden file beside `path`, flush it to the disk, and rename it to `path`; see `whole_file`."""
    with whole_file(path) as beside:
        beside.write_bytes(data)
    return path


@contextmanager
def whole_file(
    path: Path, *, replace: bool = True, companions: Sequence[str] = (), sweep: bool = True
) -> Iterator[Path]:
    """Context manager: a hidden name beside `path` to write to; on success that file is flushed and named `path`.

    Leftovers of killed processes are removed, and so are the `companions`: ends of the names of other files that may be
    made beside the new one, as "-wal" by SQLite; without `sweep` the folder, which may be large, is not searched for
    them. Without `replace` a file of that name, even one that another process
    made meanwhile, stays as it is.
    """
    if len(os.fsencode(path.name)) > _LONGEST_NAME:
        raise OSError(
            f"expected a name of at most {_LONGEST_NAME} bytes to write, got {path.name[:20]}..., which is longer; "
            "choose a shorter one"
        )
    if not replace and path.exists():
        raise FileExistsError(f"expected a new file to write, {path} is there; choose another name")
    if not path.name or path.is_dir():  # an empty text is the current folder
        raise IsADirectoryError(f"expected the name of a file to write, got the folder {str(path)!r}; add a name")
    if not path.parent.is_dir():
        there = "a file of that name is there" if path.parent.exists() else "there is none"
        raise FileNotFoundError(f"expected a folder {path.parent} to write {path.name} into, {there}; create it")
    if sweep:
        remove_leftovers(path.parent, re.escape(path.name))
    beside = name_beside(path)
    try:
        with _named(path, beside):
            yield beside
            bring_to_disk(beside)
            if replace:
                beside.replace(path)
            else:
                _name_new(beside, path)
                _bring_folder_to_disk(path.parent)
    finally:
        for end in ("", *companions):
            beside.with_name(beside.name + end).unlink(missing_ok=True)


def _name_new(beside: Path, path: Path) -> None:
    try:
        os.link(beside, path)  # unlike a rename, it refuses to replace
    except FileExistsError:
        raise
    except OSError:  # a file system without links
        if path.exists():
            raise FileExistsError(f"expected a new file to write, {path} is there; choose another name") from None
        beside.rename(path)


def _bring_folder_to_disk(folder: Path) -> None:
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def bring_to_disk(path: Path) -> None:
    """Return once the bytes of a file are on the disk, where a power cut leaves them."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def name_beside(path: Path) -> Path:
    """A unique hidden name beside `path`; it contains the process id, which `remove_leftovers` reads."""
    return path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}")


def remove_leftovers(folder: Path, name: str, is_ours: Callable[[Path], bool] | None = None) -> None:
    """Remove files of `name_beside` that killed processes left in a folder, with SQLite's files beside them.

    `name` is a pattern of what they were to be named. A file is removed if it belongs to this user and nobody wrote to
    it for an hour, as in a folder that several machines share its process may run on another one; for a day if one of
    that number runs here, or where that cannot be found out. Where the pattern fits files of other programs, too,
    `is_ours` tells them apart, and SQLite's go with those that they are beside.
    """
    pattern = re.compile(rf"(\.(?:{name})\.(\d+)(?:\.[0-9a-f]{{8}})?)({'|'.join(OF_SQLITE)})?")
    with suppress(OSError):
        for entry in os.scandir(folder):
            if match := pattern.fullmatch(entry.name):
                with suppress(OSError):
                    status = entry.stat(follow_symlinks=False)
                    own = not hasattr(os, "getuid") or status.st_uid == os.getuid()
                    least = _DAY if _is_at_work(int(match[2])) else _IDLE
                    if not (own and stat.S_ISREG(status.st_mode) and time.time() - status.st_mtime > least):
                        continue
                    if is_ours is None or (not match[3] and is_ours(Path(entry.path))):
                        for end in ("", *OF_SQLITE):
                            Path(entry.path + end).unlink(missing_ok=True)


def _is_at_work(process: int) -> bool:
    """Tell whether a process of that id runs on this machine; True where that cannot be found out."""
    if os.name != "posix":  # on Windows, signal 0 would end the process
        return True
    try:
        os.kill(process, 0)
    except (OSError, OverflowError) as error:  # else another user's process, or a number too large for an id
        return not isinstance(error, ProcessLookupError)
    return True


@contextmanager
def _named(path: Path, beside: Path) -> Iterator[None]:
    """Context manager: a full disk, and a folder that takes no file, are errors that say what could not be written."""
    try:
        yield
    except OSError as error:
        if error.errno in FULL:
            said = "expected room to write, got a full disk; free some space and run it again"
            raise OSError(error.errno, said, str(path)) from error
        if not str(error.filename).startswith(str(beside)):
            raise
        refused = error.errno in {errno.EACCES, errno.EPERM, errno.EROFS}
        raise type(error)(
            f"expected to write {path}, the system refuses: {(error.strerror or 'no reason given').lower()}; "
            + (f"allow writing in {path.parent}, or choose another folder" if refused else "choose another folder")
        ) from error


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Context manager: a new hidden folder beside `path` to write into; on success it is named `path`."""
    empty = path.is_dir() and not any(path.iterdir())
    if path.exists() and not empty:
        raise FileExistsError(f"expected a new folder to write, {path} is there")
    beside = name_beside(path)
    try:
        with _named(path, beside):
            beside.mkdir()
            yield beside
        try:
            if empty:
                path.rmdir()
            beside.rename(path)
        except OSError as error:
            if not path.exists():
                raise
            raise FileExistsError(f"expected a new folder to write, another program wrote {path} meanwhile") from error
    finally:
        if beside.exists():
            shutil.rmtree(beside)
