"""Serialize movements to the bytes of their rows, a batch at a time.

Positions are stored in single precision relative to the start of the movement, which is stored in double: the error of
a position is at most 2^-24 (6e-8) of its distance from the start. Times are stored in the same way; even ones are not
stored, but computed from the duration.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from kineme.dmp.discrete.encode import check_movement
from kineme.errors import TrajectoryError
from kineme.library.storage.channels import to_bytes
from kineme.library.storage.specification import Specification
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.similarity.describe import feature_rows
from kineme.validation import Array, describe

_EVEN = 1e-9  # of a step: stamps closer to an even grid are not stored
_SMALL, _LARGE = 1e-30, 1e30  # between which single precision keeps its relative error


@dataclass(frozen=True)
class SerializedRows:
    """Rows of a batch, without their keys."""

    raw: list[tuple[bytes, bytes, bytes | None]]  # start, positions, times
    primitives: list[tuple[bytes, bytes]]  # boundary, weights
    features: list[bytes]
    recorded: list[bytes]  # columns that positions do not say; empty where they say all


def check(demos: Demonstrations) -> None:
    """Refuse movements that cannot be stored, before any is stored."""
    first = demos.offsets[:-1]
    extents = np.maximum.reduceat(demos.positions, first) - np.minimum.reduceat(demos.positions, first)
    check_movement(demos, demos.positions[first], extents)
    largest = extents.max(axis=1)
    outside = (largest < _SMALL) | (largest > _LARGE)
    if outside.any():
        i = int(np.argmax(outside))
        raise TrajectoryError(
            f"{describe(i, demos.names)}: expected an extent from {_SMALL:g} to {_LARGE:g}, got {largest[i]:g}; "
            "choose a unit in which it is"
        )


def evenly_sampled(demos: Demonstrations) -> NDArray[np.bool_]:
    """Tell which movements have even time stamps, (n,)."""
    if demos.movements.times is None:
        return np.ones(len(demos), dtype=bool)
    times, first, lengths = demos.times, demos.offsets[:-1], demos.lengths
    step = demos.durations / (lengths - 1)
    k = np.arange(len(times)) - np.repeat(first, lengths)
    off = np.abs(times - np.repeat(times[first], lengths) - np.repeat(step, lengths) * k)
    slack = _EVEN * step + 2 * np.spacing(np.abs(times[demos.offsets[1:] - 1]))
    return np.asarray(np.maximum.reduceat(off, first) <= slack)


def relative_times(demos: Demonstrations) -> Array:
    """Return times (total,) from the start of each movement."""
    return demos.times - np.repeat(demos.times[demos.offsets[:-1]], demos.lengths)


def serialize(demos: Demonstrations, even: NDArray[np.bool_], specification: Specification) -> SerializedRows:
    """Return the rows of a batch that has been checked."""
    recorded = demos.movements.recorded
    others = [] if recorded is None else to_bytes(recorded, demos.offsets, demos.channels or ())
    starts = demos.positions[demos.offsets[:-1]]
    relative = (demos.positions - np.repeat(starts, demos.lengths, axis=0)).astype(np.float32)
    offsets = demos.offsets.tolist()
    times: list[bytes | None] = [None] * len(demos)
    if not even.all():
        stamps = relative_times(demos)
        for i in np.flatnonzero(~even).tolist():
            times[i] = stored_times(stamps[offsets[i] : offsets[i + 1]])
    blob, row = relative.tobytes(), 4 * demos.n_dims
    positions = [blob[row * a : row * b] for a, b in pairwise(offsets)]
    raw = list(zip(_cut(starts), positions, times, strict=True))
    rows = np.concatenate(feature_rows(demos, specification.comparison), axis=1, dtype=np.float32)
    return SerializedRows(raw, _primitives(demos, specification), _cut(rows), others)


def stored_times(stamps: Array) -> bytes:
    """Return times in single precision; in double if single overflows, or makes two stamps equal."""
    if not _SMALL <= stamps[-1] <= _LARGE:
        return stamps.tobytes()
    short = stamps.astype(np.float32)
    return (short if (np.diff(short) > 0).all() else stamps).tobytes()


def _primitives(demos: Demonstrations, specification: Specification) -> list[tuple[bytes, bytes]]:
    learned = specification.dmp.learn(demos)
    boundary = np.stack([learned.starts, learned.goals, learned.velocities, learned.extents], axis=1)
    with np.errstate(over="ignore"):  # refused below
        weights = learned.scaled_weights.astype(np.float32)
    if not (good := np.isfinite(weights).all(axis=(1, 2))).all():
        who = describe(int(np.argmin(good)), demos.names)
        raise TrajectoryError(
            f"{who}: expected weights up to {np.finfo(np.float32).max:.1g}, got larger ones; smooth the movement, "
            "or choose a unit in which it is smaller"
        )
    return list(zip(_cut(boundary), _cut(weights), strict=True))


def _cut(block: NDArray[np.floating]) -> list[bytes]:
    """Return each movement's bytes of a block (n, ...)."""
    blob, size = block.tobytes(), block[0].nbytes
    return [blob[k : k + size] for k in range(0, len(blob), size)]
