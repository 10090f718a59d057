"""The channels that files share, and movements whose orientations are none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kineme.errors import TrajectoryError
from kineme.files.check_block import check_block, movement_of, take_movements
from kineme.files.column_order import in_one_set
from kineme.files.problem import Problem
from kineme.files.read_file import FileRead
from kineme.movements.channels.channel import Channels, is_plain, recorded_names
from kineme.movements.channels.coordinates import canonical, in_order, off_norm
from kineme.movements.channels.detect import Given, find_channels
from kineme.movements.tables.layout import Layout
from kineme.movements.tables.parsed import Block

_HINT = "check the order of the columns, or divide the quaternions by their norms"


def with_channels(
    files: Sequence[FileRead], given: Given, skip: str = "movement", by_number: bool = False
) -> tuple[list[FileRead], Channels | None, list[Problem]]:
    """The channels of files with equally many columns, the files that have them, and problems.

    Kinds are found for all files together: a gripper that no file opens is one still, and one that some file moves
    continuously is a position in all of them. Columns are put in order and converted by their names, see `in_one_set`.
    Files whose columns have no names, or are chosen `by_number`, are merged by the order of their columns while all
    are positions or angles, without the wraps of angles, and then nothing is known of the channels; else they are
    problems. A quaternion that is not of norm 1 costs its movement, or with `skip`
    ``"sample"`` that sample alone.

    Raises
    ------
    SpecificationError
        See `find_channels`.
    """
    same, nameless, problems = in_one_set(files, by_number)
    channels = _channels_of(same, given)
    if nameless and is_plain(channels):
        place = {one.path: k for k, one in enumerate(files)}
        return _without_wraps(sorted([*same, *nameless], key=lambda one: place[one.path]), given), None, problems
    heads = list(recorded_names(channels))
    problems += [
        Problem(one.path, None, f"no names of columns where most files have {heads}; name them as these are")
        for one in nameless
    ]
    checked = [_check_orientations(_in_order(one, channels), channels, skip) for one in same]
    return [one for one, _ in checked], channels, [*problems, *(one for _, several in checked for one in several)]


def _channels_of(files: Sequence[FileRead], given: Given) -> Channels:
    """The channels of files that all have the same heads."""
    blocks, detected = [_block(one) for one in files], files[0].detected
    assert detected is not None
    return find_channels(
        detected.columns,
        np.concatenate([block.positions for block in blocks]) if len(blocks) > 1 else blocks[0].positions,
        np.concatenate(([0], np.cumsum(np.concatenate([np.diff(block.offsets) for block in blocks])))),
        given,
        detected.measured_in,
    )


def _without_wraps(files: Sequence[FileRead], given: Given) -> list[FileRead]:
    """Files of several heads, in the columns of each the angles continuous."""
    groups: dict[tuple[str, ...], list[FileRead]] = {}
    for one in files:
        groups.setdefault(one.detected.columns if one.detected else (), []).append(one)
    known = {}
    for heads, group in groups.items():
        here = {
            key: kind
            for key, kind in given.items()
            if key in heads or {name.strip() for name in key.split(",")} <= {*heads}
        }
        known[heads] = _channels_of(group, here)
    result = []
    for one in files:
        block, channels = _block(one), known[one.detected.columns if one.detected else ()]
        if is_plain(channels):
            block = replace(block, positions=canonical(block.positions, block.offsets, channels))
        result.append(one._replace(block=block))
    return result


def _in_order(one: FileRead, channels: Channels) -> FileRead:
    """A file with the columns of each of its channels side by side."""
    block, heads = _block(one), one.detected.columns if one.detected else ()
    return one._replace(block=replace(block, positions=in_order(block.positions, heads, channels)))


def _check_orientations(one: FileRead, channels: Channels, skip: str) -> tuple[FileRead, list[Problem]]:
    """A file without the movements, or the samples alone, in which a quaternion is not of norm 1."""
    block, problems, faults = _block(one), [], dict[int, str]()
    good = np.ones(len(block.labels), dtype=bool)
    for channel, odd, norms in off_norm(block.positions, channels):
        owners = np.searchsorted(block.offsets, odd, side="right") - 1
        reasons = [
            f"expected unit quaternions in {', '.join(channel.columns)}, got norm {norms[k]:.6g} at sample "
            f"{k - block.offsets[i]}; {_HINT}"
            for i, k in zip(owners.tolist(), odd.tolist(), strict=True)
        ]
        faults |= dict(zip((block.row(k) for k in odd.tolist()), reasons, strict=True))
        for i, first in zip(*map(np.ndarray.tolist, np.unique(owners, return_index=True)), strict=True):
            line = block.line_of(block.row(int(odd[first])))
            problems.append(Problem(one.path, line, movement_of(block, i) + reasons[first], TrajectoryError))
        good[owners] = False
    if faults and skip == "sample":
        block, problems = check_block(replace(block, faults=faults), one.path, Layout(skip=skip), ())
        return one._replace(block=block), problems
    return one._replace(block=take_movements(block, good)), problems


def _block(one: FileRead) -> Block:
    assert one.block is not None
    return one.block
