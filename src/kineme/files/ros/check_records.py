"""Look at the bytes of a file of a bag before rosbags does, which believes what they say."""

from __future__ import annotations

import os
import struct
from pathlib import Path
from typing import BinaryIO

from kineme.errors import DataError
from kineme.files.limits import check_in_passing
from kineme.files.ros.damage import REMEDIES

#: File ending -> the first bytes of every such file. What begins otherwise is not given to rosbags.
_MAGIC = {".bag": b"#ROSBAG V2.0\n", ".mcap": b"\x89MCAP0\r\n", ".db3": b"SQLite format 3\0"}

_HEAD = struct.Struct("<BQ")  # kind and length of a record of MCAP
_HEADER, _CHUNK, _ATTACHMENT = 1, 6, 9  # kinds
_LONGEST = 64  # bytes of a profile
_SIZE_AT = 16  # where a chunk says to how many bytes it expands


def check_records(path: Path) -> bytes:
    """Refuse a file that is none of ROS by its first bytes, and an MCAP file whose records are none or too large.

    Returns the profile of an MCAP file, ``b"ros2"`` of one of ROS 2; nothing of other files.

    Records are passed over by their lengths. Other damage is left to rosbags, which may find its way by the index.

    Raises
    ------
    DataError
        The message names what may help.
    """
    magic = _MAGIC[path.suffix.lower()]
    with path.open("rb") as file:
        first = file.read(len(magic))
        if first != magic:
            raise DataError(
                f"expected a {path.suffix.lower()} file of ROS, which begins with {magic!r}, got "
                f"{'an empty file' if not first else repr(first)}"
            )
        return _check_mcap(file, len(magic)) if path.suffix.lower() == ".mcap" else b""


def _check_mcap(file: BinaryIO, at: int) -> bytes:
    """Rosbags takes each nine zeros for a record, of which there may be billions, and reads records whole."""
    magic, profile = _MAGIC[".mcap"], b"ros2"  # what has no header is left to rosbags
    end = file.seek(0, os.SEEK_END)
    file.seek(max(end - len(magic), 0))
    if file.read() != magic:
        raise DataError(f"expected an MCAP file that was closed, got one that ends before; {REMEDIES['.mcap']}")
    while at + _HEAD.size <= end - len(magic):
        file.seek(at)
        kind, length = _HEAD.unpack(file.read(_HEAD.size))
        if not kind:
            raise DataError(f"expected a record of MCAP at byte {at:,}, got zeros; {REMEDIES['.mcap']}")
        if kind != _ATTACHMENT and at + length < end:
            check_in_passing(length, f"a record of MCAP at byte {at:,}")
        if kind == _HEADER and len(size := file.read(4)) == 4:
            profile = file.read(min(int.from_bytes(size, "little"), _LONGEST))
        if kind == _CHUNK and len(size := file.read(_SIZE_AT + 8)) == _SIZE_AT + 8:
            check_in_passing(int.from_bytes(size[_SIZE_AT:], "little"), f"a chunk of MCAP at byte {at:,}")
        at += _HEAD.size + length
    return profile
