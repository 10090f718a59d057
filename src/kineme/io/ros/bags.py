"""Open a bag of ROS 1 or ROS 2 and stream the bytes of its messages, by the package rosbags.

Bags in SQLite need names that SQLite takes, and the log of what is not in the database yet.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO, NamedTuple

from kineme.errors import DataError
from kineme.io.limits import check_in_passing
from kineme.io.records import needs
from kineme.io.ros.damage import (
    REMEDIES,
    Folder,
    bound_chunks_of_mcap,
    bound_chunks_of_ros_1,
    check_overlaps,
    expand_message,
    expanded_folder,
    refused,
)

_MEAN_MORE = frozenset("?#%")

#: File ending -> the first bytes of every such file. What begins otherwise is not given to rosbags.
_MAGIC = {".bag": b"#ROSBAG V2.0\n", ".mcap": b"\x89MCAP0\r\n", ".db3": b"SQLite format 3\0"}

_HEAD = struct.Struct("<BQ")  # kind and length of a record of MCAP
_HEADER, _CHUNK, _ATTACHMENT = 1, 6, 9  # kinds
_LONGEST = 64  # bytes of a profile
_SIZE_AT = 16  # where a chunk says to how many bytes it expands

_KINDS = {".bag": "ROS 1 bag", ".mcap": "MCAP", ".db3": "ROS 2 SQLite"}


class Topic(NamedTuple):
    """A topic of a bag: what it is called, the type of its messages, and how many there are.

    `connections` are of rosbags; several nodes may publish one topic.
    """

    name: str
    type: str
    n_messages: int
    connections: tuple[Any, ...]


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
                bound_chunks_of_ros_1(reader)
            elif folder.compression == "message":  # expanded here, up to a limit
                reader.storage.metadata = reader.storage.metadata._replace(compression_mode=None)
            topics = _topics(reader.connections)
        version = 1 if ending == ".bag" else 2
        yield Bag(_KINDS.get(ending, "ROS 2 bag"), topics, reader, version, remedy, folder.compression)


def _read_any_order(reader: Any) -> None:
    """Let rosbags look at the order of fields in each index record of a bag of ROS 1, and not in the first alone.

    roscpp writes them in another order than rosbag, which may have appended to what roscpp recorded.
    """
    read = reader.read_index_data

    def read_anew(at: int, indexes: Any) -> None:
        reader.index_data_header_offsets = None
        read(at, indexes)

    reader.read_index_data = read_anew


def messages_of(bag: Bag, topics: Sequence[Topic]) -> Iterator[tuple[int, int, bytes]]:
    """Index of the topic, time of recording [ns since 1970] and bytes of every message of some topics.

    They come in the order of that time.
    """
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

    Returns the profile of an MCAP file, ``b"ros2"`` of one of ROS 2; nothing of other files.

    Records are passed over by their lengths. Other damage is left to rosbags, which may find its way by the index.
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


@contextmanager
def plain_name(path: Path, ending: str) -> Iterator[Path]:
    """The path, or a link to it: the name of a database is an address to SQLite, where these characters mean more."""
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
