"""Writing files so that a reader sees the old one or the new one, never half of one."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def write_atomically(path: Path, data: bytes) -> Path:
    """Write `data` beside `path`, bring it to the disk, and rename it into place.

    Raises
    ------
    OSError
        The folder is missing, read-only or full; what was at `path` is as it was.
    """
    if not path.parent.is_dir():
        raise FileNotFoundError(f"expected a folder {path.parent} to write {path.name} into, there is none; create it")
    with replaced(path) as beside:
        beside.write_bytes(data)
    return path


@contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """A name beside `path` to write to; if all goes well, that file is brought to the disk and takes its place."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        yield beside
        with beside.open("rb+") as file:
            os.fsync(file.fileno())
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
