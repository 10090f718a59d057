"""Channels of the recordings of learned movements, and from the columns of a primitive back to those of the recording.

Those of a primitive are the positions and angles, in the order of their channels, and then orientations (w, x, y, z),
or their angular velocities in the world frame. Discrete channels step at their shares of the duration.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.movements.channels.channel import Channels, is_plain, learned_names, recorded_names, same_columns
from kineme.movements.channels.coordinates import columns_of, columns_of_kinds, period_of_channel
from kineme.movements.preparation.trim import Step, TrimRest, preprocess
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import Movements, of_channels, samples_of, set_read_only_state
from kineme.validation import Array

_DEGREES = 360.0  # what angles without a unit wrap by that are too large for radians
_ROUNDING = 1e-9  # of a duration: shares that are equal but for rounding


def make_read_only(record: Any, names: Iterable[str]) -> None:
    """Let a frozen record hold views of its arrays that nobody can write to."""
    for name in names:
        view = getattr(record, name).view()
        view.setflags(write=False)
        object.__setattr__(record, name, view)


@dataclass(frozen=True, eq=False)
class RecordedAs:
    """The channels of the recordings that a batch of primitives was learned from."""

    channels: Channels
    steps: DiscreteSteps | None = None  # of discrete channels, where it is known when they step

    def take(self, chosen: NDArray[np.intp]) -> RecordedAs:
        """Return that of the chosen movements."""
        return self if self.steps is None else replace(self, steps=self.steps.take(chosen))

    @property
    def has_steps(self) -> bool:
        """True if nothing is missing of the discrete channels."""
        return self.steps is not None or len(self.moving) == len(self.channels)

    @cached_property
    def moving(self) -> Channels:
        """The channels that are not discrete, in the order of the recording."""
        return tuple(channel for channel in self.channels if channel.coordinates)

    @cached_property
    def plain(self) -> Channels:
        """The channels that are positions or angles: the first columns of a primitive."""
        return tuple(channel for channel in self.moving if channel.kind != "orientation")

    @cached_property
    def orientations(self) -> Channels:
        """The channels that are orientations: the last columns of a primitive."""
        return tuple(channel for channel in self.moving if channel.kind == "orientation")

    def periods(self, points: Array) -> Array:
        """Return what the columns (d,) of points (n, d) of a primitive wrap by; infinite if no angle, or if in doubt.

        Small angles without a unit may be radians or degrees.
        """
        periods, names = np.full(points.shape[1], np.inf), learned_names(self.channels)
        if len(names) != len(periods):  # orientations are quaternions, behind the others
            names = learned_names(self.plain)
        for channel in self.plain:
            k = names.index(channel.coordinates[0])
            period = period_of_channel(channel, points[:, k]) if channel.kind == "angle" else np.inf
            periods[k] = period if channel.unit or channel.period or period == _DEGREES else np.inf
        return periods

    @property
    def column_names(self) -> tuple[str, ...]:
        """Names of the columns of a primitive."""
        return tuple(recorded_names(self.channels)[k] for k in primitive_columns(self.channels))

    @property
    def rate_names(self) -> tuple[str, ...]:
        """Names of the rates of a primitive."""
        return learned_names((*self.plain, *self.orientations))

    @property
    def rates_in_order(self) -> list[int]:
        """The rates of a primitive in the order of the recording."""
        turned = [channel.kind == "orientation" for channel in self.moving for _ in channel.coordinates]
        return np.argsort(np.argsort(turned, kind="stable")).tolist()


def recorded_as(movements: Demonstrations, steps: Iterable[Step] = ()) -> RecordedAs | None:
    """Channels and discrete steps of movements, where they are known; trimming before learning moves the steps."""
    channels = movements.channels
    if channels is None:
        return None
    if not (columns := columns_of_kinds(channels, "discrete")):
        return RecordedAs(channels)
    trimmed = preprocess(movements, [step for step in steps if isinstance(step, TrimRest)])
    return RecordedAs(channels, steps_of(trimmed, columns))


def merged(several: Sequence[RecordedAs | None]) -> RecordedAs | None:
    """Those of several batches, one after the other; None if these were not recorded as the same."""
    recordings = [about for about in several if about is not None]
    if len(recordings) < len(several) or not all(
        same_columns(about.channels, recordings[0].channels) for about in recordings
    ):
        return None
    steps = [about.steps for about in recordings if about.steps is not None]
    return replace(recordings[0], steps=concatenated(steps) if len(steps) == len(recordings) else None)


def primitive_columns(channels: Channels) -> list[int]:
    """Numbers of the columns of a recording in the order of a primitive's, which has no discrete ones."""
    named = zip(channels, columns_of(channels), strict=True)
    turned = [(channel.order, some.start) for channel, some in named if channel.kind == "orientation"]
    plain = columns_of_kinds(channels, "position", "angle")
    return plain + [start + order.index(part) for order, start in turned for part in "wxyz"]


