"""Open a bag of ROS 1 or ROS 2 and stream the bytes of its messages, by the package rosbags.

Whatever rosbags raises on damaged bags becomes a `DataError`, and nothing expands beyond a limit: what compressed bytes
say of their size may be wrong, and rosbags expands a chunk whole before it looks at its size, if it does.
"""

from __future__ import annotations

import os
import struct
from bz2 import BZ2Decompressor
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import cache, partial
from itertools import groupby
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO, NamedTuple

from kineme.errors import DataError, KinemeError
from kineme.io.limits import VARIABLE, check_in_passing, max_file_bytes, most_in_passing
from kineme.io.records import needs

METADATA = "metadata.yaml"
INFORMATION = "rosbag2_bagfile_information"

_MOST_RATIO = 64  # of recordings; a file larger than the limit on files is expanded up to this ratio
_AT_ONCE = 2**20

#: File ending, or none for a folder -> what may help if the bag is damaged.
REMEDIES = {
    ".bag": "if the recording was cut off, run rosbag reindex",
    ".mcap": "if the recording was cut off, run mcap recover",
    ".db3": "copy it again, or give the folder of the bag",
    "": "copy it again, or run ros2 bag reindex",
}

_MEAN_MORE = frozenset("?#%")

#: File ending -> the first bytes of every such file. What begins otherwise is not given to rosbags.
_MAGIC = {".bag": b"#ROSBAG V2.0\n", ".mcap": b"\x89MCAP0\r\n", ".db3": b"SQLite format 3\0"}

_HEAD = struct.Struct("<BQ")  # kind and length of a record of MCAP
_HEADER, _CHUNK, _ATTACHMENT = 1, 6, 9  # kinds
_LONGEST = 64  # bytes of a profile
_SIZE_AT = 16  # where a chunk says to how many bytes it expands

_KINDS = {".bag": "ROS 1 bag", ".mcap": "MCAP", ".db3": "ROS 2 SQLite"}


class Topic(NamedTuple):
    """A topic of a bag."""

    name: str
    type: str  # of its messages
    n_messages: int
    connections: tuple[Any, ...]  # of rosbags; several nodes may publish one topic


class Bag(NamedTuple):
    """An open bag."""

    kind: str  # such as ``"ROS 1 bag"``
    topics: tuple[Topic, ...]  # in alphabetic order. A topic that carries several types occurs once for each.
    reader: Any  # of rosbags
    version: int  # one of 1, 2; of ROS
    remedy: str  # what may help if the bag is damaged
    compression: str = ""  # one of "", "file", "message"; what is compressed each for itself, apart from chunks


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """Open a bag, a file or a folder."""
    with needs("rosbags", "read bags of ROS", "ros"):
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2
    ending = "" if path.is_dir() else path.suffix.lower()
    remedy = REMEDIES[ending]
    bound_chunks_of_mcap()
    with ExitStack() as stack:
        folder = stack.enter_context(expanded_folder(path)) if not ending else Folder(path, (path,), "")
        for file in folder.files:
            if file.suffix.lower() == ".mcap" or file == path:
                try:
                    check_records(file)
                except DataError as error:
                    raise DataError(str(error) if file == path else f"{file.name}: {error}") from error
        plain = stack.enter_context(plain_name(folder.path, ending))
        with refused("expected a bag of ROS that can be opened", remedy):
            reader: Any = (Reader1 if ending == ".bag" else Reader2)(plain)
            if ending == ".bag":
                _read_any_order(reader)
            reader.open()
        stack.callback(reader.close)
        with refused("expected the topics of a bag of ROS", remedy):
            if ending == ".bag":
                for at, chunk in reader.chunks.items():
                    check_in_passing(chunk.datasize, f"a chunk at byte {at:,}")
                    reader.chunks[at] = chunk._replace(decompressor=partial(_expand_of_ros_1, reader.bio, at))
            elif folder.compression == "message":  # expanded here, up to a limit
                reader.storage.metadata = reader.storage.metadata._replace(compression_mode=None)
            topics = _topics(reader.connections)
        version = 1 if ending == ".bag" else 2
        yield Bag(_KINDS.get(ending, "ROS 2 bag"), topics, reader, version, remedy, folder.compression)


def _read_any_order(reader: Any) -> None:
    """Let rosbags look at the order of fields in each index record: roscpp writes them in another order than rosbag."""
    read = reader.read_index_data

    def read_anew(at: int, indexes: Any) -> None:
        reader.index_data_header_offsets = None
        read(at, indexes)

    reader.read_index_data = read_anew


