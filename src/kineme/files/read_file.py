"""Read one file: its bytes are read once, hashed, and parsed into checked movements; failures become problems."""

from __future__ import annotations

import hashlib
import os
import stat
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kineme.errors import DataError, KinemeError
from kineme.files.check_block import check_block
from kineme.files.folders import as_text
from kineme.files.formats import FORMATS, Format
from kineme.files.limits import check_expanded
from kineme.files.problem import Problem
from kineme.movements.tables.layout import Layout
from kineme.movements.tables.parsed import Block, Detected

#: Exceptions of readers on invalid files; RecursionError is too deep nesting.
_UNREADABLE = (
    KinemeError,
    ValueError,
    KeyError,
    TypeError,
    EOFError,
    OSError,
    ArithmeticError,
    RecursionError,
    MemoryError,
)

_NOWHERE = "expected a file, got a link that leads nowhere; delete it, or restore what it leads to"


class FileRead(NamedTuple):
    """The result for one file: movements and how they were read, or neither; and its problems."""

    path: str  # relative to the folder that is read
    sha256: str
    size: int
    mtime: float
    detected: Detected | None
    block: Block | None
    problems: list[Problem]


def read_file(path: Path, relative: Path, layout: Layout) -> FileRead:
    """Read a file; it need not exist any more.

    Parameters
    ----------
    path : Path
    relative : Path
        Path in the result. Its innermost folder is the label of movements without one in the file, unless the format
        takes the name of the file itself.
    layout : Layout
    """
    name = as_text(relative)
    try:
        format_of(relative)
        known = os.stat(path)
        if not stat.S_ISREG(known.st_mode):  # reading a pipe would wait forever
            raise DataError("expected a file, got a pipe or a device")
        check_expanded(known.st_size)
        data = path.read_bytes()
    except (OSError, MemoryError) as error:
        reason = _NOWHERE if path.is_symlink() and not os.path.exists(path) else _plainly(error)
        return FileRead(name, "", 0, 0.0, None, None, [Problem(name, None, reason)])
    return read_bytes(data, relative, layout, known.st_mtime)


def read_bytes(data: bytes, relative: Path, layout: Layout, mtime: float = 0.0) -> FileRead:
    """Read the content of a file of that name."""
    name = as_text(relative)
    sha256 = hashlib.sha256(data).hexdigest()
    form = format_of(relative)
    try:
        check_expanded(len(data))
        with np.errstate(over="ignore", invalid="ignore"):  # overflow gives infinity, which is reported later
            detected, block = form.read(data, layout)
            block, problems = check_block(block, name, layout.skip)
    except _UNREADABLE as error:
        return FileRead(name, sha256, len(data), mtime, None, None, [Problem(name, None, _plainly(error))])
    label = as_text(relative.stem) if form.label_is_stem else as_text(relative.parent.name) or None
    labels = [label if one is None else _storable(one) for one in block.labels]
    block = Block(block.positions, block.times, block.offsets, labels, block.places)  # releases the bytes of the file
    return FileRead(name, sha256, len(data), mtime, detected, block, problems)


def format_of(path: Path) -> Format:
    """The row of `FORMATS` for a file's extension.

    Raises
    ------
    DataError
        No format has that extension; the message lists those that exist.
    """
    form = FORMATS.get(path.suffix.lower())
    if form is None:
        raise DataError(f"expected a file ending in one of {', '.join(FORMATS)}, got {path.suffix or 'no ending'!r}")
    return form


def _storable(label: str) -> str:
    """A label without lone surrogates, which JSON can hold but which cannot be encoded as UTF-8."""
    return label.encode("utf-8", "backslashreplace").decode("utf-8")


def _plainly(error: BaseException) -> str:
    """The message of an exception on one line."""
    return " ".join(_reason(error).splitlines())


def _reason(error: BaseException) -> str:
    if isinstance(error, KinemeError):
        return str(error)
    if isinstance(error, MemoryError):
        return "expected a file that fits into the memory; split it"
    if isinstance(error, OSError):
        return f"expected a file that can be read, got: {error.strerror or error}"
    if isinstance(error, RecursionError):
        return "expected times and positions, got lists within lists within lists, too many to be arrays"
    reason = f"no entry {error}" if isinstance(error, KeyError) else str(error) or type(error).__name__
    return f"expected times and positions, got {reason}"
