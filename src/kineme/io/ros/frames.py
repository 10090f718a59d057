"""Which frames the transforms of a bag connect, and the chain of transforms between two of them."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Iterator, Sequence
from difflib import get_close_matches
from typing import Any, NamedTuple

from kineme.errors import DataError
from kineme.io.ros.bags import Bag, Topic, messages_of
from kineme.io.ros.decode import decoder_of
from kineme.io.ros.message_types import TRANSFORMS
from kineme.movements.tables.parsed import listed

Edge = tuple[str, str]  # parent, child


class Step(NamedTuple):
    """A transform on the way between two frames; `forward` leads from the parent to the child."""

    edge: Edge
    forward: bool


class Graph(NamedTuple):
    """What is known of the frames: for each child how many transforms each of its parents has."""

    parents: dict[str, Counter[str]]

    @property
    def edges(self) -> list[Edge]:
        """Each child with the parent that it has most transforms of, in alphabetic order."""
        return sorted((counts.most_common(1)[0][0], child) for child, counts in self.parents.items())


def transform_topics(bag: Bag) -> list[Topic]:
    """The topics with transforms between frames."""
    return [one for one in bag.topics if one.type in TRANSFORMS and one.n_messages]


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
    """Parent and child, as in ROS 2 without a slash in front."""
    return transform.header.frame_id.removeprefix("/"), transform.child_frame_id.removeprefix("/")


def connected_graph(bag: Bag, topics: Sequence[Topic], wanted: Sequence[Edge], most: int | None = None) -> Graph:
    """The frames, read until all wanted pairs are connected, or `most` transforms, or to the end."""
    graph = Graph({})
    open_pairs = list(wanted)
    known: set[Edge] = set()
    try:
        for n, (_, _, transform) in enumerate(transforms_in(bag, topics, [])):
            edge = edge_of(transform)
            graph.parents.setdefault(edge[1], Counter())[edge[0]] += 1
            if edge not in known:
                known.add(edge)
                open_pairs = [pair for pair in open_pairs if _way(graph.edges, *pair) is None]
                if wanted and not open_pairs:
                    break
            if most is not None and n + 1 >= most:
                break
    except DataError:
        if not graph.parents:
            raise
    return graph


def chain(graph: Graph, parent: str, child: str) -> list[Step]:
    """The transforms from one frame to another.

    Raises
    ------
    DataError
        There is no such frame, or no way between them; the message lists the frames.
    """
    edges = graph.edges
    frames = sorted({frame for edge in edges for frame in edge})
    for frame in (parent, child):
        if frame not in frames:
            alike = get_close_matches(frame, frames, 3)
            meant = f" (did you mean {' or '.join(alike)}?)" if alike else ""
            raise DataError(f"expected a frame {frame!r}{meant}, got the frames {listed(frames)}")
    way = _way(edges, parent, child)
    if way is None:
        mine = sorted(_reached(edges, parent))
        others = sorted(_reached(edges, child))
        raise DataError(
            f"expected transforms that lead from {parent!r} to {child!r}, got none; {parent!r} is connected with "
            f"{listed(one for one in mine if one != parent)}, {child!r} with "
            f"{listed(one for one in others if one != child)}"
        )
    return way


def _neighbors(edges: Iterable[Edge]) -> dict[str, list[tuple[str, Step]]]:
    near: dict[str, list[tuple[str, Step]]] = {}
    for parent, child in edges:
        near.setdefault(parent, []).append((child, Step((parent, child), True)))
        near.setdefault(child, []).append((parent, Step((parent, child), False)))
    return near


def _way(edges: Sequence[Edge], start: str, end: str) -> list[Step] | None:
    """The shortest way between two frames, or None."""
    near, ways = _neighbors(edges), {start: list[Step]()}
    waiting = deque([start])
    while waiting and end not in ways:
        here = waiting.popleft()
        for there, step in near.get(here, ()):
            if there not in ways:
                ways[there] = [*ways[here], step]
                waiting.append(there)
    return ways.get(end)


def _reached(edges: Sequence[Edge], start: str) -> set[str]:
    """The frames that are connected with one."""
    near, reached, waiting = _neighbors(edges), {start}, [start]
    while waiting:
        for there, _ in near.get(waiting.pop(), ()):
            if there not in reached:
                reached.add(there)
                waiting.append(there)
    return reached