def messages_of(bag: Bag, topics: Sequence[Topic]) -> Iterator[tuple[int, int, bytes]]:
    """Index of the topic, time of recording [ns since 1970] and bytes of the messages of some topics, in that order."""
    connections = [connection for topic in topics for connection in topic.connections]
    if not connections:  # none would mean all to rosbags
        return
    index_of = {id(connection): k for k, topic in enumerate(topics) for connection in topic.connections}
    with refused("expected messages to the end", bag.remedy):
        for storage in storages_of(bag):
            check_overlaps(storage, [topic.name for topic in topics])
        for connection, recorded, raw in bag.reader.messages(connections=connections):
            data = expand_message(raw) if bag.compression == "message" else raw
            yield index_of[id(connection)], int(recorded), data


def storages_of(bag: Bag) -> Sequence[Any]:
    """Return the objects with which rosbags reads the files of a bag of ROS 2; none for ROS 1."""
    if bag.version == 1:
        return ()
    storage = bag.reader.storage
    return getattr(storage, "storages", (storage,))


def _topics(connections: Sequence[Any]) -> tuple[Topic, ...]:
    def key(connection: Any) -> tuple[str, str]:
        package, _, rest = str(connection.msgtype).partition("/")  # some writers leave out the middle part
        name = f"{package}/msg/{rest}" if rest and "/" not in rest else str(connection.msgtype)
        return str(connection.topic), name

    groups = [(name, list(some)) for name, some in groupby(sorted(connections, key=key), key)]
    return tuple(
        Topic(*name, sum(int(connection.msgcount) for connection in some), tuple(some)) for name, some in groups
    )


def check_records(path: Path) -> bytes:
    """Refuse a file that is none of ROS by its first bytes, and an MCAP file whose records are none or too large.

    Other damage is left to rosbags. Returns the profile of an MCAP file, ``b"ros2"`` of one of ROS 2, else nothing.
    """
    ending = path.suffix.lower()
    with path.open("rb") as file:
        first = file.read(len(magic := _MAGIC[ending]))
        if first != magic:
            got = repr(first) if first else "an empty file"
            raise DataError(f"expected a {ending} file of ROS, which begins with {magic!r}, got {got}")
        return _check_mcap(file, len(magic)) if ending == ".mcap" else b""


def _check_mcap(file: BinaryIO, at: int) -> bytes:
    """Refuse zeros, each nine of which rosbags takes for a record, and records that are large: it reads them whole."""
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


@contextmanager
def plain_name(path: Path, ending: str) -> Iterator[Path]:
    """Yield the path, or a link to it: a database's name is an address to SQLite, in which ?, # and % mean more."""
    files = [file for kind in ("*.db3*", "*.mcap*") for file in path.glob(kind)] if not ending else [path]
    if ending not in ("", ".db3") or not _MEAN_MORE & set("".join(map(str, files))):
        yield path
        return
    plain = str.maketrans(dict.fromkeys(_MEAN_MORE, "_"))
    with TemporaryDirectory() as folder:
        for file in files:
            (Path(folder) / file.name.translate(plain)).symlink_to(file.resolve())
        if ending:
            yield Path(folder) / path.name.translate(plain)
            return
        about = (path / "metadata.yaml").read_text(encoding="utf-8")
        for file in files:
            about = about.replace(file.name, file.name.translate(plain))
        (Path(folder) / "metadata.yaml").write_text(about, encoding="utf-8")
        yield Path(folder)


def logs_beside(path: Path) -> list[str]:
    """Name the logs beside a bag in SQLite: a recording that was cut off has its last messages there."""
    files = sorted(path.glob("*.db3")) if path.is_dir() else [path] if path.suffix.lower() == ".db3" else []
    logs = [(file, file.with_name(f"{file.name}-wal")) for file in files]
    return [
        f"{log.name}: messages that are not in the database yet; to add them, open it once: sqlite3 {file.name} "
        "'PRAGMA wal_checkpoint(TRUNCATE)'"
        for file, log in logs
        if log.is_file() and log.stat().st_size
    ]


@contextmanager
def refused(expected: str, remedy: str) -> Iterator[None]:
    """Raise whatever rosbags raises on a damaged bag as a `DataError`."""
    try:
        yield
    except (KinemeError, MemoryError):
        raise
    except Exception as error:
        is_silent = isinstance(error, AssertionError) and not str(error)
        reason = "records that contradict each other" if is_silent else " ".join(str(error).split())
        reason = reason or type(error).__name__
        unknown = ", which rosbags does not know" if isinstance(error, KeyError) else ""
        raise DataError(f"{expected}, got: {reason[:300]}{unknown}; {remedy}") from error


def expand(compression: str, data: bytes, size: int, what: str = "a chunk") -> bytes:
    """Expand all frames in some bytes, of "zstd", "lz4" or "bz2", to `size` bytes, which is checked first."""
    check_in_passing(size, what)
    parts, n_bytes = [], 0
    while True:
        decompressor = _decompressor(compression)()
        parts.append(decompressor.decompress(data, max_length=size + 1 - n_bytes))
        n_bytes += len(parts[-1])
        if n_bytes > size:
            raise DataError(f"expected {what} that expands to {size:,} bytes, got one that expands to more")
        if not decompressor.eof:
            raise DataError(f"expected {what} in {compression}, got one that is cut off")
        data = decompressor.unused_data
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


