"""Copy a bag of any kind with one topic more, and every other message byte for byte."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path, PurePath
from typing import Any

from kineme.errors import DataError
from kineme.files.ros.added_topic import TEXT, AddedTopic, added_topic, copy_bag, copy_mcap, copy_sqlite
from kineme.files.ros.bags import Bag, open_bag, storages_of
from kineme.files.ros.damage import refused
from kineme.files.ros.expanded_folder import INFORMATION, METADATA

Texts = Sequence[tuple[int, str]]  # time of recording [ns] and text of each message


def copy_with_topic(source: Path, target: Path, name: str, texts: Callable[[int, int], Texts]) -> None:
    """Copy a bag to a new file, or a folder to a new one, with a topic of texts.

    Without texts it is a plain copy. Memory does not grow with the bag.

    Parameters
    ----------
    source, target : Path
    name : str
        The topic.
    texts : callable
        Of the times of the first and of the last message of the bag [ns].

    Raises
    ------
    DataError
        The bag cannot be opened, has that topic, or takes none: damaged, without index, or compressed as a whole.
    """
    with open_bag(source) as bag:
        chosen = texts(int(bag.reader.start_time), int(bag.reader.end_time) - 1)
        added = added_topic(bag, name, chosen)
        with refused("expected a bag that takes a topic more", bag.remedy):
            if source.is_dir():
                _copy_folder(bag, source, target, added)
            elif not added.messages:
                shutil.copyfile(source, target)
            elif bag.version == 1:
                copy_bag(bag, target, added)
            else:
                _copy_file(source, target, added, storages_of(bag)[0])


def _copy_folder(bag: Bag, source: Path, target: Path, added: AddedTopic) -> None:
    """Each message goes into the file that was recorded at its time; the description of the folder counts them."""
    from ruamel.yaml import YAML

    yaml = YAML()
    yaml.width, yaml.preserve_quotes = 2**20, True
    if bag.compression == "file":
        raise DataError("expected a bag whose files are not compressed as a whole, to add a topic to; ros2 bag convert")
    if bag.compression == "message":
        added = added._replace(messages=tuple((stamp, _compressed(raw)) for stamp, raw in added.messages))
    with refused(f"expected {METADATA} of a bag of ROS 2", "run ros2 bag reindex"):
        whole = yaml.load((source / METADATA).read_text(encoding="utf-8"))
        about = whole[INFORMATION]
        names = [PurePath(one).name for one in about["relative_file_paths"]]
        parts = _divided(added, [one.metadata.start_time for one in storages_of(bag)])
        changed = {names[k]: part for k, part in parts.items()}
        if added.messages:
            _count(about, added)
        for entry in about.get("files") or []:
            if part := changed.get(PurePath(entry["path"]).name):
                _extend(entry, part)
    shutil.copytree(
        source, target, dirs_exist_ok=True, ignore=lambda folder, _: changed if Path(folder) == source else ()
    )
    for one, part in changed.items():
        _copy_file(source / one, target / one, part, storages_of(bag)[names.index(one)])
    if changed:
        with (target / METADATA).open("w", encoding="utf-8") as file:
            yaml.dump(whole, file)


def _copy_file(source: Path, target: Path, added: AddedTopic, storage: Any) -> None:
    """Write a copy of a file of ROS 2, which rosbags reads with that storage."""
    ending = source.suffix.lower()
    if ending == ".db3":
        copy_sqlite(source, target, added)
    elif ending == ".mcap":
        copy_mcap(source, target, added, storage.chunks[0].compression if storage.chunks else "zstd")
    else:
        raise DataError(f"expected files of a bag that end in .mcap or .db3, got {source.name}")


def _divided(added: AddedTopic, starts: Sequence[int]) -> dict[int, AddedTopic]:
    """Number of a file -> the messages after its start and before the start of the next."""
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


def _compressed(raw: bytes) -> bytes:
    from rosbags.rosbag2.storage_mcap import zstd

    return bytes(zstd.compress(raw))
