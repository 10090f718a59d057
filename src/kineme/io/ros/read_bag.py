"""Read the movements of a bag: one of what is streamed, or one for each message that holds a whole movement."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kineme.errors import DataError
from kineme.io.limits import check_expanded
from kineme.io.ros import streams as bag_streams
from kineme.io.ros.bags import Bag, Topic, logs_beside, messages_of, open_bag
from kineme.io.ros.choose import Edge, Step, chain, choose, connected_graph, edge_of, transforms_in
from kineme.io.ros.number_fields import POSE, TYPES, Heads, decoder_of, nanoseconds_of, transform_row
from kineme.movements.channels.channel import Channel
from kineme.movements.rotations import conjugate, continuous, product, rotated
from kineme.movements.tables.columns import Roles, column_numbers, is_no_coordinate
from kineme.movements.tables.layout import AS_KNOWN, Layout, Parsed, listed, no_lines
from kineme.movements.tables.table import Table, table_movements
from kineme.reporting.text import counted
from kineme.validation import MIN_SAMPLES, Array

_COPIES = 3

_CHECKED = 2**14

#: The channel of `POSE` that is not interpolated linearly.
_TURNED = (Channel("orientation", "orientation", POSE[3:], None, "xyzw"),)

_CLOCKS = ("header.stamp", "recorded")  # columns of the time stamps


def read_bag(path: Path, layout: Layout) -> Parsed:
    """Read what `layout` asks for of a bag of ROS 1 or ROS 2."""
    with open_bag(path) as bag:
        choice = choose(bag, layout)
        paths = [topic for topic in choice.topics if topic.type in TYPES and TYPES[topic.type].path]
        if not paths:
            streams: list[bag_streams.Stream] = []
            left_out: list[str] = []
            if choice.frames:
                streams, left_out = read_transforms(bag, choice.transforms, choice.frames, layout.skip)
            if choice.topics:
                others, lost = bag_streams.read_streams(bag, choice.topics, layout.skip, layout.coordinates)
                streams, left_out = [*streams, *others], [*left_out, *lost]
            of_headers, reason = bag_streams.clock_of(streams)
            if str(layout.time) in _CLOCKS:
                of_headers = layout.time == _CLOCKS[0]
            merged, lost = bag_streams.merge_streams(streams, of_headers, layout.kinds or {})
            stamps = [merged.recorded if merged.stamped is None else merged.stamped, merged.recorded]
            columns = [*(each / bag_streams.SECOND for each in stamps), *merged.values.T]
            what = [f"frames {parent}:{child}" for parent, child in choice.frames]
            what += [f"topic {topic.name} of {topic.type}" for topic in choice.topics]
            said_what = ", ".join(what) + (AS_KNOWN if choice.as_known else "")
            heads = (*_CLOCKS, *merged.heads)
            of_joints = any(topic.type.endswith("/JointState") for topic in choice.topics)
            roles = _roles(heads, 0 if of_headers else 1, layout, of_joints)
            table = Table(heads, columns, len(merged.values), no_lines, dates_in="s")
            said = "stamps of headers" if of_headers else f"time of recording: {reason}" if reason else "as asked for"
            parsed = _parsed(table, roles, layout, (bag.kind, said_what, said), [*left_out, *lost])
            return parsed._replace(left_out=(*parsed.left_out, *logs_beside(path)))
        if len(choice.topics) > 1 or choice.frames:
            raise DataError(
                f"topic {paths[0].name}: each of its messages is a movement of its own, expected it alone, got other "
                "topics or frames beside it"
            )
        return _movements_of_messages(bag, paths[0], layout)


def _roles(heads: tuple[str, ...], time: int, layout: Layout, of_joints: bool = True) -> Roles:
    """Take as coordinates all columns but stamps, covariances, numbers of things (not of joints); or those chosen."""
    aside = {k for k, head in enumerate(heads) if "covariance" in head or (not of_joints and is_no_coordinate(head))}
    measured = tuple(k for k in range(2, len(heads)) if k not in aside)
    positions = measured or tuple(range(2, len(heads)))
    if layout.time is not None:
        time = column_numbers(heads, [layout.time])[0]
    if layout.coordinates is not None:
        positions = column_numbers(heads, layout.coordinates)
    if layout.keys is not None or layout.label is not None:
        raise DataError("expected movements that are told apart by messages, got a column for that, or for labels")
    used = {0, 1, *positions}  # stamps are not left aside: they are of two clocks, and one is chosen
    return Roles(time, positions, (), None, tuple(k for k in range(len(heads)) if k not in used))


def _parsed(table: Table, roles: Roles, layout: Layout, about: tuple[str, str, str], left_out: list[str]) -> Parsed:
    kind, what, clock = about
    parsed = table_movements(table, roles, layout, kind)
    return Parsed(parsed.detected._replace(layout=what, units_from=clock), parsed.block, tuple(left_out))


def read_transforms(
    bag: Bag, topics: Sequence[Topic], wanted: Sequence[Edge], skip: str
) -> tuple[list[bag_streams.Stream], list[str]]:
    """Read the pose of each child frame in its parent frame, and what was left out."""
    if not topics:
        raise DataError("expected a topic of transforms, such as /tf, got none")
    graph = connected_graph(bag, topics, wanted)
    steps = [chain(graph, *pair) for pair in wanted]
    bad: list[str] = []
    needed = {step.edge for way in steps for step in way}
    try:
        samples_of_edges, parents = _collect(bag, topics, needed, bad)
    except DataError as error:
        raise DataError(f"{', '.join(f'topic {topic.name}' for topic in topics)}: {error}") from error
    left_out = [f"{bad[0]}{f'; {len(bad) - 1} more like this' if len(bad) > 1 else ''}"] if bad else []
    if bad and skip == "movement":
        raise DataError(f"{left_out[0]}; to keep the others, say skip='sample', in the shell --skip sample")
    edges = {edge: _usable(edge, samples, left_out) for edge, samples in samples_of_edges.items()}
    for child, counts in parents.items():
        own = next(edge[0] for edge in needed if edge[1] == child)
        for parent in sorted(set(counts) - {own}):
            left_out.append(f"frame {child!r}: {counted(counts[parent], 'transform')} from another parent, {parent!r}")
    pairs = zip(wanted, steps, strict=True)
    return [_composed(f"{parent}:{child}", way, edges, left_out) for (parent, child), way in pairs], left_out


def _collect(
    bag: Bag, topics: Sequence[Topic], needed: set[Edge], bad: list[str]
) -> tuple[dict[Edge, bag_streams.Samples], dict[str, Counter[str]]]:
    """Return the needed transforms, and for their children how often each parent occurs."""
    samples_of_edges = {edge: bag_streams.Samples.empty() for edge in needed}
    children = {child for _, child in needed}
    counts: Counter[Edge] = Counter()  # by names as they are in messages, of which there are few
    samples_of: dict[Edge, bag_streams.Samples | None] = {}
    for n, (_, recorded, transform) in enumerate(transforms_in(bag, topics, bad)):
        header = transform.header
        names = header.frame_id, transform.child_frame_id
        counts[names] += 1
        if names not in samples_of:
            samples_of[names] = samples_of_edges.get(edge_of(transform))
        if (samples := samples_of[names]) is not None:
            samples.values.extend(transform_row(transform.transform))
            samples.recorded.append(recorded)
            samples.stamped.append(nanoseconds_of(header.stamp))
        if not n % _CHECKED:
            bag_streams.check_samples(list(samples_of_edges.values()))
    parents: dict[str, Counter[str]] = {child: Counter() for child in children}
    for names, n in counts.items():
        parent, child = (name.removeprefix("/") for name in names)
        if child in children:
            parents[child][parent] += n
    return samples_of_edges, parents


def _usable(edge: Edge, samples: bag_streams.Samples, left_out: list[str]) -> bag_streams.Stream:
    """Take the transforms of an edge with valid rotations, each once: some nodes publish the last one again."""
    where = f"transform {edge[0]}:{edge[1]}"
    stream = bag_streams.stream_of(where, POSE, samples)
    assert stream.stamped is not None
    good = bag_streams.are_rotations(stream.values[:, 3:]) & np.isfinite(stream.values).all(axis=1)
    if n_bad := int((~good).sum()):
        first = int(np.argmin(good))
        norm = float(np.linalg.norm(stream.values[first, 3:]))
        left_out.append(f"{where}: expected rotations of norm 1, got {norm:.3g} in {counted(n_bad, 'transform')}")
        if not good.any():
            raise DataError(left_out[-1])
    rows = np.flatnonzero(good)
    return stream.at(rows[np.diff(stream.stamped[rows], prepend=stream.stamped[rows[0]] - 1) != 0])


def _composed(
    name: str, way: Sequence[Step], edges: dict[Edge, bag_streams.Stream], left_out: list[str]
) -> bag_streams.Stream:
    moving = [edges[step.edge] for step in way if not _is_fixed(edges[step.edge])]
    if not moving:
        raise DataError(f"frames {name}: expected a frame that moves in the other, got transforms that never change")
    of_headers, reason = bag_streams.clock_of(moving)
    # The stamps of the transform that has most of them, within the time in which all others are known too.
    stamps = [np.unique(bag_streams.stamps_of(stream, of_headers)) for stream in moving]
    first, last = max(stamps_of_one[0] for stamps_of_one in stamps), min(times[-1] for times in stamps)
    inside = [times[(times >= first) & (times <= last)] for times in stamps]
    k = max(range(len(inside)), key=lambda i: len(inside[i]))
    most = inside[k]
    if len(most) < MIN_SAMPLES:
        raise DataError(
            f"frames {name}: expected transforms that are known at the same time, at least {MIN_SAMPLES} times, got "
            f"{len(most)}, of {', '.join(stream.name for stream in moving)}"
        )
    if n_lost := len(stamps[k]) - len(most):
        left_out.append(f"frames {name}: {counted(n_lost, 'stamp')} of {moving[k].name}, at which others are not known")
    start = int(most[0])
    seconds = (most - start) / bag_streams.SECOND
    p, q = np.zeros((len(most), 3)), np.tile([1.0, 0.0, 0.0, 0.0], (len(most), 1))
    for step in way:
        # The pose (p, q) followed by transforms (n, 7), or by their inverses.
        transform = _at(seconds, start, edges[step.edge], of_headers)
        x, r = transform[:, :3], bag_streams.from_ros(transform[:, 3:])
        if not step.forward:
            r = conjugate(r)
            x = -rotated(r, x)
        p, q = p + rotated(q, x), product(q, r)
    return bag_streams.Stream(
        name, POSE, np.hstack((p, bag_streams.to_ros(continuous(q)))), most, most if of_headers else None, reason
    )


def _is_fixed(stream: bag_streams.Stream) -> bool:
    return bool((stream.values == stream.values[0]).all())


def _at(seconds: Array, start: int, stream: bag_streams.Stream, of_headers: bool) -> Array:
    if _is_fixed(stream):
        return np.repeat(stream.values[:1], len(seconds), axis=0)
    stamps, values = bag_streams.in_order(stream, of_headers)
    return bag_streams.values_at(seconds, (stamps - start) / bag_streams.SECOND, values, POSE, _TURNED)


class _Group(NamedTuple):
    values: array[float]
    stamps: array[int]
    lengths: list[int]
    places: list[int]


def _movements_of_messages(bag: Bag, topic: Topic, layout: Layout) -> Parsed:
    """Return the movements of a topic, one a message. Of those with different columns, the most frequent are read."""
    groups: dict[Heads, _Group] = {}
    left_out: list[str] = []
    _collect_path(bag, topic, groups, left_out)
    if not groups:
        reason = f": {left_out[0]}" if left_out else ", got messages without points"
        raise DataError(f"topic {topic.name}: expected movements of {topic.type}{reason}")
    heads, (numbers, ticks, lengths, places) = max(groups.items(), key=lambda group: len(group[1].lengths))
    for other, group in groups.items():
        if other != heads:
            n = counted(len(group.lengths), "message")
            left_out.append(f"topic {topic.name}: {n} with other columns {listed(other)}")
    values = np.frombuffer(numbers, np.float64).reshape(-1, len(heads))
    stamps = np.frombuffer(ticks, np.int64)
    where = f"topic {topic.name}: "
    stream = bag_streams.with_rotations(
        bag_streams.Stream(topic.name, heads, values, stamps, None), where, layout.skip, left_out
    )
    if len(stream.values) < len(values):
        raise DataError(left_out[-1])
    is_planned = topic.type.endswith("JointTrajectory")
    inner = np.ones(max(len(stamps) - 1, 0), dtype=bool)  # steps within a movement
    inner[np.cumsum(lengths)[:-1] - 1] = False
    timed = is_planned or bool((np.diff(stamps)[inner] > 0).all())
    names = np.empty(len(stamps), dtype=object)
    names[:] = np.repeat([str(place) for place in places], lengths)
    columns = ("time_from_start" if is_planned else "header.stamp", "message", *stream.heads)
    times = stamps / bag_streams.SECOND if timed else np.zeros(len(stamps))
    table = Table(columns, [times, names, *stream.values.T], len(names), no_lines, dates_in="s")
    roles = _roles(columns, 0, layout)._replace(movement=(1,))
    about = (bag.kind, f"topic {topic.name} of {topic.type}, a movement a message", "stamps of its points")
    parsed = _parsed(table, roles, layout, about, left_out)
    if timed:
        return parsed
    detected = parsed.detected._replace(time=None, units_from="no times: one second each")
    return parsed._replace(detected=detected, block=replace(parsed.block, times=None))


def _collect_path(bag: Bag, topic: Topic, groups: dict[Heads, _Group], left_out: list[str]) -> None:
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
