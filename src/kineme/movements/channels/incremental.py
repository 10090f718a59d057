"""Recorded samples that come one after the other become the coordinates that are learned, as a whole recording does."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from kineme.movements.channels import coordinates
from kineme.movements.channels.channel import Channel, Channels, recorded_names
from kineme.validation import Array


class IncrementalCoordinates:
    """Coordinates of samples that come one by one, or some at a time; `canonical` and `learned` of all of them at once.

    However the samples are divided into calls, the coordinates are the same, to the last bit.
    """

    def __init__(self, channels: Channels) -> None:
        self._channels = channels
        self._n_columns = len(recorded_names(channels))
        self.clear()

    def clear(self) -> None:
        """Forget the samples; the next one begins a movement."""
        lever = coordinates.lever_of(self._channels)
        self._parts = [_part_of(channel, lever) for channel in self._channels]

    def usable(self, columns: Array) -> NDArray[np.bool_]:
        """Find the samples (k, m) that have quaternions of norm 1, (k,)."""
        good = np.ones(len(columns), dtype=bool)
        with np.errstate(over="ignore", invalid="ignore"):
            for _, rows, _ in coordinates.off_norm(columns, self._channels):
                good[rows] = False
        return good

    def take(self, columns: Array) -> Array:
        """The coordinates (k, d) of the next k recorded samples (k, m)."""
        parts = zip(self._parts, coordinates.columns_of(self._channels), strict=True)
        return np.concatenate([take(columns[:, rows]) for take, rows in parts], axis=1)


class _Angle:
    """The angle before, and the turns up to it."""

    def __init__(self, period: float) -> None:
        self._period = period
        self._before = np.empty((0, 1))
        self._turns = np.zeros((1, 1))

    def take(self, column: Array) -> Array:
        if not len(column):
            return column
        before = self._before if len(self._before) else column[:1]
        steps = np.diff(column, axis=0, prepend=before)
        turns = self._turns + np.cumsum(coordinates.turns_of(steps, self._period), axis=0)
        self._before, self._turns = column[-1:].copy(), turns[-1:]
        return np.asarray(column - self._period * turns)


class _Orientation:
    """The quaternion before, as it was recorded, and the rotation up to it."""

    def __init__(self, channel: Channel, lever: float) -> None:
        self._channel, self._lever = channel, lever
        self._before = np.empty((0, 4))
        self._turned = np.zeros((1, 3))

    def take(self, columns: Array) -> Array:
        if not len(columns):
            return np.empty((0, 3))
        block = np.concatenate((self._before, columns))  # steps are the same for either sign of its first
        steps = coordinates.rotation_steps(
            coordinates.as_wxyz(coordinates.continuous_signs(block, np.array([0, len(block)])), self._channel)
        )
        turned = np.cumsum(np.concatenate((self._turned, steps)), axis=0)
        n_before = len(self._before)
        self._before, self._turned = columns[-1:].copy(), turned[-1:].copy()
        return np.asarray(self._lever * turned[n_before:])


def _part_of(channel: Channel, lever: float) -> Callable[[Array], Array]:
    """Return what turns the next columns of a channel into its coordinates."""
    if channel.kind == "orientation":
        return _Orientation(channel, lever).take
    if channel.kind == "angle":
        # Of one that says no period nothing is unwrapped.
        period = coordinates.period_of_channel(channel, np.full(1, np.inf))
        if np.isfinite(period):
            return _Angle(period).take
    n_coordinates = len(channel.coordinates)  # none of a discrete one
    return lambda column: column[:, :n_coordinates]
