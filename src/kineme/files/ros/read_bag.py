"""Read the movements of a bag: one of what is streamed, or one for each message that holds a whole movement."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kineme.errors import DataError
from kineme.files.ros.bags import Bag, open_bag
from kineme.files.ros.choose import Choice, choose
from kineme.files.ros.compose import read_transforms
from kineme.files.ros.databases import logs_beside
from kineme.files.ros.merge_streams import SECOND, clock_of, merge_streams
from kineme.files.ros.message_types import TYPES
from kineme.files.ros.paths import Paths, read_paths
from kineme.files.ros.streams import Stream, read_streams
from kineme.movements.tables.columns import Roles, column_numbers, is_no_coordinate
from kineme.movements.tables.layout import AS_KNOWN, Layout
from kineme.movements.tables.parsed import Parsed, no_lines
from kineme.movements.tables.table import Table, table_movements

_CLOCKS = ("header.stamp", "recorded")  # columns of the time stamps


def read_bag(path: Path, layout: Layout) -> Parsed:
    """Read what `layout` asks for of a bag of ROS 1 or ROS 2.

    Raises
    ------
    DataError
        No bag, damaged, or nothing that can be read without being asked for; the message names topics or frames.
    """
    with open_bag(path) as bag:
        choice = choose(bag, layout)
        paths = [one for one in choice.topics if one.type in TYPES and TYPES[one.type].path]
        if not paths:
            parsed = _streamed(bag, choice, layout)
            return parsed._replace(left_out=(*parsed.left_out, *logs_beside(path)))
        if len(choice.topics) > 1 or choice.frames:
            raise DataError(
                f"topic {paths[0].name}: each of its messages is a movement of its own, expected it alone, got other "
                "topics or frames beside it"
            )
        return _whole(bag, read_paths(bag, paths[0], layout.skip), layout)


def _streamed(bag: Bag, choice: Choice, layout: Layout) -> Parsed:
    streams: list[Stream] = []
    left_out: list[str] = []
    if choice.frames:
        streams, left_out = read_transforms(bag, choice.transforms, choice.frames, layout.skip)
    if choice.topics:
        others, lost = read_streams(bag, choice.topics, layout.skip, layout.coordinates)
        streams, left_out = [*streams, *others], [*left_out, *lost]
    of_headers, reason = clock_of(streams)
    if str(layout.time) in _CLOCKS:
        of_headers = layout.time == _CLOCKS[0]
    one, lost = merge_streams(streams, of_headers)
    stamps = [one.recorded if one.stamped is None else one.stamped, one.recorded]
    columns = [*(each / SECOND for each in stamps), *one.values.T]
    what = [f"frames {parent}:{child}" for parent, child in choice.frames]
    what += [f"topic {topic.name} of {topic.type}" for topic in choice.topics]
    said_what = ", ".join(what) + (AS_KNOWN if choice.as_known else "")
    heads = (*_CLOCKS, *one.heads)
    of_joints = any(topic.type.endswith("/JointState") for topic in choice.topics)
    roles = _roles(heads, 0 if of_headers else 1, layout, of_joints)
    table = Table(heads, columns, len(one.values), no_lines, dates_in="s")
    said = "stamps of headers" if of_headers else f"time of recording: {reason}" if reason else "as asked for"
    return _parsed(table, roles, layout, (bag.kind, said_what, said), [*left_out, *lost])


def _whole(bag: Bag, paths: Paths, layout: Layout) -> Parsed:
    numbers = np.repeat(np.arange(len(paths.lengths)), paths.lengths)
    names = np.empty(len(numbers), dtype=object)
    names[:] = [str(paths.places[k]) for k in numbers]
    times: Any = np.zeros(len(numbers)) if paths.times is None else paths.times
    heads = (paths.time, "message", *paths.heads)
    table = Table(heads, [times, names, *paths.values.T], len(numbers), no_lines, dates_in="s")
    chosen = _roles(heads, 0, layout)
    roles = chosen._replace(movement=(1,))
    about = (bag.kind, f"topic {paths.topic.name} of {paths.topic.type}, a movement a message", "stamps of its points")
    parsed = _parsed(table, roles, layout, about, paths.left_out)
    if paths.times is not None:
        return parsed
    detected = parsed.detected._replace(time=None, units_from="no times: one second each")
    return parsed._replace(detected=detected, block=replace(parsed.block, times=None))


def _roles(heads: tuple[str, ...], time: int, layout: Layout, of_joints: bool = True) -> Roles:
    """All columns but stamps, numbers of things, and covariances are coordinates, or those chosen.

    The names of joints are any words.
    """
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
