"""Let rosbags expand the chunks of a bag up to the size that they declare, and no more than a file may take.

Rosbags itself expands a chunk whole before it looks at its size, if it does.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial
from typing import Any

from kineme.io.limits import check_in_passing
from kineme.io.ros.expand import expand


def bound_chunks_of_ros_1(reader: Any) -> None:
    """Bound every chunk of an open bag of ROS 1.

    Raises
    ------
    DataError
        A chunk is larger than a file may be.
    """
    for at, chunk in reader.chunks.items():
        check_in_passing(chunk.datasize, f"a chunk at byte {at:,}")
        reader.chunks[at] = chunk._replace(decompressor=partial(_expand_of_ros_1, reader.bio, at))


def compression_of_ros_1(file: Any, at: int) -> tuple[str, int]:
    """How the chunk at a byte of a bag of ROS 1 is compressed, and the size [bytes] that it expands to."""
    from rosbags.rosbag1.reader import Header, RecordType

    file.seek(at)
    header = Header.read(file, RecordType.CHUNK)
    return header.get_string("compression"), header.get_uint32("size")


def _expand_of_ros_1(file: Any, at: int, data: bytes) -> bytes:
    compression, size = compression_of_ros_1(file, at)
    return data if compression == "none" else expand(compression, data, size, f"a chunk at byte {at:,}")


@cache
def bound_chunks_of_mcap() -> None:
    """Bound the chunks of every MCAP file from now on: it is a table of rosbags that says how they are expanded.

    Each entry takes the bytes and the size that they must have; rosbags refuses another size later.
    """
    from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

    DECOMPRESSORS.update({name: partial(expand, name) for name in ("lz4", "zstd")})


def check_overlaps(storage: Any, topics: Sequence[str]) -> None:
    """Refuse an MCAP file of which too much must be in memory at once: chunks whose times overlap are read together.

    Raises
    ------
    DataError
        All chunks of a time with messages of these topics take more than a file may.
    """
    ids = [one.id for one in storage.connections if one.topic in topics]
    chunks = [one for one in getattr(storage, "chunks", ()) if any(one.channel_count.get(k, 0) for k in ids)]
    begins = [(one.message_start_time, 0, max(one.uncompressed_size, one.compressed_size)) for one in chunks]
    ends = [(one.message_end_time, 1, -max(one.uncompressed_size, one.compressed_size)) for one in chunks]
    n_bytes = 0
    for _, _, change in sorted(begins + ends):
        n_bytes += change
        check_in_passing(n_bytes, "a set of chunks of one time")
