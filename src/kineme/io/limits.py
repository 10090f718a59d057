"""The limit on the memory that one file may take once it is read, for all formats.

A small file can need more memory than there is: readers check before they allocate. The limit is the environment
variable ``KINEME_MAX_FILE_BYTES``; by default 4 GiB, or half of the memory if that is less.
"""

from __future__ import annotations

import os
from functools import cache
from typing import BinaryIO

from kineme.errors import DataError, SpecificationError

VARIABLE = "KINEME_MAX_FILE_BYTES"

_MOST = 4 * 2**30
_CHUNK = 2**20
_IN_PASSING = 2**26


def max_file_bytes() -> int:
    """Return the limit [bytes]."""
    given = os.environ.get(VARIABLE)
    if given is None:
        return _by_default()
    if not given.strip().isdecimal() or not int(given):
        raise SpecificationError(
            f"expected the environment variable {VARIABLE} to be a whole number of bytes above 0, got {given!r}; "
            "unset it for the default"
        )
    return int(given)


def most_in_passing() -> int:
    """Return the limit on what is in memory on the way only, such as a chunk of a bag [bytes]: at least 64 MiB."""
    return max(max_file_bytes(), _IN_PASSING)


def check_expanded(n_bytes: int, what: str = "a file", most: int | None = None) -> None:
    """Refuse a size in memory above the limit, or above `most`; the message says how to raise it."""
    most = max_file_bytes() if most is None else most
    if n_bytes > most:
        raise DataError(
            f"expected {what} that takes at most {most:,} bytes of memory, got one that takes {n_bytes:,}; "
            f"split it, or, if you trust it, set the environment variable {VARIABLE} to more"
        )


def check_in_passing(n_bytes: int, what: str) -> None:
    """Refuse what is in memory on the way only, and above the limit on that."""
    check_expanded(n_bytes, what, most_in_passing())


def read_limited(stream: BinaryIO) -> bytes:
    """Read all bytes of a stream of unknown length, up to the limit."""
    chunks: list[bytes] = []
    n_bytes = 0
    while chunk := stream.read(_CHUNK):
        chunks.append(chunk)
        n_bytes += len(chunk)
        check_expanded(n_bytes, "a stream")
    return b"".join(chunks)


@cache
def _by_default() -> int:
    try:
        memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):  # not every system has this
        return _MOST
    return min(_MOST, memory // 2) if memory > 0 else _MOST
