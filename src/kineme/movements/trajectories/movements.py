"""The block behind `Demonstrations`: many movements of unequal length and sampling, one after the other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import TrajectoryError
from kineme.movements.channels.channel import Channels
from kineme.movements.trajectories.close_stamps import merge_close, spread_close
from kineme.validation import Array

Names = tuple[str | None, ...] | None

_EVEN = 1e-9  # stamps off an even grid by less than this share of a step count as even
_SAMPLES_AT_ONCE = 65_536  # stamps checked at a time: uneven ones are found early, and temporaries stay in the cache


@dataclass(frozen=True, eq=False)
class Movements:
    """The block behind `Demonstrations`: validated, contiguous, read-only.

    `times` is None for movements evenly sampled over their `durations`; `stamps` writes them out. `recorded` holds what
    `positions` do not say, where there is such: orientations as quaternions, and discrete channels. Steps that change
    samples drop it.
    """

    positions: Array  # (total, d)
    offsets: NDArray[np.intp]  # (n + 1,)
    durations: Array  # (n,)
    times: Array | None = None  # (total,)
    labels: NDArray[Any] | None = None  # (n,)
    names: Names = None
    dimensions: tuple[str, ...] | None = None  # what the d columns are called, where that is known
    channels: Channels | None = None  # what was recorded, where that is known
    recorded: Array | None = None  # (total, columns of the channels); None where it is the positions

    def __post_init__(self) -> None:
        for field in ("positions", "offsets", "durations", "times", "labels", "recorded"):
            if (value := getattr(self, field)) is not None:
                view = value.view()
                view.setflags(write=False)
                object.__setattr__(self, field, view)

    @cached_property
    def stamps(self) -> Array:
        """Time stamps of all samples, (total,)."""
        if self.times is not None:
            return self.times
        lengths = np.diff(self.offsets)
        step = np.repeat(self.durations / (lengths - 1), lengths)
        stamps: Array = step * (np.arange(len(self.positions)) - np.repeat(self.offsets[:-1], lengths))
        stamps.setflags(write=False)
        return stamps

    @cached_property
    def even_length(self) -> int | None:
        """Samples per movement when all have equally many, evenly spaced; else None."""
        lengths = np.diff(self.offsets)
        if (lengths != lengths[0]).any():
            return None
        n_samples = int(lengths[0])
        if self.times is None:
            return n_samples
        n_rows = max(1, _SAMPLES_AT_ONCE // n_samples)
        tiles = (slice(start, start + n_rows) for start in range(0, len(lengths), n_rows))
        return n_samples if all(map(self._is_even, tiles)) else None

    def _is_even(self, some: slice) -> bool:
        """Whether the stamps of some movements, all of one length, are evenly spaced."""
        assert self.times is not None
        t = self.times.reshape(len(self.durations), -1)[some]
        step = self.durations[some, None] / (t.shape[1] - 1)
        deviation = np.abs(t - t[:, :1] - step * np.arange(t.shape[1]))
        return bool((deviation <= _EVEN * step + 2 * np.spacing(np.abs(t[:, -1:]))).all())

    @cached_property
    def separated(self) -> Movements:
        """The same movements with close samples merged, for interpolation; usually there are none."""
        merged = None if self.times is None else merge_close(self.times, self.positions, self.offsets)
        if merged is None:
            return self
        return replace(self.positions_only, times=merged[0], positions=merged[1], offsets=merged[2])

    @cached_property
    def spread(self) -> Array:
        """Time stamps (total,), none so close to the next that a smoothing spline loses its digits."""
        return self.stamps if self.times is None else spread_close(self.times, self.offsets)

    def take(self, chosen: NDArray[np.intp]) -> Movements:
        """The chosen movements, in that order, copied into a new block."""
        if len(chosen) == 0:
            raise TrajectoryError("expected at least one movement, got an empty selection")
        lengths = np.diff(self.offsets)[chosen]
        offsets = np.concatenate(([0], np.cumsum(lengths)))
        rows = np.arange(offsets[-1]) + np.repeat(self.offsets[:-1][chosen] - offsets[:-1], lengths)
        return Movements(
            self.positions[rows],
            offsets,
            self.durations[chosen],
            None if self.times is None else self.times[rows],
            None if self.labels is None else self.labels[chosen],
            None if self.names is None else tuple(self.names[i] for i in chosen),
            self.dimensions,
            self.channels,
            None if self.recorded is None else self.recorded[rows],
        )

    @property
    def positions_only(self) -> Movements:
        """The same movements without what `recorded` holds beside the positions, for steps that change samples."""
        return self if self.recorded is None else replace(self, channels=None, recorded=None)


def axis_names(n_dims: int) -> list[str]:
    """The names x, y, z, or q1, q2, ... beyond three dimensions."""
    return list("xyz"[:n_dims]) if n_dims <= len("xyz") else [f"q{k + 1}" for k in range(n_dims)]
