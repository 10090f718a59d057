"""Which topics and frames of a bag are read: those that are asked for, or the only one that can be."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from difflib import get_close_matches
from typing import NamedTuple

import numpy as np

from kineme.errors import DataError, KinemeError
from kineme.io.ros.bags import Bag, Topic, messages_of
from kineme.io.ros.decode import decoder_of
from kineme.io.ros.frames import Edge, connected_graph, transform_topics
from kineme.io.ros.message_types import TRANSFORMS, TYPES, Heads
from kineme.io.ros.number_fields import number_fields
from kineme.movements.channels.detect import find_channels
from kineme.movements.tables.layout import Known, Layout
from kineme.reporting.text import counted, first_names
from kineme.validation import MIN_SAMPLES

_LOOKED_AT = 16  # messages of a topic, of which the first ones may be none or hold no sample

_SHOWN = 20  # topics in a message
_OF_ROS = ("rosgraph_msgs", "rcl_interfaces", "diagnostic_msgs", "dynamic_reconfigure", "bond", "actionlib_msgs")
PLAIN = "a movement, by --topic"  # how topics of numbers are read
FRAMES_LOOKED_AT = 50_000  # transforms that are read to list the frames


class Choice(NamedTuple):
    """Topics in the order that was asked for, and pairs of frames, which come first, with the topics they are from.

    `as_known`: nobody asked for them; they are what the movements to compare with were read from.
    """

    topics: tuple[Topic, ...]
    frames: tuple[Edge, ...] = ()
    transforms: tuple[Topic, ...] = ()
    as_known: bool = False


def choose(bag: Bag, layout: Layout) -> Choice:
    """What to read.

    Raises
    ------
    DataError
        A topic that is not there or cannot be read; nothing that can be read; or several topics where none is named.
        The message lists the topics.
    """
    frames = tuple(pair_of(one) for one in layout.frames)
    named = [_named(bag, name) for name in layout.topics]
    topics = tuple(one for one in named if one.type not in TRANSFORMS)
    transforms = _transforms(bag, {one.name for one in named if one.type in TRANSFORMS})
    if not frames and len(topics) < len(named):
        frames = (_only_frames(bag, transforms),)
    if topics or frames:
        return Choice(topics, frames, transforms)
    candidates = [one for one in bag.topics if can_be_read(one)]
    if len(candidates) == 1 and not transforms:
        return Choice((candidates[0],))
    if layout.known is not None and (known := _as_known(bag, layout.known, candidates)):
        return known._replace(as_known=True)
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


def _as_known(bag: Bag, known: Known, candidates: Sequence[Topic]) -> Choice | None:
    """What the movements to compare with were read from, or the only topic with such columns; None if that is open."""
    choices = []
    for topics, frames in known.choices:
        try:
            choice = choose(bag, Layout(topic=topics, frame=frames))
        except DataError:
            continue
        if choice.transforms or not choice.frames:
            choices.append(choice)
    if not choices:
        choices = [Choice((one,)) for one in fitting_topics(bag, candidates, known)]
    return choices[0] if len(choices) == 1 else None


def _topics_of_numbers(bag: Bag) -> list[Topic]:
    """Topics of other types with numbers, which are read if they are asked for or alone; not those of ROS itself."""
    topics = [one for one in bag.topics if one.type not in (*TYPES, *TRANSFORMS) and holds_samples(one)]
    found = []
    for one in topics:
        with suppress(DataError):
            if one.type.partition("/")[0] not in _OF_ROS and number_fields(bag, one):
                found.append(one)
    return found


def holds_samples(topic: Topic) -> bool:
    """Whether a topic has as many messages as a movement needs samples."""
    return topic.n_messages >= MIN_SAMPLES


def can_be_read(topic: Topic) -> bool:
    """Whether a topic by itself holds a movement."""
    kind = TYPES.get(topic.type)
    return kind is not None and (topic.n_messages >= 1 if kind.path else holds_samples(topic))


def listed_topics(topics: Sequence[Topic]) -> str:
    """Topics with their types and numbers of messages, for a message."""
    if not topics:
        return "none"
    shown = [f"{one.name} ({one.type}, {counted(one.n_messages, 'message')})" for one in topics]
    return first_names(shown, _SHOWN)


def pair_of(text: str) -> Edge:
    """Two frames written as ``parent:child``."""
    parent, colon, child = text.partition(":")
    if not colon or not parent or not child or ":" in child:
        raise DataError(f"expected two frames as parent:child, got {text!r}")
    if parent.removeprefix("/") == child.removeprefix("/"):
        raise DataError(f"expected two frames, got {parent!r} twice")
    return parent.removeprefix("/"), child.removeprefix("/")


def _named(bag: Bag, name: str) -> Topic:
    same = [one for one in bag.topics if one.name == name] or [one for one in bag.topics if one.name == f"/{name}"]
    if not same:
        alike = get_close_matches(name, [one.name for one in bag.topics], 3)
        meant = f" (did you mean {' or '.join(alike)}?)" if alike else ""
        raise DataError(f"expected a topic {name!r}{meant}, got {listed_topics(bag.topics)}")
    known = [one for one in same if one.type in TYPES or one.type in TRANSFORMS] or same
    if not (full := [one for one in known if one.n_messages]):
        raise DataError(f"topic {same[0].name}: expected samples of {known[0].type}, got no messages")
    return max(full, key=lambda one: one.n_messages)


def _transforms(bag: Bag, named: set[str]) -> tuple[Topic, ...]:
    """The topics of transforms: all, or those that are named, each with that of its transforms that never change."""
    known = transform_topics(bag)
    return tuple(one for one in known if not named or one.name in named or one.name.removesuffix("_static") in named)


def _only_frames(bag: Bag, transforms: Sequence[Topic]) -> Edge:
    edges = connected_graph(bag, transforms, (), FRAMES_LOOKED_AT).edges
    if len(edges) == 1:
        return edges[0]
    pairs = first_names([f"{parent}:{child}" for parent, child in edges], _SHOWN)
    raise DataError(
        f"expected two frames, got the transforms {pairs or 'of none'}; say which with frame=, in the shell "
        "--frame parent:child, for any two frames that are connected"
    )


def fitting_topics(bag: Bag, topics: Sequence[Topic], known: Known) -> list[Topic]:
    """The topics with columns of the same names; if there are none, with as many columns, of the same kinds."""
    if not known.columns:
        return []
    columns = {one.name: _first_sample(bag, one) for one in topics}
    same = [one for one in topics if sorted(columns[one.name][0]) == sorted(known.columns)]
    wanted = len(known.columns), known.n_orientations
    return same or [one for one in topics if _numbers(*columns[one.name]) == wanted]


def _first_sample(bag: Bag, topic: Topic) -> tuple[Heads, Sequence[float]]:
    """The columns and numbers of the first sample of a topic; nothing if it has none soon."""
    row_of = TYPES[topic.type].row if topic.type in TYPES else None
    if row_of is None:
        return (), ()
    try:
        decode = decoder_of(bag, topic)
        for (_, _, raw), _ in zip(messages_of(bag, [topic]), range(_LOOKED_AT), strict=False):
            heads, row = row_of(decode(raw))
            if heads:
                return heads, row
    except (KinemeError, ValueError):
        pass  # a topic that cannot be read fits nothing
    return (), ()


def _numbers(heads: Heads, row: Sequence[float]) -> tuple[int, int]:
    """How many columns there are, and how many quaternions among them."""
    if not heads:
        return 0, 0
    channels = find_channels(heads, np.array([row], dtype=float), np.array([0, 1]), {})
    return len(heads), sum(one.kind == "orientation" for one in channels)
