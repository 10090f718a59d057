"""A topic that is added to a copy of a bag: texts, stamped with times of recording."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from typing import Any, BinaryIO, NamedTuple

from kineme.errors import DataError
from kineme.files.ros.bags import Bag
from kineme.files.ros.decode import standard_types

TEXT = "std_msgs/msg/String"  # every version of ROS knows it
_AT_ONCE = 2**20  # bytes that are copied at a time


class AddedTopic(NamedTuple):
    """Messages of the type std_msgs/String.

    Attributes
    ----------
    name : str
    definition, digest : str
        Of the type: its text, and its checksum in this version of ROS.
    messages : tuple of (int, bytes)
        Time of recording [ns] and bytes of each, in the order of time.
    """

    name: str
    definition: str
    digest: str
    messages: tuple[tuple[int, bytes], ...]


def added_topic(bag: Bag, name: str, texts: Sequence[tuple[int, str]]) -> AddedTopic:
    """Texts with their times of recording [ns] as messages of that bag's version of ROS.

    Raises
    ------
    DataError
        The bag has a topic of that name.
    """
    if any(topic.name == name for topic in bag.topics):
        raise DataError(f"expected a bag without the topic {name}, got one that has it; annotate the recording itself")
    store: Any = standard_types(bag.version)
    cls = store.types[TEXT]
    serialize = store.serialize_ros1 if bag.version == 1 else store.serialize_cdr
    messages = tuple((stamp, bytes(serialize(cls(data=text), TEXT))) for stamp, text in sorted(texts))
    if bag.version == 1:
        definition, digest = store.generate_msgdef(TEXT)
    else:
        definition, digest = store.generate_msgdef(TEXT, ros_version=2)[0], store.hash_rihs01(TEXT)
    return AddedTopic(name, str(definition), str(digest), messages)


def copy_bytes(old: BinaryIO, new: BinaryIO, start: int, end: int) -> int:
    """Copy the bytes from `start` to `end`, some at a time; their CRC-32.

    Raises
    ------
    DataError
        The file ends before.
    """
    old.seek(start)
    remaining, checksum = end - start, 0
    while remaining > 0:
        some = old.read(min(remaining, _AT_ONCE))
        if not some:
            raise DataError(f"expected {end:,} bytes, got {end - remaining:,}: the file was cut off while it was read")
        new.write(some)
        checksum = zlib.crc32(some, checksum)
        remaining -= len(some)
    return checksum
