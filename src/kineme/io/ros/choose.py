"""Topics and frames of a bag: what it holds, and what is read of it, that which is asked for or the only choice."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from difflib import get_close_matches
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import DataError, KinemeError
from kineme.io.records import Contents
from kineme.io.ros.bags import Bag, Topic, messages_of, open_bag
from kineme.io.ros.number_fields import TRANSFORMS, TYPES, Heads, Row, decoder_of, number_fields, transform_row
from kineme.movements.channels.detect import find_channels
from kineme.movements.tables.layout import Known, Layout, listed
from kineme.reporting.text import counted, first_names
from kineme.validation import MIN_SAMPLES

Edge = tuple[str, str]  # parent, child

_LOOKED_AT = 16  # messages of a topic, of which the first ones may be none or hold no sample

_SHOWN = 20  # topics in a message
_OF_ROS = ("rosgraph_msgs", "rcl_interfaces", "diagnostic_msgs", "dynamic_reconfigure", "bond", "actionlib_msgs")
PLAIN = "a movement, by --topic"  # how topics of numbers are read
FRAMES_LOOKED_AT = 50_000  # transforms that are read to list the frames


class Choice(NamedTuple):
    """What is read of a bag."""

    topics: tuple[Topic, ...]  # in the order that was asked for
    frames: tuple[Edge, ...] = ()  # pairs, which come before the topics
    transforms: tuple[Topic, ...] = ()  # the topics that the frames are from
    as_known: bool = False  # nobody asked for it, but the movements to compare with were read from it


def choose(bag: Bag, layout: Layout) -> Choice:
    """Choose the topics and frames to read."""
    frames = tuple(pair_of(frame) for frame in layout.frames)
    named = [_named(bag, name) for name in layout.topics]
    topics = tuple(topic for topic in named if topic.type not in TRANSFORMS)
    # The topics of transforms: all, or those that are named, each with that of its transforms that never change.
    named_transforms = {topic.name for topic in named if topic.type in TRANSFORMS}
    transforms = tuple(
        topic
        for topic in transform_topics(bag)
        if not named_transforms or {topic.name, topic.name.removesuffix("_static")} & named_transforms
    )
    if not frames and len(topics) < len(named):
        frames = (_only_frames(bag, transforms),)
    if topics or frames:
        return Choice(topics, frames, transforms)
    candidates = [topic for topic in bag.topics if can_be_read(topic)]
    if len(candidates) == 1 and not transforms:
        return Choice((candidates[0],))
    if layout.reference is not None and (choice := _as_known(bag, layout.reference, candidates)):
        return choice._replace(as_known=True)
    if not candidates and not transforms and len(others := _topics_of_numbers(bag)) == 1:
        return Choice((others[0],))
    if transforms and not candidates:
        return Choice((), (_only_frames(bag, transforms),), transforms)
    if candidates:
        frame = "; the pose of one frame in another with --frame parent:child" if transforms else ""
        raise DataError(
            f"expected one topic that can be read, got {listed_topics([*candidates, *transforms])}; say which with "
            f"topic=, in the shell --topic {candidates[0].name}{frame}"
        )
    say = f"; of numbers, say which with topic=, in the shell --topic {others[0].name}" if others else ""
    raise DataError(f"expected a topic of movements, got {listed_topics(bag.topics)}{say}")


def _as_known(bag: Bag, movements: Known, candidates: Sequence[Topic]) -> Choice | None:
    """Choose what the movements to compare with were read from, or the only topic with such columns; else None."""
    choices = []
    for topics, frames in movements.choices:
        with suppress(DataError):
            choices.append(choose(bag, Layout(topic=topics, frame=frames)))
    choices = [choice for choice in choices if choice.transforms or not choice.frames]
    if not choices:
        choices = [Choice((topic,)) for topic in fitting_topics(bag, candidates, movements)]
    return choices[0] if len(choices) == 1 else None


def _topics_of_numbers(bag: Bag) -> list[Topic]:
    """Find topics of numbers, of other types, which are read if asked for or alone; not those of ROS itself."""
    topics = [topic for topic in bag.topics if topic.type not in (*TYPES, *TRANSFORMS) and holds_samples(topic)]
    readable = []
    for topic in topics:
        with suppress(DataError):
            if topic.type.partition("/")[0] not in _OF_ROS and number_fields(bag, topic):
                readable.append(topic)
    return readable


def holds_samples(topic: Topic) -> bool:
    """Tell whether a topic has as many messages as a movement needs samples."""
    return topic.n_messages >= MIN_SAMPLES


def can_be_read(topic: Topic) -> bool:
    """Tell whether a topic by itself holds a movement."""
    kind = TYPES.get(topic.type)
    return kind is not None and (topic.n_messages >= 1 if kind.path else holds_samples(topic))


def listed_topics(topics: Sequence[Topic]) -> str:
    """Return topics with their types and numbers of messages, for a message."""
    if not topics:
        return "none"
    shown = [f"{topic.name} ({topic.type}, {counted(topic.n_messages, 'message')})" for topic in topics]
    return first_names(shown, _SHOWN)


def pair_of(text: str) -> Edge:
    """Return two frames written as ``parent:child``."""
    parent, colon, child = text.partition(":")
    if not colon or not parent or not child or ":" in child:
        raise DataError(f"expected two frames as parent:child, got {text!r}")
    if parent.removeprefix("/") == child.removeprefix("/"):
        raise DataError(f"expected two frames, got {parent!r} twice")
    return parent.removeprefix("/"), child.removeprefix("/")


def _named(bag: Bag, name: str) -> Topic:
    same = [topic for topic in bag.topics if topic.name == name] or [
        topic for topic in bag.topics if topic.name == f"/{name}"
    ]
    if not same:
        alike = get_close_matches(name, [topic.name for topic in bag.topics], 3)
        meant = f" (did you mean {' or '.join(alike)}?)" if alike else ""
        raise DataError(f"expected a topic {name!r}{meant}, got {listed_topics(bag.topics)}")
    candidates = [topic for topic in same if topic.type in TYPES or topic.type in TRANSFORMS] or same
    if not (full := [topic for topic in candidates if topic.n_messages]):
        raise DataError(f"topic {same[0].name}: expected samples of {candidates[0].type}, got no messages")
    return max(full, key=lambda topic: topic.n_messages)


def _only_frames(bag: Bag, transforms: Sequence[Topic]) -> Edge:
    edges = connected_graph(bag, transforms, (), FRAMES_LOOKED_AT)
    if len(edges) == 1:
        return edges[0]
    pairs = first_names([f"{parent}:{child}" for parent, child in edges], _SHOWN)
    raise DataError(
        f"expected two frames, got the transforms {pairs or 'of none'}; say which with frame=, in the shell "
        "--frame parent:child, for any two frames that are connected"
    )


def fitting_topics(bag: Bag, topics: Sequence[Topic], movements: Known) -> list[Topic]:
    """Return the topics with columns of the same names; if there are none, with as many columns, of the same kinds."""
    if not movements.columns:
        return []
    columns = {topic.name: _first_sample(bag, topic) for topic in topics}
    same = [topic for topic in topics if sorted(columns[topic.name][0]) == sorted(movements.columns)]
    wanted = len(movements.columns), movements.n_orientations
    return same or [topic for topic in topics if _numbers(*columns[topic.name]) == wanted]


def _first_sample(bag: Bag, topic: Topic) -> tuple[Heads, Sequence[float]]:
    """Return the columns and numbers of the first sample of a topic; nothing if it has none soon."""
    row_of = TYPES[topic.type].row if topic.type in TYPES else None
    if row_of is None:
        return (), ()
    with suppress(KinemeError, ValueError):  # a topic that cannot be read fits nothing
        decode = decoder_of(bag, topic)
        for _, _, raw in islice(messages_of(bag, [topic]), _LOOKED_AT):
            heads, row = row_of(decode(raw))
            if heads:
                return heads, row
    return (), ()


def _numbers(heads: Heads, row: Sequence[float]) -> tuple[int, int]:
    """Count the columns, and the quaternions among them."""
    if not heads:
        return 0, 0
    channels = find_channels(heads, np.array([row], dtype=float), np.array([0, 1]), {})
    return len(heads), sum(channel.kind == "orientation" for channel in channels)


class Step(NamedTuple):
    """A transform on the way between two frames; `forward` leads from the parent to the child."""

    edge: Edge
    forward: bool


def transform_topics(bag: Bag) -> list[Topic]:
    """Return the topics with transforms between frames."""
    return [topic for topic in bag.topics if topic.type in TRANSFORMS and topic.n_messages]


def transforms_in(bag: Bag, topics: Sequence[Topic], bad: list[str]) -> Iterator[tuple[int, int, Any]]:
    """Index of the topic, time of recording [ns], and transform; messages that are none are added to `bad`."""
    decoders = [decoder_of(bag, topic) for topic in topics]
    for n, (k, recorded, raw) in enumerate(messages_of(bag, topics)):
        try:
            message = decoders[k](raw)
        except ValueError as error:
            bad.append(f"topic {topics[k].name}: message {n}: {error}")
            continue
        for transform in message.transforms:
            yield k, recorded, transform


def edge_of(transform: Any) -> Edge:
    """Return parent and child, as in ROS 2 without a slash in front."""
    return transform.header.frame_id.removeprefix("/"), transform.child_frame_id.removeprefix("/")


def connected_graph(bag: Bag, topics: Sequence[Topic], wanted: Sequence[Edge], most: int | None = None) -> list[Edge]:
    """Return the frames, each with its usual parent, of `most` transforms, or until all wanted pairs are connected."""
    parents: dict[str, Counter[str]] = {}

    def ordered() -> list[Edge]:
        return sorted((counts.most_common(1)[0][0], child) for child, counts in parents.items())

    open_pairs = list(wanted)
    edges: set[Edge] = set()
    try:
        for n, (_, _, transform) in enumerate(transforms_in(bag, topics, [])):
            edge = edge_of(transform)
            parents.setdefault(edge[1], Counter())[edge[0]] += 1
            if edge not in edges:
                edges.add(edge)
                open_pairs = [pair for pair in open_pairs if pair[1] not in _ways(ordered(), pair[0])]
                if wanted and not open_pairs:
                    break
            if most is not None and n + 1 >= most:
                break
    except DataError:
        if not parents:
            raise
    return ordered()


def chain(edges: Sequence[Edge], parent: str, child: str) -> list[Step]:
    """Return the transforms from one frame to another."""
    frames = sorted({frame for edge in edges for frame in edge})
    for frame in (parent, child):
        if frame not in frames:
            alike = get_close_matches(frame, frames, 3)
            meant = f" (did you mean {' or '.join(alike)}?)" if alike else ""
            raise DataError(f"expected a frame {frame!r}{meant}, got the frames {listed(frames)}")
    ways = _ways(edges, parent)
    if child not in ways:
        mine, others = sorted({*ways} - {parent}), sorted({*_ways(edges, child)} - {child})
        raise DataError(
            f"expected transforms that lead from {parent!r} to {child!r}, got none; {parent!r} is connected with "
            f"{listed(mine)}, {child!r} with {listed(others)}"
        )
    return ways[child]


def _ways(edges: Sequence[Edge], start: str) -> dict[str, list[Step]]:
    """Return the shortest ways from a frame to all that are connected with it."""
    near: dict[str, list[tuple[str, Step]]] = {}
    for parent, child in edges:
        near.setdefault(parent, []).append((child, Step((parent, child), True)))
        near.setdefault(child, []).append((parent, Step((parent, child), False)))
    ways, waiting = {start: list[Step]()}, deque([start])
    while waiting:
        here = waiting.popleft()
        for there, step in near.get(here, ()):
            if there not in ways:
                ways[there] = [*ways[here], step]
                waiting.append(there)
    return ways


def bag_contents(path: Path) -> list[Contents]:
    """Return topics with types, numbers of messages and how they are read; and frames with numbers of transforms."""
    with open_bag(path) as bag:
        rows = tuple((topic.name, topic.type, topic.n_messages, _read_as(bag, topic)) for topic in bag.topics)
        topics = Contents("topics", ("topic", "type", "messages", "read as"), rows)
        return [topics, _frames(bag)] if transform_topics(bag) else [topics]


def _read_as(bag: Bag, topic: Topic) -> str:
    if topic.type in TRANSFORMS:
        return "frames" if topic.n_messages else "nothing: empty"
    if topic.type in TYPES:
        said = "a movement for each message" if TYPES[topic.type].path else "a movement"
        return said if can_be_read(topic) else "nothing: too few messages"
    try:
        n = len(number_fields(bag, topic).heads)
    except DataError:
        return "nothing: no numbers"
    return f"{counted(n, 'number')}: {PLAIN}" if holds_samples(topic) else "nothing: too few messages"


def _frames(bag: Bag) -> Contents:
    """Read the transforms of the first messages: all of them would take as long as to read the bag."""
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
