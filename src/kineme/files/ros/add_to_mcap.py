"""Copy an MCAP file with one topic more: the bytes of all its data stay, another chunk and a new index follow them."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path
from typing import BinaryIO

from kineme.errors import DataError
from kineme.files.ros.added_topic import TEXT, AddedTopic, copy_bytes

_MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _INDEX, _CHUNK_INDEX = range(2, 9)  # kinds of records
_STATISTICS, _OFFSET, _DATA_END = 0x0B, 0x0E, 0x0F
_FOOTER_SIZE, _DATA_END_SIZE = 9 + 20, 9 + 4
_COUNTS = struct.Struct("<QHIIIIQQ")  # messages, schemas, channels, attachments, metadata, chunks, first and last time
_REMEDY = "write it anew with mcap recover"

Summary = dict[int, list[bytes]]  # kind of record -> contents, in the order of the file


def copy_mcap(source: Path, target: Path, added: AddedTopic) -> None:
    """Write a copy of an MCAP file with a topic more.

    Raises
    ------
    DataError
        The file has no index, or messages outside of chunks: a chunk beside these would hide them from readers.
    """
    with source.open("rb") as old, target.open("wb") as new:
        start, offsets, checked = _read_footer(old)
        end = start - _DATA_END_SIZE
        old.seek(end)
        closing = old.read(_DATA_END_SIZE)
        if closing[:9] != struct.pack("<BQ", _DATA_END, 4):
            raise DataError(f"expected an MCAP file whose data end before its index; {_REMEDY}")
        summary = _read_summary(old, start)
        checksum = copy_bytes(old, new, 0, end)
        data = _add(summary, end, added)
        new.write(data)
        checksum = zlib.crc32(data, checksum) if any(closing[9:]) else 0
        new.write(_record(_DATA_END, struct.pack("<I", checksum)))
        _write_summary(new, summary, offsets, checked)


def _read_footer(file: BinaryIO) -> tuple[int, bool, bool]:
    """Where the summary begins, whether it lists its groups, and whether it has a checksum."""
    at = file.seek(0, io.SEEK_END) - _FOOTER_SIZE - len(_MAGIC)
    file.seek(max(at, 0))
    data = file.read()
    if at < 0 or data[:9] != struct.pack("<BQ", _FOOTER, 20) or data[-len(_MAGIC) :] != _MAGIC:
        raise DataError(f"expected an MCAP file that was closed; {_REMEDY}")
    start, offsets, checksum = struct.unpack_from("<QQI", data, 9)
    if not len(_MAGIC) + _DATA_END_SIZE < start <= at:
        raise DataError(f"expected an MCAP file with an index, to add a topic to, got one without; {_REMEDY}")
    return start, bool(offsets), bool(checksum)


def _read_summary(file: BinaryIO, start: int) -> Summary:
    end = file.seek(0, io.SEEK_END)
    file.seek(start)
    summary: Summary = {}
    while True:
        head = file.read(9)
        kind, size = struct.unpack("<BQ", head) if len(head) == 9 else (0, 0)
        if kind == _FOOTER:
            break
        if not kind or size > end - file.tell():
            raise DataError(f"expected an MCAP file with a whole index; {_REMEDY}")
        content = file.read(size)
        if kind != _OFFSET:
            summary.setdefault(kind, []).append(content)
    if any(kind not in summary for kind in (_SCHEMA, _CHANNEL, _CHUNK_INDEX)):
        raise DataError(
            f"expected an MCAP file with chunks, and an index of these and of topics, to add a topic to; {_REMEDY}"
        )
    return summary


def _add(summary: Summary, at: int, added: AddedTopic) -> bytes:
    """The new chunk with its index, which stands at `at`; the summary is changed to list it."""
    schema_id, channel_id = (
        1 + max(struct.unpack_from("<H", one)[0] for one in summary[k]) for k in (_SCHEMA, _CHANNEL)
    )
    if max(schema_id, channel_id) > 0xFFFF:
        raise DataError("expected an MCAP file with fewer than 65,535 topics, to add one to")
    schema = struct.pack("<H", schema_id) + _text(TEXT) + _text("ros2msg") + _text(added.definition)
    about = _text("offered_qos_profiles") + _text("")
    channel = struct.pack("<HH", channel_id, schema_id) + _text(added.name) + _text("cdr")
    channel += struct.pack("<I", len(about)) + about
    records = bytearray(_record(_SCHEMA, schema) + _record(_CHANNEL, channel))
    index = bytearray()
    for number, (stamp, raw) in enumerate(added.messages):
        index += struct.pack("<QQ", stamp, len(records))
        records += _record(_MESSAGE, struct.pack("<HIQQ", channel_id, number, stamp, stamp) + raw)
    first, last = added.messages[0][0], added.messages[-1][0]
    head = struct.pack("<QQQI", first, last, len(records), zlib.crc32(records))
    chunk = _record(_CHUNK, head + _text("") + struct.pack("<Q", len(records)) + records)
    index_record = _record(_INDEX, struct.pack("<HI", channel_id, len(index)) + index)
    where = struct.pack("<HQ", channel_id, at + len(chunk))
    listed = struct.pack("<QQQQ", first, last, at, len(chunk)) + struct.pack("<I", len(where)) + where
    listed += struct.pack("<Q", len(index_record)) + _text("") + struct.pack("<QQ", len(records), len(records))
    for kind, content in ((_SCHEMA, schema), (_CHANNEL, channel), (_CHUNK_INDEX, listed)):
        summary[kind].append(content)
    summary[_STATISTICS] = [_counted(one, channel_id, added) for one in summary.get(_STATISTICS, [])]
    return chunk + index_record


def _counted(statistics: bytes, channel_id: int, added: AddedTopic) -> bytes:
    n, (first, last) = len(added.messages), (added.messages[0][0], added.messages[-1][0])
    messages, schemas, channels, attachments, metadata, chunks, start, end = _COUNTS.unpack_from(statistics)
    start, end = (min(start, first), max(end, last)) if messages else (first, last)
    (size,) = struct.unpack_from("<I", statistics, _COUNTS.size)
    counts = statistics[_COUNTS.size + 4 : _COUNTS.size + 4 + size] + struct.pack("<HQ", channel_id, n)
    whole = _COUNTS.pack(messages + n, schemas + 1, channels + 1, attachments, metadata, chunks + 1, start, end)
    return whole + struct.pack("<I", len(counts)) + counts


def _write_summary(file: BinaryIO, summary: Summary, offsets: bool, checked: bool) -> None:
    """The summary in its groups, where they stand if the old one said so, and the footer."""
    start = file.tell()
    whole, groups = bytearray(), bytearray()
    for kind, contents in summary.items():
        group = b"".join(_record(kind, one) for one in contents)
        if group:
            groups += _record(_OFFSET, struct.pack("<BQQ", kind, start + len(whole), len(group)))
        whole += group
    offset_start = start + len(whole) if offsets else 0
    whole += groups if offsets else b""
    whole += struct.pack("<BQQQ", _FOOTER, 20, start, offset_start)
    file.write(whole + struct.pack("<I", zlib.crc32(whole) if checked else 0) + _MAGIC)


def _record(kind: int, content: bytes | bytearray) -> bytes:
    return struct.pack("<BQ", kind, len(content)) + bytes(content)


def _text(text: str) -> bytes:
    data = text.encode()
    return struct.pack("<I", len(data)) + data
