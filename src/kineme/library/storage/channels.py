"""The channels of a library's movements as text, and their columns that positions do not say as bytes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.library.storage.rows import Row, strange
from kineme.movements.channels.channel import Channels, channels_from_data, channels_to_data, is_plain, learned_names
from kineme.movements.channels.coordinates import canonical, columns_of_kinds
from kineme.movements.trajectories.movements import Movements
from kineme.validation import Array


def channels_to_text(channels: Channels) -> str:
    """Return JSON: a list of objects with the fields of `Channel`."""
    return json.dumps(channels_to_data(channels), ensure_ascii=True)


def channels_of_text(text: str, n_dims: int, path: Path) -> Channels:
    """Return the inverse, for the library at `path`; refused unless it is channels of so many dimensions."""
    try:
        return channels_from_data(json.loads(text), n_dims)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise DataError(
            f"expected {path} to say what the {n_dims} dimensions of its movements were recorded as, got "
            f"{text[:40]!r}; take the file from a backup or an export that you trust"
        ) from error


def other_columns(channels: Channels) -> list[int]:
    """Return the columns that are stored beside the positions."""
    return columns_of_kinds(channels, "orientation", "discrete")


def to_bytes(recorded: Array, offsets: NDArray[np.intp], channels: Channels) -> list[bytes]:
    """Return the other columns of each movement in single precision."""
    others = recorded[:, other_columns(channels)].astype(np.float32)
    row, blob, ends = others.shape[1] * others.itemsize, others.tobytes(), offsets.tolist()
    return [blob[row * first : row * stop] for first, stop in pairwise(ends)]


def with_channels(stored: Movements, channels: Channels, rows: Sequence[Row]) -> Movements:
    """Return stored movements with their channels; rows of the table "recorded" for those that positions do not say."""
    movements = replace(stored, channels=channels, dimensions=learned_names(channels))
    if is_plain(channels):
        return movements
    size = 4 * len(other_columns(channels))
    for row, n in zip(rows, np.diff(stored.offsets).tolist(), strict=True):
        if len(row[1]) != size * n:
            raise strange("recorded", row)
    others = other_columns(channels)
    recorded = np.empty((len(stored.positions), sum(len(channel.columns) for channel in channels)))
    recorded[:, others] = np.frombuffer(b"".join([row[1] for row in rows]), np.float32).reshape(-1, len(others))
    for k in columns_of_kinds(channels, "discrete"):
        # The shortest decimals that round to the stored single precision: 0.08, and not 0.0799999982.
        starts = np.flatnonzero(np.diff(recorded[:, k], prepend=np.nan))  # of the stretches in which a value holds
        values, which = np.unique(recorded[starts, k].astype(np.float32), return_inverse=True)
        exact = np.array([float(str(value)) for value in values])[which]
        recorded[:, k] = np.repeat(exact, np.diff(starts, append=len(recorded)))
    learned = [channel.kind != "orientation" for channel in channels for _ in channel.coordinates]
    recorded[:, columns_of_kinds(channels, "position", "angle")] = stored.positions[:, learned]
    return replace(movements, recorded=canonical(recorded, stored.offsets, channels))
