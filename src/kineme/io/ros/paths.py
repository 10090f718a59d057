"""Topics whose messages are movements of their own: planned trajectories and paths."""

from __future__ import annotations

from array import array
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.limits import check_expanded
from kineme.io.ros.bags import Bag, Topic, messages_of
from kineme.io.ros.decode import decoder_of
from kineme.io.ros.message_types import TYPES, Heads
from kineme.io.ros.streams import Stream, with_rotations
from kineme.movements.tables.parsed import listed
from kineme.reporting.text import counted
from kineme.validation import Array

_SECOND = 1e9  # [ns]
_COPIES = 3


class Paths(NamedTuple):
    """The movements of a topic, one after the other.

    Attributes
    ----------
    topic : Topic
    heads : tuple of d str
    values : ndarray of shape (total, d)
    times : ndarray of shape (total,) or None
        In seconds; None if the points of a movement have no stamps of their own.
    time : str
        What the stamps are called.
    lengths, places : list of n int
        Number of points, and number of the message.
    left_out : list of str
    """

    topic: Topic
    heads: Heads
    values: Array
    times: Array | None
    time: str
    lengths: list[int]
    places: list[int]
    left_out: list[str]


class _Group(NamedTuple):
    values: array[float]
    stamps: array[int]
    lengths: list[int]
    places: list[int]


def read_paths(bag: Bag, topic: Topic, skip: str) -> Paths:
    """The movements of a topic. Of those with different columns, the most frequent are read.

    A message that cannot be read costs its own movement, whatever `skip` says.

    Raises
    ------
    DataError
        No movement.
    """
    groups: dict[Heads, _Group] = {}
    left_out: list[str] = []
    _collect(bag, topic, groups, left_out)
    if not groups:
        reason = f": {left_out[0]}" if left_out else ", got messages without points"
        raise DataError(f"topic {topic.name}: expected movements of {topic.type}{reason}")
    heads, one = max(groups.items(), key=lambda group: len(group[1].lengths))
    for other, group in groups.items():
        if other != heads:
            n = counted(len(group.lengths), "message")
            left_out.append(f"topic {topic.name}: {n} with other columns {listed(other)}")
    values = np.frombuffer(one.values, np.float64).reshape(-1, len(heads))
    stamps = np.frombuffer(one.stamps, np.int64)
    stream = with_rotations(Stream(topic.name, heads, values, stamps, None), f"topic {topic.name}: ", skip, left_out)
    if len(stream.values) < len(values):
        raise DataError(left_out[-1])
    is_planned = topic.type.endswith("JointTrajectory")
    times = stamps / _SECOND if is_planned or _increase(stamps, one.lengths) else None
    time = "time_from_start" if is_planned else "header.stamp"
    return Paths(topic, stream.heads, stream.values, times, time, one.lengths, one.places, left_out)


def _collect(bag: Bag, topic: Topic, groups: dict[Heads, _Group], left_out: list[str]) -> None:
    decode, path_of = decoder_of(bag, topic), TYPES[topic.type].path
    assert path_of is not None
    n = n_bytes = 0
    try:
        for n, (_, _, raw) in enumerate(messages_of(bag, [topic])):
            try:
                heads, stamps, rows = path_of(decode(raw))
            except ValueError as error:
                left_out.append(f"topic {topic.name}: message {n}: {error}")
                continue
            if not rows:
                continue
            group = groups.setdefault(heads, _Group(array("d"), array("q"), [], []))
            for row in rows:
                group.values.extend(row)
            group.stamps.extend(stamps)
            group.lengths.append(len(rows))
            group.places.append(n)
            n_bytes += 8 * len(rows) * (len(heads) + 1)
            check_expanded(_COPIES * n_bytes, "a topic")
    except DataError as error:
        left_out.append(f"topic {topic.name}: after {counted(n, 'message')}: {error}")


def _increase(stamps: NDArray[np.int64], lengths: list[int]) -> bool:
    """Whether the stamps increase within every movement."""
    inner = np.ones(max(len(stamps) - 1, 0), dtype=bool)
    inner[np.cumsum(lengths)[:-1] - 1] = False
    return bool((np.diff(stamps)[inner] > 0).all())