def in_recording(columns: Array, about: RecordedAs, i: int, shares: Array) -> Array:
    """Movement i of a batch (T, d), given in the columns of a primitive, in all columns of the recording."""
    order = primitive_columns(about.channels)
    recorded = np.empty((len(columns), len(recorded_names(about.channels))))
    recorded[:, order] = columns
    if about.steps is not None:
        recorded[:, np.setdiff1d(np.arange(recorded.shape[1]), order)] = about.steps.at(i, shares)
    return recorded


def with_recorded(movements: Movements, about: RecordedAs, shares: Array, n_primitives: int) -> Movements:
    """Movements in the columns of primitives, all with samples at the same shares (T,), with their channels."""
    named = {"channels": about.channels, "dimensions": learned_names(about.channels)}
    if is_plain(about.channels):
        return replace(movements, **named)  # type: ignore[arg-type]
    blocks = movements.positions.reshape(-1, len(shares), movements.positions.shape[1])
    rows = [in_recording(block, about, i if n_primitives > 1 else 0, shares) for i, block in enumerate(blocks)]
    recorded = np.concatenate(rows)
    if about.orientations:
        return of_channels(replace(movements, positions=recorded), about.channels)
    return replace(movements, recorded=recorded, **named)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class DiscreteSteps:
    """Values of the discrete channels of n movements, and since when."""

    values: Array  # (m, c), values of the c columns: of each movement at its start, and wherever one changes
    shares: Array  # (m,), when, as a share of the duration: 0 at the start of each movement, 1 at its end
    offsets: NDArray[np.intp]  # (n + 1,), movement i has the steps ``offsets[i]:offsets[i + 1]``

    __setstate__ = set_read_only_state

    def __post_init__(self) -> None:
        make_read_only(self, ("values", "shares", "offsets"))

    def at(self, i: int, shares: Array) -> Array:
        """The values (T, c) of movement i at shares (T,) of its duration; past the end the last ones."""
        rows = slice(self.offsets[i], self.offsets[i + 1])
        now = np.searchsorted(self.shares[rows], shares + _ROUNDING, side="right") - 1
        return np.asarray(self.values[rows][now])

    def take(self, chosen: NDArray[np.intp]) -> DiscreteSteps:
        """The steps of the chosen movements, in that order."""
        offsets, rows = samples_of(self.offsets, chosen)
        return DiscreteSteps(self.values[rows], self.shares[rows], offsets)


def steps_of(demonstrations: Demonstrations, columns: Sequence[int]) -> DiscreteSteps:
    """The steps of these columns of `Demonstrations.recorded`."""
    values, first = demonstrations.recorded[:, columns], demonstrations.offsets[:-1]
    changes = np.concatenate(([True], (values[1:] != values[:-1]).any(axis=1)))
    changes[first] = True
    elapsed = demonstrations.times - np.repeat(demonstrations.times[first], demonstrations.lengths)
    rows = np.flatnonzero(changes)
    shares = (elapsed / np.repeat(demonstrations.durations, demonstrations.lengths))[rows]
    return DiscreteSteps(values[rows], shares, np.searchsorted(rows, demonstrations.offsets))


def concatenated(several: Sequence[DiscreteSteps]) -> DiscreteSteps:
    """The steps of the movements of all, in the order given."""
    lengths = np.concatenate([np.diff(steps.offsets) for steps in several])
    return DiscreteSteps(
        np.concatenate([steps.values for steps in several]),
        np.concatenate([steps.shares for steps in several]),
        np.concatenate(([0], np.cumsum(lengths))),
    )
