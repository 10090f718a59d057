"""The samples of topics, kept as numbers while the messages pass by, and several topics as one table."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.limits import check_expanded
from kineme.io.ros.bags import Bag, Topic, messages_of
from kineme.io.ros.number_fields import TYPES, Heads, decoder_of, nanoseconds_of, number_fields
from kineme.movements.channels.channel import Channels
from kineme.movements.channels.coordinates import period_of_channel, without_wraps
from kineme.movements.channels.detect import Given, find_channels, kinds_of
from kineme.movements.rotations import continuous, slerp
from kineme.movements.tables.layout import Column, listed
from kineme.reporting.text import counted, first_names
from kineme.validation import Array

SECOND = 1_000_000_000  # [ns]

Stamps = NDArray[np.int64]

_CHECKED = 2**14  # messages between two looks at the memory
_COPIES = 3  # of the numbers, until they are movements

#: A quaternion whose norm differs from 1 by more than this is no rotation: zeros, or another quantity.
TOLERANCE = 0.1


@dataclass(frozen=True, eq=False)
class Stream:
    """Samples of a topic or of a transform, in the order of the recording."""

    name: str  # of the topic, or the frames of the transform
    heads: Heads
    values: Array  # shape (n, d)
    recorded: Stamps  # shape (n,); when each message was recorded [ns since 1970]
    stamped: Stamps | None  # shape (n,); the stamps in the headers of the messages [ns]; None if they have no headers
    why: str = ""  # why there are no such stamps, where it is not for want of headers

    def at(self, rows: NDArray[Any]) -> Stream:
        """Return some of the samples."""
        stamped = None if self.stamped is None else self.stamped[rows]
        return replace(self, values=self.values[rows], recorded=self.recorded[rows], stamped=stamped)


class Samples(NamedTuple):
    """Numbers that are collected: the rows one after the other, and two stamps for each [ns]."""

    values: array[float]
    recorded: array[int]
    stamped: array[int]

    @classmethod
    def empty(cls) -> Samples:
        """Begin without samples."""
        return cls(array("d"), array("q"), array("q"))


class _Open(NamedTuple):
    decode: Any
    row: Any
    stamp: Any  # message -> [ns]; None if messages do not tell their own time
    groups: dict[Heads, tuple[Samples, list[int] | None]]  # heads -> their samples, and their order in these
    first: dict[Heads, Heads]  # sorted heads -> those that came first
    bad: list[str]
    counts: list[int]  # messages, those without a sample


def read_streams(
    bag: Bag, topics: Sequence[Topic], skip: str, columns: Sequence[Column] | None = None
) -> tuple[list[Stream], list[str]]:
    """Read the samples of topics, those of different columns as streams of their own, and say what was left out."""
    opened = [_open(bag, topic) for topic in topics]
    left_out: list[str] = []
    try:
        _collect(bag, topics, opened)
    except DataError as error:
        n = sum(reading.counts[0] for reading in opened)
        about = f"{', '.join(f'topic {topic.name}' for topic in topics)}: after {counted(n, 'message')}: {error}"
        if skip == "movement" or not n:
            raise DataError(f"{about}{_TO_KEEP if n else ''}") from error
        left_out.append(about)
    streams: list[Stream] = []
    for topic, reading in zip(topics, opened, strict=True):
        # What was not read of a topic, or an error where that costs the movement.
        n, without = reading.counts
        losses = []
        if reading.bad:
            more = f"; {len(reading.bad) - 1} more like this" if len(reading.bad) > 1 else ""
            reason = f"topic {topic.name}: {reading.bad[0]}{more}"
            if skip == "movement":
                raise DataError(f"{reason}{_TO_KEEP if reading.groups else ''}")
            losses.append(reason)
        if without and without < n:
            losses.append(f"topic {topic.name}: {counted(without, 'message')} without positions")
        if n < topic.n_messages:
            losses.append(f"topic {topic.name}: expected {counted(topic.n_messages, 'message')}, got {n:,}")
        if not reading.groups:
            what = f"{counted(n, 'message')} without positions" if without else "no messages"
            raise DataError(f"topic {topic.name}: expected samples of {topic.type}, got {what}")
        left_out += losses
        streams += [
            with_rotations(stream, f"topic {topic.name}: ", skip, left_out, columns)
            for stream in _streams(topic, reading, left_out)
        ]
    return streams, left_out


_TO_KEEP = "; to keep the others, say skip='sample', in the shell --skip sample"


def _open(bag: Bag, topic: Topic) -> _Open:
    kind = TYPES.get(topic.type)
    if kind is None:
        fields = number_fields(bag, topic)
        heads, stamp = fields.heads, (lambda message: message.stamp) if fields.stamp else None
        return _Open(fields.decode, lambda message: (heads, message.row), stamp, {}, {}, [], [0, 0])
    stamp = (lambda message: nanoseconds_of(message.header.stamp)) if kind.has_header else None
    return _Open(decoder_of(bag, topic), kind.row, stamp, {}, {}, [], [0, 0])


def _collect(bag: Bag, topics: Sequence[Topic], opened: Sequence[_Open]) -> None:
    n = 0
    for k, recorded, raw in messages_of(bag, topics):
        decode, row_of, stamp_of, groups, _, bad, counts = opened[k]
        counts[0] += 1
        try:
            message = decode(raw)
            heads, row = row_of(message)
        except ValueError as error:
            bad.append(f"message {counts[0] - 1}: {error}" if not bad else "")
            continue
        if not heads:
            counts[1] += 1
            continue
        samples, order = groups.get(heads) or _group(opened[k], heads)
        samples.values.extend(row if order is None else [row[i] for i in order])
        samples.recorded.append(recorded)
        if stamp_of is not None:
            samples.stamped.append(stamp_of(message))
        n += 1
        if not n % _CHECKED:
            check_samples([samples for each in opened for samples, _ in each.groups.values()])


def check_samples(some: Sequence[Samples]) -> None:
    """Refuse to keep more numbers than the limit of memory allows; samples may occur several times."""
    each = {id(samples): samples for samples in some}.values()
    check_expanded(8 * _COPIES * sum(len(numbers) for samples in each for numbers in samples), "a topic")


def _group(reading: _Open, heads: Heads) -> tuple[Samples, list[int] | None]:
    """Return the samples with these columns, in whatever order they came first."""
    first = reading.first.setdefault(tuple(sorted(heads)), heads)
    if first == heads:
        reading.groups[heads] = Samples.empty(), None
    else:
        place = {head: k for k, head in enumerate(heads)}
        reading.groups[heads] = reading.groups[first][0], [place[head] for head in first]
    return reading.groups[heads]


def _streams(topic: Topic, reading: _Open, left_out: list[str]) -> list[Stream]:
    """Return streams of one topic, the longest first."""
    groups = [(heads, samples) for heads, (samples, order) in reading.groups.items() if order is None]
    groups.sort(key=lambda group: -len(group[1].recorded))
    streams: list[Stream] = []
    taken: set[str] = set()
    for heads, samples in groups:
        if shared := taken & set(heads):
            n = counted(len(samples.recorded), "message")
            left_out.append(f"topic {topic.name}: {n} with other columns {listed(heads)}, which share {min(shared)!r}")
            continue
        taken |= set(heads)
        streams.append(stream_of(topic.name, heads, samples, reading.stamp is not None))
    return streams


def stream_of(name: str, heads: Heads, samples: Samples, has_header: bool = True) -> Stream:
    """Return the collected samples as arrays."""
    values = np.frombuffer(samples.values, np.float64).reshape(-1, len(heads))
    stamped = np.frombuffer(samples.stamped, np.int64) if has_header else None
    return Stream(name, heads, values, np.frombuffer(samples.recorded, np.int64), stamped)


def rotations_in(heads: Heads) -> list[int]:
    """Return the first of the four columns of every quaternion."""
    ends = ("orientation.x", "orientation.y", "orientation.z", "orientation.w")
    starts = range(len(heads) - 3)
    return [k for k in starts if all(heads[k + i].endswith(end) for i, end in enumerate(ends))]


def with_rotations(
    stream: Stream, where: str, skip: str, left_out: list[str], columns: Sequence[Column] | None = None
) -> Stream:
    """Return the stream without quaternions that are none.

    Those that are zero in every sample were never set: their columns are left out, and so are those that `columns`, if
    given, does not ask for. Others cost their sample or, where `skip` is ``"movement"``, the movement.
    """
    if unset := [k for k in rotations_in(stream.heads) if not stream.values[:, k : k + 4].any()]:
        names = ", ".join(head for k in unset for head in stream.heads[k : k + 4])
        left_out.append(f"{where}{names}, which are 0 in every message")
        stream = _without(stream, unset)
    wrong = [k for k in rotations_in(stream.heads) if not are_rotations(stream.values[:, k : k + 4]).all()]
    stream = _without(stream, [k for k in wrong if not _is_chosen(stream, range(k, k + 4), columns)])
    rotations = [stream.values[:, k : k + 4] for k in rotations_in(stream.heads)]
    good = np.all([are_rotations(q) for q in rotations] or [np.ones(len(stream.values), dtype=bool)], axis=0)
    if good.all():
        return stream
    bad = np.flatnonzero(~good)
    norms = [float(np.linalg.norm(q[bad[0]])) for q in rotations]
    reason = (
        f"{where}expected orientations of norm 1, got the norm {max(norms, key=lambda norm: abs(norm - 1)):.3g} in "
        f"message {bad[0]}{f'; {len(bad) - 1} more like this' if len(bad) > 1 else ''}"
    )
    if skip == "movement" or len(bad) == len(good):
        raise DataError(reason + (_TO_KEEP if len(bad) < len(good) else ""))
    left_out.append(reason)
    return stream.at(good)


def _without(stream: Stream, rotations: Sequence[int]) -> Stream:
    if not rotations:
        return stream
    dropped = {k + i for k in rotations for i in range(4)}
    columns = [k for k in range(len(stream.heads)) if k not in dropped]
    return replace(stream, heads=tuple(stream.heads[k] for k in columns), values=stream.values[:, columns])


def _is_chosen(stream: Stream, numbers: Iterable[int], columns: Sequence[Column] | None) -> bool:
    """Tell whether one of the columns is asked for: by its number, its name, the beginning of it, or a pattern."""
    if columns is None or any(not isinstance(column, str) or column.isdecimal() for column in columns):
        return True
    names = [name for k in numbers for name in (stream.heads[k], f"{stream.name}.{stream.heads[k]}")]
    return any(fnmatchcase(name, str(column)) or name.startswith(f"{column}.") for name in names for column in columns)


def clock_of(streams: Sequence[Stream]) -> tuple[bool, str]:
    """Tell whether the stamps in the headers are the time, as they increase everywhere, and else why they are not."""
    for stream in streams:
        if stream.stamped is None:
            return False, stream.why or f"{stream.name} has no stamps in headers"
        if not stream.stamped.any():
            return False, f"the stamps in the headers of {stream.name} are 0"
        steps = np.diff(stream.stamped)
        if len(steps) and steps.min() <= 0:
            k = int(np.argmax(steps <= 0)) + 1
            what = "repeats the one" if steps[k - 1] == 0 else "is earlier than that"
            return False, f"the stamp in the header of message {k} of {stream.name} {what} before"
    return True, ""


def stamps_of(stream: Stream, of_headers: bool) -> Stamps:
    """Return the stamps of one clock [ns]."""
    if not of_headers:
        return stream.recorded
    assert stream.stamped is not None
    return stream.stamped


def merge_streams(streams: Sequence[Stream], of_headers: bool, kinds: Given) -> tuple[Stream, list[str]]:
    """Return one stream with the columns of all, at the stamps of the first while others last; and what is left out.

    `kinds` are those that are given for columns, by their heads in the result.
    """
    first = streams[0]
    if len(streams) == 1:
        return first, []
    at = stamps_of(first, of_headers)
    others = [(stream, in_order(stream, of_headers)) for stream in streams[1:]]
    inside = np.ones(len(at), dtype=bool)
    for _, (stamps, _) in others:
        inside &= (at >= stamps[0]) & (at <= stamps[-1])
    heads = _heads(streams)
    several = {name for name, n in Counter(stream.name for stream in streams).items() if n > 1}
    called = [f"{each.name} ({first_names(each.heads, 3)})" if each.name in several else each.name for each in streams]
    names = ", ".join(called[1:])
    if not inside.any():
        spans = ((name, stamps_of(stream, of_headers)) for name, stream in zip(called, streams, strict=True))
        times = [f"{name} from {x.min() / SECOND:.12g} to {x.max() / SECOND:.12g} s" for name, x in spans]
        raise DataError(
            f"expected samples of {called[0]} and of {names} at the same time, got none: {', '.join(times)}"
            + ("; if their headers are of two clocks, say time='recorded', in the shell --time recorded" * of_headers)
        )
    start = int(at[inside][0])
    seconds = (at[inside] - start) / SECOND
    values = [first.values[inside]]
    for stream, (stamps, x) in others:
        k = sum(part.shape[1] for part in values)
        own = heads[k : k + len(stream.heads)]
        complete = x[np.isfinite(x).all(axis=1)]
        ends = np.array([0, len(complete)])
        channels = find_channels(own, complete, ends, kinds_of(kinds, own), has_others=True) if len(complete) else ()
        values.append(values_at(seconds, (stamps - start) / SECOND, x, own, channels))
    merged = replace(first.at(inside), heads=heads, values=np.hstack(values))
    n_lost = int(len(at) - inside.sum())
    lost = f"{counted(n_lost, 'sample')} of {called[0]} before {names} begins or after it ends"
    return merged, [lost] if n_lost else []


def values_at(at: Array, times: Array, values: Array, heads: Sequence[str], channels: Channels) -> Array:
    """Return samples at other times: linearly, angles without their wraps, rotations on the sphere, steps as they were.

    Columns of no channel are taken for positions.
    """
    result = np.column_stack([np.interp(at, times, column) for column in values.T])
    number = {head: k for k, head in enumerate(heads)}
    for channel in channels:
        k = [number[head] for head in channel.columns]
        if channel.kind == "orientation":
            result[:, k] = interpolated(at, times, values[:, k])  # on great circles, whatever the order
        elif channel.kind == "discrete":
            result[:, k] = values[np.searchsorted(times, at, side="right") - 1][:, k]
        elif channel.kind == "angle":
            angles, known = values[:, k[0]].copy(), np.isfinite(values[:, k[0]])
            period, ends = period_of_channel(channel, angles[known]), np.array([0, np.count_nonzero(known)])
            angles[known] = without_wraps(angles[known], ends, period)
            result[:, k[0]] = np.interp(at, times, angles)
    return result


def in_order(stream: Stream, of_headers: bool) -> tuple[Stamps, Array]:
    """Return stamps that increase strictly, and the samples."""
    ticks = stamps_of(stream, of_headers)
    if (np.diff(ticks) > 0).all():
        return ticks, stream.values
    stamps, where = np.unique(ticks, return_index=True)
    return stamps, stream.values[where]


def _heads(streams: Sequence[Stream]) -> tuple[str, ...]:
    twice = {head for head, n in Counter(head for stream in streams for head in stream.heads).items() if n > 1}
    return tuple(
        f"{stream.name}.{head}" if twice & set(stream.heads) else head for stream in streams for head in stream.heads
    )


# Unit quaternions in rows as ROS orders them, (x, y, z, w); `kineme.movements.rotations` has w first.


def are_rotations(q: Array) -> NDArray[np.bool_]:
    """Tell whether each quaternion (n, 4), of any order, has the norm 1, up to `TOLERANCE`, shape (n,)."""
    return np.asarray(np.abs(np.linalg.norm(q, axis=1) - 1.0) <= TOLERANCE)


def from_ros(q: Array) -> Array:
    """Return quaternions (n, 4) with w last as ones of norm 1 with w first."""
    return np.asarray(np.roll(q, 1, axis=1) / np.linalg.norm(q, axis=1, keepdims=True))


def to_ros(q: Array) -> Array:
    """Return quaternions (n, 4) with w first as ones of norm 1 with w last."""
    return np.asarray(np.roll(q, -1, axis=1) / np.linalg.norm(q, axis=1, keepdims=True))


def interpolated(at: Array, times: Array, q: Array) -> Array:
    """Turn rows of q (n, 4) at times (n,) into rotations (m, 4) at others, by spherical linear interpolation."""
    rotations = continuous(from_ros(q))
    if len(times) == 1:
        return np.repeat(to_ros(rotations), len(at), axis=0)
    k = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    share = np.clip((at - times[k]) / (times[k + 1] - times[k]), 0.0, 1.0)
    return to_ros(slerp(rotations[k], rotations[k + 1], share))
