"""Messages in JSON of an MCAP file, as Foxglove and others record them: each message of a topic is a sample."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from kineme.errors import DataError
from kineme.io.arrays.json_trees import as_tree, size_of_objects
from kineme.io.arrays.tree_movements import tree_movements
from kineme.io.limits import check_expanded
from kineme.io.ros.damage import REMEDIES, refused
from kineme.io.ros.expand import expand
from kineme.movements.tables.columns import is_time
from kineme.movements.tables.layout import Layout
from kineme.movements.tables.parsed import Parsed, listed

_RECORDED = "timestamp [s]"  # head of the times of the recording
_PER_SECOND = 1e9
_CHECKED = 2**12  # messages between two looks at the memory


def json_messages(path: Path, layout: Layout) -> Parsed:
    """The movement of a topic. Its times are those in the messages, or where they have none those of the recording.

    Raises
    ------
    DataError
        The package mcap is not installed, the file is damaged, no topic in JSON, or several of which none is chosen.
    """
    topics, encodings = _messages(path, set(layout.topics))
    if len(topics) != 1:
        got = f"the topics {listed(topics)}; say which with topic=, in the shell --topic" if topics else ""
        none = f"messages in {listed(sorted(encodings))}; write a topic as CSV or JSON lines"
        raise DataError(f"expected an MCAP file of ROS 2, or one topic with messages in JSON, got {got or none}")
    ((name, messages),) = topics.items()
    samples = []
    for recorded, raw in sorted(messages, key=lambda one: one[0]):
        try:
            sample = json.loads(raw)
        except ValueError as error:
            raise DataError(f"topic {name}: expected messages in JSON, got {raw[:40]!r} ({error})") from error
        if not isinstance(sample, dict):
            raise DataError(f"topic {name}: expected messages that are objects, got {raw[:40]!r}")
        samples.append(sample if any(map(is_time, sample)) else {_RECORDED: recorded / _PER_SECOND} | sample)
    parsed = tree_movements(as_tree(samples), replace(layout, topic=None), "MCAP", many="take")
    return parsed._replace(detected=parsed.detected._replace(layout=f"topic {name} in JSON"))


def _messages(path: Path, wanted: set[str]) -> tuple[dict[str, list[tuple[int, bytes]]], set[str]]:
    """Topic -> when each of its messages in JSON was recorded [ns], and its bytes; and the encodings of all topics."""
    from mcap.records import Channel, Message

    channels: dict[int, Any] = {}
    topics: dict[str, list[tuple[int, bytes]]] = {}
    n = n_bytes = 0
    with refused("expected an MCAP file that can be read", REMEDIES[".mcap"]):
        for record in _records(path):
            if isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message) and channels[record.channel_id].message_encoding == "json":
                if wanted and channels[record.channel_id].topic not in wanted:
                    continue
                topics.setdefault(channels[record.channel_id].topic, []).append((record.log_time, record.data))
                n, n_bytes = n + 1, n_bytes + size_of_objects(record.data)
                if n % _CHECKED == 0:
                    check_expanded(n_bytes, "messages in JSON")
    check_expanded(n_bytes, "messages in JSON")
    return topics, {one.message_encoding for one in channels.values()}


def _records(path: Path) -> Iterator[Any]:
    """The records of a file and of its chunks, which expand no further than they say."""
    try:
        from mcap.records import Chunk
        from mcap.stream_reader import StreamReader, breakup_chunk
    except ImportError as error:
        raise DataError("expected the package mcap to read MCAP; pip install 'kineme[ros]'") from error
    with path.open("rb") as file:
        for record in StreamReader(file, emit_chunks=True).records:
            if isinstance(record, Chunk):
                how, data = record.compression, record.data
                plain = expand(how, data, record.uncompressed_size) if how else data
                yield from breakup_chunk(replace(record, compression="", data=plain))
            else:
                yield record
