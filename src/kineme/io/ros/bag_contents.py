"""What a bag holds: its topics and, where there are transforms, its frames."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from kineme.errors import DataError
from kineme.io.contents import Contents
from kineme.io.ros.bags import Bag, Topic, open_bag
from kineme.io.ros.choose import FRAMES_LOOKED_AT, PLAIN, can_be_read, holds_samples
from kineme.io.ros.frames import Edge, edge_of, transform_topics, transforms_in
from kineme.io.ros.message_types import TRANSFORMS, TYPES, Row, transform_row
from kineme.io.ros.number_fields import number_fields
from kineme.reporting.text import counted


def bag_contents(path: Path) -> list[Contents]:
    """Topics with types, numbers of messages and how they are read; and frames with numbers of transforms.

    Raises
    ------
    DataError
        The bag cannot be opened.
    """
    with open_bag(path) as bag:
        rows = tuple((one.name, one.type, one.n_messages, _read_as(bag, one)) for one in bag.topics)
        topics = Contents("topics", ("topic", "type", "messages", "read as"), rows)
        return [topics, _frames(bag)] if transform_topics(bag) else [topics]


def _read_as(bag: Bag, topic: Topic) -> str:
    if topic.type in TRANSFORMS:
        return "frames" if topic.n_messages else "nothing: empty"
    if topic.type not in TYPES:
        try:
            n = len(number_fields(bag, topic).heads)
        except DataError:
            return "nothing: no numbers"
        return f"{counted(n, 'number')}: {PLAIN}" if holds_samples(topic) else "nothing: too few messages"
    if not can_be_read(topic):
        return "nothing: too few messages"
    return "a movement for each message" if TYPES[topic.type].path else "a movement"


def _frames(bag: Bag) -> Contents:
    """The transforms of the first messages: all of them would take as long as to read the bag."""
    counts: Counter[Edge] = Counter()
    first: dict[Edge, Row] = {}
    moving: set[Edge] = set()
    note, n, bad = "", 0, list[str]()
    try:
        for n, (_, _, transform) in enumerate(transforms_in(bag, transform_topics(bag), bad), 1):
            edge, row = edge_of(transform), transform_row(transform.transform)
            counts[edge] += 1
            if first.setdefault(edge, row) != row:
                moving.add(edge)
            if n == FRAMES_LOOKED_AT:
                note = f"of the first {n:,} transforms"
                break
    except DataError as error:
        note = f"of the first {n:,} transforms: {error}"
    rows = tuple((*edge, counts[edge], "moves" if edge in moving else "is fixed") for edge in sorted(counts))
    return Contents("frames", ("parent", "child", "transforms", "the child"), rows, note)
