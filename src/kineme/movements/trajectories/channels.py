"""Recorded columns become the positions that are learned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kineme.errors import TrajectoryError
from kineme.movements.channels.channel import Channels, is_plain, learned_names
from kineme.movements.channels.coordinates import canonical, learned, off_norm
from kineme.movements.trajectories.movements import Movements
from kineme.validation import describe


def of_channels(recorded: Movements, channels: Channels) -> Movements:
    """Movements whose positions are the recorded columns, as movements of these channels.

    Raises
    ------
    TrajectoryError
        A quaternion that is not of norm 1; the message names the movement and the sample.
    """
    for channel, rows, norms in off_norm(recorded.positions, channels):
        raise TrajectoryError(
            f"{_place(recorded, int(rows[0]))}: expected unit quaternions in {', '.join(channel.columns)}, got norm "
            f"{norms[rows[0]]:.6g}; check the order of the columns, or divide the quaternions by their norms"
        )
    columns = canonical(recorded.positions, recorded.offsets, channels)
    plain = is_plain(channels)
    return replace(
        recorded,
        positions=columns if plain else learned(columns, recorded.offsets, channels),
        recorded=None if plain else columns,
        dimensions=learned_names(channels),
        channels=channels,
    )


def in_coordinates(movements: Movements) -> Movements:
    """Movements as they are learned; generated ones have their recorded columns as positions until then."""
    channels = movements.channels
    if channels is None or movements.positions.shape[1] == len(learned_names(channels)):
        return movements
    return of_channels(replace(movements, recorded=None), channels)


def _place(movements: Movements, row: int) -> str:
    """The movement and the sample of a row."""
    i = int(np.searchsorted(movements.offsets, row, side="right")) - 1
    return f"{describe(i, movements.names)}: sample {row - movements.offsets[i]}"
