"""A new file that is there as a whole or not at all, and never in the place of another one."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from kineme.errors import SpecificationError
from kineme.library.storage.schema import APPLICATION_ID
from kineme.output.atomic import bring_to_disk, name_beside

LOGS = ("-wal", "-journal")  # ends of the names of the files beside a database from which SQLite changes it
_DAY = 86400.0  # seconds
_LEFT = re.compile(r"\..+\.[0-9a-f]{8}")
_COMPANIONS = ("", *LOGS, "-shm")


def as_folder(folder: Any) -> Path:
    """Where a library is, or is to be.

    Raises
    ------
    SpecificationError
        No path, or one without a name: an empty text would be the current folder.
    """
    name = os.fsdecode(folder) if isinstance(folder, str | os.PathLike) else ""
    if not name.strip() or "\0" in name:
        raise SpecificationError(f"expected the folder of a library, got {folder!r}; the current one is '.'")
    return Path(name)


@contextmanager
def placed(target: Path) -> Iterator[Path]:
    """A path beside `target` to write to; if all goes well the file is brought to the disk and gets its name.

    Raises
    ------
    FileExistsError
        There is a file of that name, or another process was faster; it stays as it is.
    """
    if target.exists():
        raise FileExistsError(target)
    _sweep(target.parent)
    beside = name_beside(target)
    try:
        yield beside
        bring_to_disk(beside)
        _name(beside, target)
        _sync_folder(target.parent)
    finally:
        for end in _COMPANIONS:
            beside.with_name(beside.name + end).unlink(missing_ok=True)


def _sweep(folder: Path) -> None:
    """Delete what processes left that were killed here more than a day ago; nobody would ever read it.

    Unlike `remove_leftovers`, for libraries of any name: an export often has a name that is never used again.
    """
    for path in folder.glob(".*"):
        with suppress(OSError):  # another process was faster, or it is not ours to delete
            if _LEFT.fullmatch(path.name) and time.time() - path.lstat().st_mtime > _DAY and _is_ours(path):
                for end in _COMPANIONS:
                    path.with_name(path.name + end).unlink(missing_ok=True)


def _is_ours(path: Path) -> bool:
    """Whether this begins as a library does."""
    if path.is_symlink() or not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(72)
    return head[:16] == b"SQLite format 3\0" and head[68:] == APPLICATION_ID.to_bytes(4, "big")


def _name(beside: Path, target: Path) -> None:
    try:
        os.link(beside, target)  # unlike a rename, it refuses to replace
    except FileExistsError:
        raise
    except OSError:  # a file system without links
        if target.exists():
            raise FileExistsError(target) from None
        beside.rename(target)


def _sync_folder(folder: Path) -> None:
    """Bring the new name to the disk, where folders can be opened."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