def records_of_mcap(file: BinaryIO, validate_crcs: bool = False) -> Iterator[Any]:
    """Yield the records of an MCAP file and of its chunks, which expand no further than they say."""
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader, breakup_chunk

    for record in StreamReader(file, emit_chunks=True, validate_crcs=validate_crcs).records:
        if isinstance(record, Chunk):
            how, data = record.compression, record.data
            plain = expand(how, data, record.uncompressed_size) if how else data
            yield from breakup_chunk(replace(record, data=plain, compression=""), validate_crc=validate_crcs)
        else:
            yield record


def compression_of_ros_1(file: Any, at: int) -> tuple[str, int]:
    """Return the compression of the chunk at a byte of a bag of ROS 1, and its expanded size [bytes]."""
    from rosbags.rosbag1.reader import Header, RecordType

    file.seek(at)
    header = Header.read(file, RecordType.CHUNK)
    return header.get_string("compression"), header.get_uint32("size")


def _expand_of_ros_1(file: Any, at: int, data: bytes) -> bytes:
    compression, size = compression_of_ros_1(file, at)
    return data if compression == "none" else expand(compression, data, size, f"a chunk at byte {at:,}")


@cache
def bound_chunks_of_mcap() -> None:
    """Bound the chunks of every MCAP file from now on: it is a table of rosbags that says how they are expanded."""
    from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

    DECOMPRESSORS.update({name: partial(expand, name) for name in ("lz4", "zstd")})


def check_overlaps(storage: Any, topics: Sequence[str]) -> None:
    """Refuse an MCAP file of which too much must be in memory at once: chunks whose times overlap are read together."""
    ids = [connection.id for connection in storage.connections if connection.topic in topics]
    changes, n_bytes = [], 0
    for chunk in getattr(storage, "chunks", ()):
        if any(chunk.channel_count.get(k, 0) for k in ids):
            size = max(chunk.uncompressed_size, chunk.compressed_size)
            changes += [(chunk.message_start_time, 0, size), (chunk.message_end_time, 1, -size)]
    for _, _, change in sorted(changes):
        n_bytes += change
        check_in_passing(n_bytes, "a set of chunks of one time")


class Folder(NamedTuple):
    """A folder that rosbags can open, the files of the bag in it, and what is compressed: "file", "message" or ""."""

    path: Path
    files: tuple[Path, ...]
    compression: str


@contextmanager
def expanded_folder(path: Path) -> Iterator[Folder]:
    """Yield the folder, or one with its files expanded; one that is none of ROS 2 is left to rosbags to refuse."""
    from ruamel.yaml import YAML

    about: dict[str, Any] = {}
    with suppress(Exception):  # rosbags reads it too, and says why it cannot
        about = dict(YAML(typ="safe").load((path / METADATA).read_text(encoding="utf-8"))[INFORMATION])
    mode = str(about.get("compression_mode", "")).lower().replace("none", "")
    files = tuple(path / PurePath(str(file)).name for file in about.get("relative_file_paths") or ())
    is_whole = all(file.is_file() for file in files)
    if mode != "file" or about.get("compression_format") != "zstd" or not is_whole:
        yield Folder(path, files if is_whole else (), mode)
        return
    from rosbags.rosbag2.storage_mcap import zstd

    with TemporaryDirectory() as name:
        folder = Path(name)
        for file in files:
            most = max(max_file_bytes(), _MOST_RATIO * file.stat().st_size)
            with file.open("rb") as start:
                declared = zstd.get_frame_info(start.read(64)).decompressed_size or 0
            _check(declared, most, file)
            n_bytes = 0
            with zstd.open(file, "rb") as old, (folder / file.stem).open("wb") as new:
                while some := old.read(_AT_ONCE):
                    n_bytes += len(some)
                    _check(n_bytes, most, file)
                    new.write(some)
        plain = {**about, "compression_mode": "", "relative_file_paths": [file.stem for file in files]}
        with (folder / METADATA).open("w", encoding="utf-8") as description:
            YAML(typ="safe").dump({INFORMATION: plain}, description)
        yield Folder(folder, tuple(folder / file.stem for file in files), mode)


def _check(n_bytes: int, most: int, source: Path) -> None:
    if n_bytes > most:
        raise DataError(
            f"{source.name}: expected a file that expands to at most {most:,} bytes, got one that expands to "
            f"{n_bytes:,} or more; if you trust it, set the environment variable {VARIABLE} to more"
        )
