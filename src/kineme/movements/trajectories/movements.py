"""The block behind `Demonstrations`: many movements of unequal length and sampling, one after the other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import TrajectoryError
from kineme.movements.channels.channel import Channels, is_plain, learned_names
from kineme.movements.channels.coordinates import canonical, learned, off_norm
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.validation import MIN_SAMPLES, Array, describe

#: Samples are close when less than this share of the movement's usual step lies between them. Of 0.05, 0.1, 0.2 and 0.5
#: the largest that leaves stamps with a jitter of up to 80 % of a step as they are, however few. At random stamps, with
#: 10 % of noise, it is enough for rhythms: none of 100 is refused, against 76 (300 samples, 3.3 periods).
SHARE = 0.1
_QUANTILE = 0.75  # of a movement's gaps: its usual step, also where every stamp occurs twice or samples are missing

#: Share of a movement's mean step below which a smoothing spline, whose equations divide by squares of the gaps, loses
#: more digits than a gap of that length costs: the path is off by 4e-6 of its extent, and by all of it at 1e-7.
CLOSEST = 1e-5

_OPERATIONS_PER_SAMPLE = 3

Names = tuple[str | None, ...] | None

_EVEN = 1e-9  # stamps off an even grid by less than this share of a step count as even
_SAMPLES_AT_ONCE = 65_536  # stamps checked at a time: uneven ones are found early, and temporaries stay in the cache


def set_read_only_state(record: Any, state: dict[str, Any]) -> None:
    """Give a copied or unpickled record its arrays, which nobody can write to: NumPy forgets that on the way."""
    for value in state.values():
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
    vars(record).update(state)


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

    __setstate__ = set_read_only_state

    def __post_init__(self) -> None:
        for field in ("positions", "offsets", "durations", "times", "labels", "recorded"):
            if (value := getattr(self, field)) is not None:
                # Compiled loops are compiled apart for arrays in another order, and for those that can be written to.
                view = np.ascontiguousarray(value).view()
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
        """Tell whether the stamps of some movements, all of one length, are evenly spaced."""
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
        offsets, rows = samples_of(self.offsets, chosen)
        return self._part(offsets, rows, chosen, self.names and tuple(self.names[i] for i in chosen))

    def between(self, start: int, stop: int) -> Movements:
        """Movements start:stop, sharing the samples."""
        offsets = self.offsets[start : stop + 1]
        rows, chosen = slice(offsets[0], offsets[-1]), slice(start, stop)
        return self._part(offsets - offsets[0], rows, chosen, self.names and self.names[chosen])

    def _part(self, offsets: NDArray[np.intp], rows: Any, chosen: Any, names: Names) -> Movements:
        of_samples, of_movements = ("positions", "times", "recorded"), ("durations", "labels")
        parts = {name: getattr(self, name) for name in (*of_samples, *of_movements)}
        own = {name: x[rows if name in of_samples else chosen] for name, x in parts.items() if x is not None}
        return replace(self, offsets=offsets, names=names, **own)

    @property
    def positions_only(self) -> Movements:
        """The same movements without what `recorded` holds beside the positions, for steps that change samples."""
        return self if self.recorded is None else replace(self, channels=None, recorded=None)


def samples_of(offsets: NDArray[np.intp], chosen: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Offsets of the chosen movements, in that order, and the rows of their samples among those of all."""
    lengths = np.diff(offsets)[chosen]
    own = np.concatenate(([0], np.cumsum(lengths)))
    return own, np.arange(own[-1]) + np.repeat(offsets[:-1][chosen] - own[:-1], lengths)


class Samples(NamedTuple):
    """All samples of n movements, one movement after the other."""

    times: Array  # (total,) [s]
    offsets: NDArray[np.intp]  # (n + 1,)
    positions: Array  # (total, d); what is drawn
    axis_names: tuple[str, ...]
    columns: Array  # (total, c); what a table holds
    column_names: tuple[str, ...]
    labels: NDArray[Any] | None  # (n,)


def axis_names(n_dims: int) -> list[str]:
    """The names x, y, z, or x1, x2, ... beyond three dimensions: no q, which would say that they are joints."""
    return list("xyz"[:n_dims]) if n_dims <= len("xyz") else [f"x{k + 1}" for k in range(n_dims)]


