"""Open a bag of ROS 1 or ROS 2 and stream its messages, by the package rosbags.

Messages are decoded by the definitions of their types that come with rosbags. Those in a bag are not used: rosbags
makes program code of them, and a recording must not make programs run. A type that differs from its standard is refused
where the bag says so, by the checksum of its definition.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO, NamedTuple

from kineme.errors import DataError, KinemeError

#: File ending -> the first bytes of every such file. What begins otherwise is not given to rosbags.
_MAGIC = {".bag": b"#ROSBAG V2.0\n", ".mcap": b"\x89MCAP0\r\n", ".db3": b"SQLite format 3\0"}
_KINDS = {".bag": "ROS 1 bag", ".mcap": "MCAP", ".db3": "ROS 2 SQLite"}
_REMEDIES = {
    ".bag": "if the recording was cut off, run rosbag reindex",
    ".mcap": "if the recording was cut off, run mcap recover",
    ".db3": "copy it again, or give the folder of the bag",
    "": "copy it again, or run ros2 bag reindex",
}

_MEAN_MORE = frozenset("?#%")

#: In ROS 1 both names of the type of /tf have one definition.
_TF_1 = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_TF_DEFINITION = "geometry_msgs/TransformStamped[] transforms\n"


class Topic(NamedTuple):
    """A topic of a bag: what it is called, the type of its messages, and how many there are.

    `connections` are of rosbags; several nodes may publish one topic.
    """

    name: str
    type: str
    n_messages: int
    connections: tuple[Any, ...]


class Bag(NamedTuple):
    """An open bag.

    Attributes
    ----------
    kind : str
        Such as ``"ROS 1 bag"``.
    topics : tuple of Topic
        In alphabetic order. A topic that carries several types occurs once for each.
    reader : object
        Of rosbags.
    version : {1, 2}
        Of ROS.
    remedy : str
        What may help if the bag is damaged.
    """

    kind: str
    topics: tuple[Topic, ...]
    reader: Any
    version: int
    remedy: str


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """Open a bag, a file or a folder.

    Raises
    ------
    DataError
        No bag, damaged, of a kind that rosbags does not read, or rosbags is not installed; the message names the extra.
    """
    try:
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2
    except ImportError as error:
        raise DataError("expected the package rosbags to read bags of ROS; pip install 'kineme[ros]'") from error
    ending = "" if path.is_dir() else path.suffix.lower()
    _check_magic(path, ending)
    remedy = _REMEDIES[ending]
    with _plain_name(path, ending) as plain:
        with refused("expected a bag of ROS that can be opened", remedy):
            reader = (Reader1 if ending == ".bag" else Reader2)(plain)
            reader.open()
        try:
            with refused("expected the topics of a bag of ROS", remedy):
                topics = _topics(reader.connections)
            yield Bag(_KINDS.get(ending, "ROS 2 bag"), topics, reader, 1 if ending == ".bag" else 2, remedy)
        finally:
            reader.close()


def messages_of(bag: Bag, topics: Sequence[Topic]) -> Iterator[tuple[int, int, bytes]]:
    """Index of the topic, time of recording [ns since 1970] and bytes of every message of some topics.

    They come in the order of that time.

    Raises
    ------
    DataError
        The bag is damaged from here on.
    """
    connections = [one for topic in topics for one in topic.connections]
    if not connections:  # none would mean all to rosbags
        return
    index_of = {id(one): k for k, topic in enumerate(topics) for one in topic.connections}
    with refused("expected messages to the end", bag.remedy):
        for connection, recorded, raw in bag.reader.messages(connections=connections):
            yield index_of[id(connection)], int(recorded), raw


def decoder_of(bag: Bag, topic: Topic) -> Callable[[bytes], Any]:
    """What makes a message of the bytes of one; it raises `ValueError` if they are none.

    Raises
    ------
    DataError
        The bag holds the type in another version than the standard one.
    """
    store = standard_types(bag.version)
    _check_version(store, bag.version, topic)
    known = store.get_msgdef(topic.type)
    is_1, cls = bag.version == 1, known.cls
    parse = known.deserialize_ros1 if is_1 else None
    little, big = known.deserialize_cdr_le, known.deserialize_cdr_be

    def decode(raw: bytes) -> Any:
        try:
            if parse is not None:
                message, end = parse(raw, 0, cls, store)
                if end != len(raw):
                    raise ValueError(f"{len(raw)} bytes for {end}")
                return message
            if raw is None or len(raw) < 4 or raw[0] != 0 or raw[1] > 1:
                raise ValueError("no bytes in CDR")
            # Bytes that follow are padding: writers in Python leave some.
            return (little if raw[1] else big)(raw[4:], 0, cls, store)[0]
        except MemoryError:
            raise
        except Exception as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            raise ValueError(f"expected a {topic.type}, got {reason}") from error

    return decode


def logs_beside(path: Path) -> list[str]:
    """What is left out of a bag in SQLite: the log of a recording that was cut off, which holds its last messages."""
    files = sorted(path.glob("*.db3")) if path.is_dir() else [path] if path.suffix.lower() == ".db3" else []
    logs = [(one, one.with_name(f"{one.name}-wal")) for one in files]
    return [
        f"{log.name}: messages that are not in the database yet; to add them, open it once: sqlite3 {one.name} "
        "'PRAGMA wal_checkpoint(TRUNCATE)'"
        for one, log in logs
        if log.is_file() and log.stat().st_size
    ]


@contextmanager
def refused(expected: str, remedy: str) -> Iterator[None]:
    """Whatever rosbags raises on a damaged bag, as a `DataError`."""
    try:
        yield
    except (KinemeError, MemoryError):
        raise
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        unknown = ", which rosbags does not know" if isinstance(error, KeyError) else ""
        raise DataError(f"{expected}, got: {reason[:300]}{unknown}; {remedy}") from error


def _check_magic(path: Path, ending: str) -> None:
    if not ending:
        return
    with path.open("rb") as file:
        first = file.read(len(_MAGIC[ending]))
        if first != _MAGIC[ending]:
            raise DataError(
                f"expected a {ending} file of ROS, which begins with {_MAGIC[ending]!r}, got "
                f"{'an empty file' if not first else repr(first)}"
            )
        if ending == ".mcap":
            _refuse_zeros(file)


def _refuse_zeros(file: BinaryIO) -> None:
    """Refuse an MCAP file with a hole: rosbags takes each nine zeros for a record, of which there may be billions.

    Records are passed over by their lengths. Other damage is left to rosbags, which may find its way by the index.
    """
    end = file.seek(0, os.SEEK_END)
    at = len(_MAGIC[".mcap"])
    while at + 9 <= end - len(_MAGIC[".mcap"]):
        file.seek(at)
        kind, length = struct.unpack("<BQ", file.read(9))
        if not kind:
            raise DataError(f"expected a record of MCAP at byte {at:,}, got zeros; {_REMEDIES['.mcap']}")
        at += 9 + length


@contextmanager
def _plain_name(path: Path, ending: str) -> Iterator[Path]:
    """The path, or a link to it: the name of a database is an address to SQLite, where these characters mean more."""
    files = [one for kind in ("*.db3*", "*.mcap*") for one in path.glob(kind)] if not ending else [path]
    if ending not in ("", ".db3") or not _MEAN_MORE & set("".join(map(str, files))):
        yield path
        return
    plain = str.maketrans(dict.fromkeys(_MEAN_MORE, "_"))
    with TemporaryDirectory() as folder:
        for one in files:
            (Path(folder) / one.name.translate(plain)).symlink_to(one.resolve())
        if ending:
            yield Path(folder) / path.name.translate(plain)
            return
        about = (path / "metadata.yaml").read_text(encoding="utf-8")
        for one in files:
            about = about.replace(one.name, one.name.translate(plain))
        (Path(folder) / "metadata.yaml").write_text(about, encoding="utf-8")
        yield Path(folder)


def _topics(connections: Sequence[Any]) -> tuple[Topic, ...]:
    def key(one: Any) -> tuple[str, str]:
        return str(one.topic), _type_name(str(one.msgtype))

    groups = [(name, list(some)) for name, some in groupby(sorted(connections, key=key), key)]
    return tuple(Topic(*name, sum(int(one.msgcount) for one in some), tuple(some)) for name, some in groups)


def _type_name(name: str) -> str:
    """The name of a type as in ROS 2: some writers leave out its middle part."""
    package, _, rest = name.partition("/")
    return f"{package}/msg/{rest}" if rest and "/" not in rest else name


@cache
def standard_types(version: int) -> Any:
    """The store of the standard types of ROS, of rosbags."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.LATEST)
    for name in _TF_1:
        if name not in store.types:
            store.register(get_types_from_msg(_TF_DEFINITION, name))
    return store


def _check_version(store: Any, version: int, topic: Topic) -> None:
    expected = _digest(store, version, topic.type)
    for one in topic.connections:
        if one.digest and one.digest not in (expected, "*"):
            raise DataError(
                f"topic {topic.name}: expected messages of the standard type {topic.type}, got another version of it, "
                "by its checksum; convert the topic to CSV where that type is installed"
            )


@cache
def _digest(store: Any, version: int, name: str) -> str:
    return str(store.generate_msgdef(name)[1] if version == 1 else store.hash_rihs01(name))
