"""The folder of a library: its name, and new files in it, which are created atomically."""

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
from kineme.reporting.atomic import whole_file

FILE = "library.sqlite"
LOGS = ("-wal", "-journal")  # suffixes of the files beside a database from which SQLite may change it
_COMPANIONS = (*LOGS, "-shm")
_DAY = 86400.0  # seconds
_LEFT = re.compile(r"\..+\.[0-9a-f]{8}")


def as_folder(folder: Any) -> Path:
    """The folder of a library that exists or is to be created.

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
def new_database(path: Path) -> Iterator[Path]:
    """Context manager: a name beside `path` for a new database, which is renamed to `path`, if that does not exist.

    Raises
    ------
    FileExistsError
        A file of that name exists, or another process was faster; it is unchanged.
    """
    if not path.exists():
        _remove_old_leftovers(path.parent)
    with whole_file(path, replace=False, companions=_COMPANIONS) as beside:
        yield beside


def _remove_old_leftovers(folder: Path) -> None:
    """Delete the files of processes that were killed here more than a day ago.

    Unlike `kineme.reporting.atomic.remove_leftovers`, for libraries of any name: an export often has a name that is
    never used again.
    """
    for path in folder.glob(".*"):
        with suppress(OSError):  # another process was faster, or no permission
            if _LEFT.fullmatch(path.name) and time.time() - path.lstat().st_mtime > _DAY and _is_library(path):
                for end in ("", *_COMPANIONS):
                    path.with_name(path.name + end).unlink(missing_ok=True)


def _is_library(path: Path) -> bool:
    """Whether a file begins like a library."""
    if path.is_symlink() or not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(72)
    return head[:16] == b"SQLite format 3\0" and head[68:] == APPLICATION_ID.to_bytes(4, "big")