def merge_close(
    times: Array, positions: Array, offsets: NDArray[np.intp]
) -> tuple[Array, Array, NDArray[np.intp]] | None:
    """Replace each group of close samples by its mean time and mean position.

    A group is shorter than `SHARE` of the usual step, the upper quartile of the movement's gaps. First and last
    samples are not moved, and every movement keeps at least four. A stretch of close samples that is longer than a
    usual step is a denser part of the recording and is left as it is.

    An interpolating spline turns the noise between two samples into a slope, by dividing it by the time between them:
    the closer they are, the wilder the path between their neighbors. With 0.2 % of noise and one gap in twenty 200
    times shorter than the others, the learned path is off by 0.20 % of the extent (median of 60 movements; 0.96 % at
    worst). With such samples merged it is off by 0.077 % (0.098 %), as on even stamps.

    None if no samples are close, the usual case.
    """
    steps = _usual_steps(times, offsets)
    if not steps.any():
        return None
    is_merged = _merged(times, offsets, steps)
    if not is_merged.any():
        return None
    heads = np.flatnonzero(~is_merged)
    counts = np.diff(np.append(heads, len(times)))
    # The mean of differences lies within its group after rounding too.
    merged_times = times[heads] + np.add.reduceat(times - np.repeat(times[heads], counts), heads) / counts
    away = np.add.reduceat(positions - np.repeat(positions[heads], counts, axis=0), heads)
    merged_positions = positions[heads] + away / counts[:, None]
    merged_offsets = np.searchsorted(heads, offsets)
    for ends, of in ((merged_offsets[:-1], offsets[:-1]), (merged_offsets[1:] - 1, offsets[1:] - 1)):
        merged_times[ends], merged_positions[ends] = times[of], positions[of]
    return merged_times, merged_positions, merged_offsets


def spread_close(times: Array, offsets: NDArray[np.intp]) -> Array:
    """Stamps (total,) of each movement, usually as they are, moved later until all are at least `CLOSEST` apart."""
    lengths, durations = np.diff(offsets), times[offsets[1:] - 1] - times[offsets[:-1]]
    least = CLOSEST * durations / (lengths - 1)
    short = np.diff(times) < np.repeat(least, lengths)[1:]
    short[offsets[1:-1] - 1] = False
    if not short.any():
        return times
    spread = times.copy()
    for i in np.unique(np.searchsorted(offsets, np.flatnonzero(short), side="right") - 1):
        own = slice(offsets[i], offsets[i + 1])
        missing = least[i] - np.diff(times[own])
        spread[own][1:] += np.cumsum(np.maximum(missing, 0.0))
    spread.setflags(write=False)
    return spread


def _merged(times: Array, offsets: NDArray[np.intp], steps: Array) -> NDArray[np.bool_]:
    """Tell whether each sample belongs to the group of the one before; `steps` are 0 where no samples are close."""
    lengths, total = np.diff(offsets), len(times)
    step = np.repeat(steps, lengths)
    is_merged = np.zeros(total, dtype=bool)
    is_merged[1:] = np.diff(times) < SHARE * step[1:]
    is_merged[offsets[:-1]] = False
    heads = np.flatnonzero(~is_merged)
    counts = np.diff(np.append(heads, total))
    spans = times[heads + counts - 1] - times[heads]
    is_merged &= np.repeat(spans <= step[heads], counts)  # a longer group is a dense stretch
    since = times - np.repeat(times[heads], counts)
    part = np.floor(np.divide(since, SHARE * step, out=np.zeros(total), where=is_merged))
    is_merged[1:] &= part[1:] == part[:-1]
    too_few = lengths - np.add.reduceat(is_merged, offsets[:-1], dtype=np.intp) < MIN_SAMPLES
    return is_merged & ~np.repeat(too_few, lengths)


def _usual_steps(times: Array, offsets: NDArray[np.intp]) -> Array:
    """Upper quartile of the gaps of each movement, shape (n,); 0 for movements without close samples."""
    steps = np.zeros(len(offsets) - 1)
    if use_compiled(_OPERATIONS_PER_SAMPLE * len(times)):
        fill = compiled_module("kineme.movements.trajectories._compiled").fill_usual_steps
        fill(times, offsets, SHARE, _QUANTILE, steps)
        return steps
    bounds = np.column_stack((offsets[:-1], offsets[1:] - 1)).ravel()[:-1]  # of the gaps within each movement
    gaps = np.diff(times)
    shortest, longest = np.minimum.reduceat(gaps, bounds)[::2], np.maximum.reduceat(gaps, bounds)[::2]
    for i in np.flatnonzero(shortest < SHARE * longest):
        own = gaps[offsets[i] : offsets[i + 1] - 1]
        steps[i] = np.partition(own, k := int(_QUANTILE * len(own)))[k]
    return steps


def of_channels(recorded: Movements, channels: Channels) -> Movements:
    """Movements whose positions are the recorded columns, as movements of these channels."""
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
