"""Copy a bag of any kind with one topic more, and every other message byte for byte."""

from __future__ import annotations

import shutil
import sqlite3
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from functools import partial
from heapq import merge
from math import inf
from pathlib import Path, PurePath
from typing import Any, NamedTuple

from kineme.errors import DataError
from kineme.io.records import needs
from kineme.io.ros import bags
from kineme.io.ros.number_fields import standard_types

TEXT = "std_msgs/msg/String"  # every version of ROS knows it

Texts = Sequence[tuple[int, str]]  # time of recording [ns] and text of each message


def copy_with_topic(source: Path, target: Path, name: str, texts: Callable[[int, int], Texts]) -> None:
    """Copy a bag with a topic of texts, which take the times of the first and the last message [ns]."""
    with bags.open_bag(source) as bag:
        chosen = texts(int(bag.reader.start_time), int(bag.reader.end_time) - 1)
        added = added_topic(bag, name, chosen)
        with bags.refused("expected a bag that takes a topic more", bag.remedy):
            if source.is_dir():
                _copy_folder(bag, source, target, added)
            elif not added.messages:
                shutil.copyfile(source, target)
            elif bag.version == 1:
                copy_bag(bag, target, added)
            else:
                _copy_file(source, target, added, bags.storages_of(bag)[0])


def _copy_folder(bag: bags.Bag, source: Path, target: Path, added: AddedTopic) -> None:
    """Write each message into the file that was recorded at its time; the description of the folder counts them."""
    from ruamel.yaml import YAML

    yaml = YAML()
    yaml.width, yaml.preserve_quotes = 2**20, True
    if bag.compression == "file":
        raise DataError("expected a bag whose files are not compressed as a whole, to add a topic to; ros2 bag convert")
    if bag.compression == "message":
        from rosbags.rosbag2.storage_mcap import zstd

        added = added._replace(messages=tuple((stamp, bytes(zstd.compress(raw))) for stamp, raw in added.messages))
    with bags.refused(f"expected {bags.METADATA} of a bag of ROS 2", "run ros2 bag reindex"):
        metadata = yaml.load((source / bags.METADATA).read_text(encoding="utf-8"))
        about = metadata[bags.INFORMATION]
        names = [PurePath(file).name for file in about["relative_file_paths"]]
        parts = _divided(added, [storage.metadata.start_time for storage in bags.storages_of(bag)])
        changed = {names[k]: part for k, part in parts.items()}
        if added.messages:
            _count(about, added)
        for entry in about.get("files") or []:
            if part := changed.get(PurePath(entry["path"]).name):
                _extend(entry, part)
    shutil.copytree(
        source, target, dirs_exist_ok=True, ignore=lambda folder, _: changed if Path(folder) == source else ()
    )
    for name, part in changed.items():
        _copy_file(source / name, target / name, part, bags.storages_of(bag)[names.index(name)])
    if changed:
        with (target / bags.METADATA).open("w", encoding="utf-8") as file:
            yaml.dump(metadata, file)


def _copy_file(source: Path, target: Path, added: AddedTopic, storage: Any) -> None:
    ending = source.suffix.lower()
    if ending == ".db3":
        copy_sqlite(source, target, added)
    elif ending == ".mcap":
        copy_mcap(source, target, added, storage.chunks[0].compression if storage.chunks else "zstd")
    else:
        raise DataError(f"expected files of a bag that end in .mcap or .db3, got {source.name}")


def _divided(added: AddedTopic, starts: Sequence[int]) -> dict[int, AddedTopic]:
    """Return number of a file -> the messages after its start and before the start of the next."""
    order = sorted(range(len(starts)), key=starts.__getitem__)
    parts: dict[int, list[tuple[int, bytes]]] = {}
    for stamp, raw in added.messages:
        begun = [k for k in order if starts[k] <= stamp]
        parts.setdefault(begun[-1] if begun else order[0], []).append((stamp, raw))
    return {k: added._replace(messages=tuple(some)) for k, some in parts.items()}


def _count(about: Any, added: AddedTopic) -> None:
    _extend(about, added)
    topic = {"name": added.name, "type": TEXT, "serialization_format": "cdr"}
    if about["version"] >= 4:
        topic["offered_qos_profiles"] = [] if about["version"] >= 9 else ""  # type: ignore[assignment]
    if about["version"] >= 7:
        topic["type_description_hash"] = added.digest
    listed = {"topic_metadata": topic, "message_count": len(added.messages)}
    about["topics_with_message_count"].append(listed)


def _extend(about: Any, added: AddedTopic) -> None:
    """Count the messages, and let the time of recording include them."""
    start, length = about["starting_time"], about["duration"]
    first, span = start["nanoseconds_since_epoch"], length["nanoseconds"]
    stamps = [stamp for stamp, _ in added.messages]
    begin, end = min(first, *stamps), max(first + span, *stamps)
    start["nanoseconds_since_epoch"], length["nanoseconds"] = begin, end - begin
    about["message_count"] += len(stamps)


class AddedTopic(NamedTuple):
    """Messages of the type std_msgs/String."""

    name: str
    # definition and digest: of the type, its text, and its checksum in this version of ROS
    definition: str
    digest: str
    messages: tuple[tuple[int, bytes], ...]  # time of recording [ns] and bytes of each, in the order of time


