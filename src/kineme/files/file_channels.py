"""The channels that files share, and movements whose orientations are none."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from kineme.errors import TrajectoryError
from kineme.files.check_block import movement_of, take_movements
from kineme.files.problem import Problem
from kineme.files.read_file import FileRead
from kineme.movements.channels.channel import Channels, is_plain
from kineme.movements.channels.coordinates import off_norm
from kineme.movements.channels.detect import Given, find_channels
from kineme.movements.tables.parsed import Block

_HINT = "check the order of the columns, or divide the quaternions by their norms"


def with_channels(files: Sequence[FileRead], given: Given) -> tuple[list[FileRead], Channels | None, list[Problem]]:
    """The channels of files with equally many columns, the files that have them, and problems.

    Kinds are found for all files together: a gripper that no file opens is one still. Files of other heads are merged
    by the order of their columns while all are positions or angles, and then nothing is known of the channels; else
    they are problems.

    Raises
    ------
    SpecificationError
        See `find_channels`.
    """
    heads = Counter(one.detected.columns for one in files if one.detected).most_common(1)[0][0]
    same = [one for one in files if one.detected and one.detected.columns == heads]
    blocks = [_block(one) for one in same]
    channels = find_channels(
        heads,
        np.concatenate([block.positions for block in blocks]) if len(blocks) > 1 else blocks[0].positions,
        np.concatenate(([0], np.cumsum(np.concatenate([np.diff(block.offsets) for block in blocks])))),
        given,
        next(one.detected.measured_in for one in same if one.detected),
    )
    if len(same) < len(files) and is_plain(channels):
        return list(files), None, []
    problems = [
        Problem(one.path, None, f"the columns {list(one.detected.columns)} where most files have {list(heads)}")
        for one in files
        if one.detected and one.detected.columns != heads
    ]
    checked = [_check_orientations(one, channels) for one in same]
    return [one for one, _ in checked], channels, [*problems, *(one for _, several in checked for one in several)]


def _check_orientations(one: FileRead, channels: Channels) -> tuple[FileRead, list[Problem]]:
    """A file without the movements in which a quaternion is not of norm 1."""
    block, problems = _block(one), []
    good = np.ones(len(block.labels), dtype=bool)
    for channel, odd, norms in off_norm(block.positions, channels):
        owners, firsts = np.unique(np.searchsorted(block.offsets, odd, side="right") - 1, return_index=True)
        for i, k in zip(owners.tolist(), odd[firsts].tolist(), strict=True):
            reason = (
                f"{movement_of(block, i)}expected unit quaternions in {', '.join(channel.columns)}, got norm "
                f"{norms[k]:.6g} at sample {k - block.offsets[i]}; {_HINT}"
            )
            problems.append(Problem(one.path, block.line_of(block.row(k)), reason, TrajectoryError))
        good[owners] = False
    return one._replace(block=take_movements(block, good)), problems


def _block(one: FileRead) -> Block:
    assert one.block is not None
    return one.block
