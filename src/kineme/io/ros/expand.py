"""Expand compressed bytes up to a limit: what they say of their size may be wrong, and a few may become gigabytes."""

from __future__ import annotations

from bz2 import BZ2Decompressor
from collections.abc import Callable
from typing import Any

from kineme.errors import DataError
from kineme.io.limits import check_in_passing, most_in_passing


def expand(compression: str, data: bytes, size: int, what: str = "a chunk") -> bytes:
    """Expand all frames in some bytes.

    Parameters
    ----------
    compression : {"zstd", "lz4", "bz2"}
    data : bytes
    size : int
        How many bytes they should become; it is checked against the limit on files first.
    what : str
        They are, for messages.

    Raises
    ------
    DataError
        They become more, or more than a file may take, or are cut off.
    """
    check_in_passing(size, what)
    parts, n_bytes = [], 0
    while True:
        one = _decompressor(compression)()
        parts.append(one.decompress(data, max_length=size + 1 - n_bytes))
        n_bytes += len(parts[-1])
        if n_bytes > size:
            raise DataError(f"expected {what} that expands to {size:,} bytes, got one that expands to more")
        if not one.eof:
            raise DataError(f"expected {what} in {compression}, got one that is cut off")
        data = one.unused_data
        if not data:
            return b"".join(parts)


def expand_message(data: bytes) -> bytes:
    """Expand a message of a bag whose messages are compressed each for itself, by zstd; its size is said nowhere."""
    from rosbags.rosbag2.storage_mcap import zstd

    check_in_passing(zstd.get_frame_info(data).decompressed_size or 0, "a message")
    return expand("zstd", data, most_in_passing(), "a message")


def _decompressor(compression: str) -> Callable[[], Any]:
    if compression == "bz2":
        return BZ2Decompressor
    if compression == "lz4":
        from lz4.frame import LZ4FrameDecompressor

        return LZ4FrameDecompressor
    from rosbags.rosbag2.storage_mcap import zstd

    return zstd.ZstdDecompressor
