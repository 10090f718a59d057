"""Copy a bag of ROS 1 with one topic more: the bytes of all chunks stay, another chunk and a new index follow them."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

from kineme.errors import DataError
from kineme.files.ros.added_topic import AddedTopic, copy_bytes

_AFTER_MAGIC = 13  # of "#ROSBAG V2.0\n"
_MESSAGE, _BAG, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = 2, 3, 4, 5, 6, 7  # op of a record
_TYPE = "std_msgs/String"

Fields = dict[str, bytes]


def copy_bag(source: Path, target: Path, added: AddedTopic) -> None:
    """Write a copy of a bag with a topic more.

    Raises
    ------
    DataError
        The index of the bag is damaged.
    """
    with source.open("rb") as old, target.open("wb") as new:
        old.seek(_AFTER_MAGIC)
        header, _ = _read(old, _BAG)
        index = _number(header, "index_pos")
        connections, chunks = (_number(header, name) for name in ("conn_count", "chunk_count"))
        old.seek(index)
        known = [_number(_read(old, _CONNECTION)[0], "conn") for _ in range(connections)]
        infos = old.tell()
        for _ in range(chunks):
            _read(old, _CHUNK_INFO)
        end = old.tell()
        number = max(known, default=-1) + 1
        copy_bytes(old, new, 0, index)
        connection = _connection(number, added)
        new.write(_chunk(number, connection, added))
        new_index = new.tell()
        copy_bytes(old, new, index, infos)
        new.write(connection)
        copy_bytes(old, new, infos, end)
        new.write(_chunk_info(index, number, added))
        counts = {"index_pos": struct.pack("<Q", new_index)}
        counts |= {"conn_count": struct.pack("<L", connections + 1), "chunk_count": struct.pack("<L", chunks + 1)}
        new.seek(_AFTER_MAGIC)
        new.write(_fields(header | counts))  # as long as before


def _connection(number: int, added: AddedTopic) -> bytes:
    about = {"topic": added.name, "type": _TYPE, "md5sum": added.digest, "message_definition": added.definition}
    data = _fields({name: text.encode() for name, text in about.items()})[4:]
    return _record(_CONNECTION, {"conn": struct.pack("<L", number), "topic": added.name.encode()}, data)


def _chunk(number: int, connection: bytes, added: AddedTopic) -> bytes:
    """A chunk with the connection and its messages, and the index of those."""
    data, index = bytearray(connection), bytearray()
    for stamp, raw in added.messages:
        index += _time(stamp) + struct.pack("<L", len(data))
        data += _record(_MESSAGE, {"conn": struct.pack("<L", number), "time": _time(stamp)}, raw)
    fields = {"compression": b"none", "size": struct.pack("<L", len(data))}
    counts = {"ver": 1, "conn": number, "count": len(added.messages)}
    about = {name: struct.pack("<L", value) for name, value in counts.items()}
    return _record(_CHUNK, fields, bytes(data)) + _record(_INDEX, about, bytes(index))


def _chunk_info(at: int, number: int, added: AddedTopic) -> bytes:
    first, last = added.messages[0][0], added.messages[-1][0]
    fields = {"ver": struct.pack("<L", 1), "chunk_pos": struct.pack("<Q", at), "start_time": _time(first)}
    fields |= {"end_time": _time(last), "count": struct.pack("<L", 1)}
    return _record(_CHUNK_INFO, fields, struct.pack("<LL", number, len(added.messages)))


def _time(stamp: int) -> bytes:
    return struct.pack("<LL", *divmod(stamp, 10**9))


def _record(op: int, fields: Mapping[str, bytes], data: bytes) -> bytes:
    return _fields({"op": bytes([op]), **fields}) + struct.pack("<L", len(data)) + data


def _fields(fields: Mapping[str, bytes]) -> bytes:
    """The header of a record, with its length."""
    parts = [name.encode() + b"=" + value for name, value in fields.items()]
    header = b"".join(struct.pack("<L", len(part)) + part for part in parts)
    return struct.pack("<L", len(header)) + header


def _read(file: BinaryIO, op: int) -> tuple[Fields, bytes]:
    """Fields and data of the next record, which must be of that kind."""
    fields: Fields = {}
    header = _sized(file)
    at = 0
    while at + 4 <= len(header):
        (size,) = struct.unpack_from("<L", header, at)
        name, _, value = header[at + 4 : at + 4 + size].partition(b"=")
        fields[name.decode("latin-1")] = value
        at += 4 + size
    if fields.get("op") != bytes([op]):
        raise DataError(f"expected a record of kind {op} in the index of a bag; run rosbag reindex")
    return fields, _sized(file)


def _sized(file: BinaryIO) -> bytes:
    size = file.read(4)
    data = file.read(struct.unpack("<L", size)[0]) if len(size) == 4 else b""
    if len(size) < 4 or len(data) < struct.unpack("<L", size)[0]:
        raise DataError("expected a whole index at the end of a bag; run rosbag reindex")
    return data


def _number(fields: Fields, name: str) -> int:
    value = fields.get(name, b"")
    if len(value) not in (4, 8):
        raise DataError(f"expected a number as {name} in the index of a bag; run rosbag reindex")
    return int.from_bytes(value, "little")
