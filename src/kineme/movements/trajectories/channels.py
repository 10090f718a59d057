"""Recorded columns become the positions that are learned."""

from __future__ import annotations

from dataclasses import replace

from kineme.movements.channels.channel import Channels, is_plain, learned_names
from kineme.movements.channels.coordinates import canonical, learned
from kineme.movements.trajectories.movements import Movements


def of_channels(recorded: Movements, channels: Channels) -> Movements:
    """Movements whose positions are the recorded columns, as movements of these channels."""
    columns = canonical(recorded.positions, recorded.offsets, channels)
    plain = is_plain(channels)
    return replace(
        recorded,
        positions=columns if plain else learned(columns, recorded.offsets, channels),
        recorded=None if plain else columns,
        dimensions=learned_names(channels),
        channels=channels,
    )