def added_topic(bag: bags.Bag, name: str, texts: Sequence[tuple[int, str]]) -> AddedTopic:
    """Return texts with their times of recording [ns] as messages of that bag's version of ROS."""
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


def copy_bag(bag: bags.Bag, target: Path, added: AddedTopic) -> None:
    """Write a copy of an open bag of ROS 1 with a topic more: anew, since readers take fields in one order only."""
    from rosbags.rosbag1 import Writer

    writer = Writer(target)
    compression = bags.compression_of_ros_1(bag.reader.bio, min(bag.reader.chunks))[0] if bag.reader.chunks else "none"
    if compression != "none":
        writer.set_compression(Writer.CompressionFormat[compression.upper()])
    if compression == "lz4":  # rosbags writes frames that roslz4, with which ROS 1 reads, takes for damaged
        from lz4.frame import compress

        writer.compressor = partial(compress, store_size=False, block_linked=False, content_checksum=True)
    copies: dict[tuple[Any, ...], Any] = {}  # a node that began anew has connections that are equal
    with writer:
        for existing in bag.reader.connections:
            extra = {"callerid": existing.ext.callerid, "latching": existing.ext.latching}
            about = (existing.topic, existing.msgtype, existing.msgdef.data, existing.digest, *extra.values())
            if about not in copies:
                copies[about] = writer.add_connection(*about[:2], msgdef=about[2], md5sum=about[3], **extra)
            copies[existing.id,] = copies[about]
        copies[()] = writer.add_connection(added.name, TEXT, msgdef=added.definition, md5sum=added.digest)
        recorded = ((stamp, (connection.id,), raw) for connection, stamp, raw in bag.reader.messages())
        texts = ((stamp, (), raw) for stamp, raw in added.messages)
        for stamp, connection, raw in merge(recorded, texts, key=lambda message: message[0]):
            writer.write(copies[connection], stamp, raw)


def copy_mcap(source: Path, target: Path, added: AddedTopic, compression: str) -> None:
    """Write a copy of an MCAP file with a topic more: messages, attachments and metadata in their order."""
    with needs("mcap", "copy MCAP files", "ros"):
        from mcap import records
        from mcap.writer import CompressionType, Writer
    schemas, channels, texts = {0: 0}, dict[int, int](), deque(added.messages)
    with source.open("rb") as old, target.open("wb") as new:
        parts = bags.records_of_mcap(old, validate_crcs=True)
        header = next(parts)
        writer: Any = Writer(new, compression=CompressionType[compression.upper() or "NONE"])
        writer.start(header.profile, header.library)
        schema = writer.register_schema(TEXT, "ros2msg", added.definition.encode())
        topic = writer.register_channel(added.name, "cdr", schema, {"offered_qos_profiles": ""})

        def write_texts(before: float) -> None:
            while texts and texts[0][0] < before:
                stamp, raw = texts.popleft()
                writer.add_message(topic, stamp, raw, stamp, len(added.messages) - len(texts) - 1)

        for record in parts:
            if isinstance(record, records.Schema) and record.id not in schemas:
                schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
            elif isinstance(record, records.Channel) and record.id not in channels:
                about = (record.topic, record.message_encoding, schemas[record.schema_id], record.metadata)
                channels[record.id] = writer.register_channel(*about)
            elif isinstance(record, records.Message):
                write_texts(record.log_time)
                message = (record.log_time, record.data, record.publish_time, record.sequence)
                writer.add_message(channels[record.channel_id], *message)
            elif isinstance(record, records.Attachment):
                writer.add_attachment(**vars(record))
            elif isinstance(record, records.Metadata):
                writer.add_metadata(record.name, record.metadata)
            elif isinstance(record, records.DataEnd):  # the summary is written anew
                break
        write_texts(inf)
        writer.finish()


def copy_sqlite(source: Path, target: Path, added: AddedTopic) -> None:
    """Write a copy of a database of ROS 2 with a topic more, in the columns that its version has."""
    shutil.copyfile(source, target)
    about = {"name": added.name, "type": TEXT, "serialization_format": "cdr", "offered_qos_profiles": ""}
    meaning = {"topic_type": TEXT, "encoding": "ros2msg", "encoded_message_definition": added.definition}
    digest = {"type_description_hash": added.digest}
    try:
        with closing(sqlite3.connect(target)) as database, database:
            (last,) = database.execute("SELECT max(id) FROM topics").fetchone()
            topic = (last or 0) + 1
            _insert(database, "topics", {"id": topic, **about, **digest})
            if _columns(database, "message_definitions"):
                defined = "SELECT 1 FROM message_definitions WHERE topic_type = ?"
                if not database.execute(defined, (TEXT,)).fetchone():
                    _insert(database, "message_definitions", meaning | digest)
            rows = ((topic, stamp, raw) for stamp, raw in added.messages)
            database.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
    except sqlite3.Error as error:
        raise DataError(f"expected a database of ROS 2 that takes another topic, got: {error}") from error


def _insert(database: sqlite3.Connection, table: str, values: Mapping[str, Any]) -> None:
    columns = _columns(database, table)
    taken = {name: value for name, value in values.items() if name in columns}
    marks = ", ".join("?" * len(taken))
    database.execute(f"INSERT INTO {table} ({', '.join(taken)}) VALUES ({marks})", tuple(taken.values()))


def _columns(database: sqlite3.Connection, table: str) -> set[str]:
    return {str(row[1]) for row in database.execute(f"PRAGMA table_info({table})")}
