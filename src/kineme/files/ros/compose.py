"""The pose of one frame in another over time, composed of the transforms between them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kineme.errors import DataError
from kineme.files.ros.bags import Bag, Topic
from kineme.files.ros.frames import Edge, Step, chain, connected_graph, edge_of, transforms_in
from kineme.files.ros.merge_streams import SECOND, clock_of, in_order, stamps_of, values_at
from kineme.files.ros.message_types import POSE, nanoseconds_of, transform_row
from kineme.files.ros.rotations import are_rotations, from_ros, to_ros
from kineme.files.ros.streams import Samples, Stamps, Stream, check_kept, stream_of
from kineme.movements.rotations.quaternions import conjugate, continuous, product, rotated
from kineme.output.text import counted
from kineme.validation import MIN_SAMPLES, Array

_CHECKED = 2**14


def read_transforms(
    bag: Bag, topics: Sequence[Topic], wanted: Sequence[Edge], skip: str
) -> tuple[list[Stream], list[str]]:
    """The pose of each child frame in its parent frame, and what was left out.

    Raises
    ------
    DataError
        A frame that is not there, no way between two frames, nothing that moves between them; or damage, where `skip`
        is ``"movement"``.
    """
    if not topics:
        raise DataError("expected a topic of transforms, such as /tf, got none")
    graph = connected_graph(bag, topics, wanted)
    steps = [chain(graph, *pair) for pair in wanted]
    bad: list[str] = []
    needed = {step.edge for way in steps for step in way}
    try:
        found, parents = _collect(bag, topics, needed, bad)
    except DataError as error:
        raise DataError(f"{', '.join(f'topic {one.name}' for one in topics)}: {error}") from error
    left_out = [f"{bad[0]}{f'; {len(bad) - 1} more like this' if len(bad) > 1 else ''}"] if bad else []
    if bad and skip == "movement":
        raise DataError(f"{left_out[0]}; to keep the others, say skip='sample', in the shell --skip sample")
    edges = {edge: _usable(edge, samples, left_out) for edge, samples in found.items()}
    for child, counts in parents.items():
        kept = next(edge[0] for edge in needed if edge[1] == child)
        for parent in sorted(set(counts) - {kept}):
            left_out.append(f"frame {child!r}: {counted(counts[parent], 'transform')} from another parent, {parent!r}")
    pairs = zip(wanted, steps, strict=True)
    return [_composed(f"{parent}:{child}", way, edges, left_out) for (parent, child), way in pairs], left_out


def _collect(
    bag: Bag, topics: Sequence[Topic], needed: set[Edge], bad: list[str]
) -> tuple[dict[Edge, Samples], dict[str, Counter[str]]]:
    """The needed transforms, and for their children how often each parent occurs."""
    found = {edge: Samples.empty() for edge in needed}
    children = {child for _, child in needed}
    counts: Counter[Edge] = Counter()  # by names as they are in messages, of which there are few
    samples_of: dict[Edge, Samples | None] = {}
    for n, (_, recorded, transform) in enumerate(transforms_in(bag, topics, bad)):
        header = transform.header
        names = header.frame_id, transform.child_frame_id
        counts[names] += 1
        if names not in samples_of:
            samples_of[names] = found.get(edge_of(transform))
        if (samples := samples_of[names]) is not None:
            samples.values.extend(transform_row(transform.transform))
            samples.recorded.append(recorded)
            samples.stamped.append(nanoseconds_of(header.stamp))
        if not n % _CHECKED:
            check_kept(list(found.values()))
    parents: dict[str, Counter[str]] = {child: Counter() for child in children}
    for names, n in counts.items():
        parent, child = (name.removeprefix("/") for name in names)
        if child in children:
            parents[child][parent] += n
    return found, parents


def _usable(edge: Edge, samples: Samples, left_out: list[str]) -> Stream:
    """The transforms of an edge whose rotations are rotations, each once: some nodes publish the last one again."""
    where = f"transform {edge[0]}:{edge[1]}"
    stream = stream_of(where, POSE, samples)
    assert stream.stamped is not None
    good = are_rotations(stream.values[:, 3:]) & np.isfinite(stream.values).all(axis=1)
    if n_bad := int((~good).sum()):
        first = int(np.argmin(good))
        norm = float(np.linalg.norm(stream.values[first, 3:]))
        left_out.append(f"{where}: expected rotations of norm 1, got {norm:.3g} in {counted(n_bad, 'transform')}")
        if not good.any():
            raise DataError(left_out[-1])
    kept = np.flatnonzero(good)
    kept = kept[np.diff(stream.stamped[kept], prepend=stream.stamped[kept[0]] - 1) != 0]
    if len(kept) == len(good):
        return stream
    return replace(stream, values=stream.values[kept], recorded=stream.recorded[kept], stamped=stream.stamped[kept])


def _composed(name: str, way: Sequence[Step], edges: dict[Edge, Stream], left_out: list[str]) -> Stream:
    moving = [edges[step.edge] for step in way if not _is_fixed(edges[step.edge])]
    if not moving:
        raise DataError(f"frames {name}: expected a frame that moves in the other, got transforms that never change")
    of_headers, reason = clock_of(moving)
    at = _common_stamps(name, moving, of_headers, left_out)
    start = int(at[0])
    seconds = (at - start) / SECOND
    p, q = np.zeros((len(at), 3)), np.tile([1.0, 0.0, 0.0, 0.0], (len(at), 1))
    for step in way:
        p, q = _then(p, q, _at(seconds, start, edges[step.edge], of_headers), step.forward)
    return Stream(name, POSE, np.hstack((p, to_ros(continuous(q)))), at, at if of_headers else None, reason)


def _is_fixed(stream: Stream) -> bool:
    return bool((stream.values == stream.values[0]).all())


def _common_stamps(name: str, moving: Sequence[Stream], of_headers: bool, left_out: list[str]) -> Stamps:
    """The stamps of the transform that has most of them, within the time in which all others are known too."""
    stamps = [np.unique(stamps_of(one, of_headers)) for one in moving]
    first, last = max(one[0] for one in stamps), min(one[-1] for one in stamps)
    inside = [one[(one >= first) & (one <= last)] for one in stamps]
    k = max(range(len(inside)), key=lambda i: len(inside[i]))
    most = inside[k]
    if len(most) < MIN_SAMPLES:
        raise DataError(
            f"frames {name}: expected transforms that are known at the same time, at least {MIN_SAMPLES} times, got "
            f"{len(most)}, of {', '.join(one.name for one in moving)}"
        )
    if n_lost := len(stamps[k]) - len(most):
        left_out.append(f"frames {name}: {counted(n_lost, 'stamp')} of {moving[k].name}, at which others are not known")
    return most


def _at(seconds: Array, start: int, stream: Stream, of_headers: bool) -> Array:
    """A transform at the common stamps, (n, 7)."""
    if _is_fixed(stream):
        return np.repeat(stream.values[:1], len(seconds), axis=0)
    stamps, values = in_order(stream, of_headers)
    return values_at(seconds, (stamps - start) / SECOND, stream, values)


def _then(p: Array, q: Array, transform: Array, forward: bool) -> tuple[Array, Array]:
    """The pose (p, q) followed by transforms (n, 7), or by their inverses."""
    x, r = transform[:, :3], from_ros(transform[:, 3:])
    if not forward:
        r = conjugate(r)
        x = -rotated(r, x)
    return p + rotated(q, x), product(q, r)
