"""Digests of movements, by which one that is learned again is known."""

from __future__ import annotations

import hashlib
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from kineme.library.learning.serialize import relative_times, stored_times
from kineme.library.storage.channels import other_columns, to_bytes
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.validation import Array

_BITS = 24  # of a duration that count
_DECIMALS = 3  # of a quaternion at the start of a movement, where it only tells movements apart


def digests(demos: Demonstrations, even: NDArray[np.bool_]) -> list[int]:
    """BLAKE2b of each movement's positions, other columns and times from its start, as 64-bit numbers; without names.

    They are of the numbers that will be read: a movement that is read and learned again has the same one. The
    probability that any two of a million different movements have the same digest is 3e-8.
    """
    starts = np.repeat(demos.positions[demos.offsets[:-1]], demos.lengths, axis=0)
    positions = starts + (demos.positions - starts).astype(np.float32)
    times = None if even.all() else _times_as_read(demos, even)
    mantissas, exponents = np.frexp(demos.durations)  # even stamps say the duration but for rounding
    durations = np.ldexp(np.rint(mantissas * 2.0**_BITS), exponents)
    return _hashed(demos.offsets, positions, durations, times, even, _other_columns(demos))


def exact_digests(demos: Demonstrations, even: NDArray[np.bool_]) -> list[int]:
    """The same of the numbers as they come, which libraries of earlier versions hold."""
    recorded = demos.movements.recorded
    others = None if recorded is None else to_bytes(recorded, demos.offsets, demos.channels or ())
    times = None if even.all() else relative_times(demos)
    return _hashed(demos.offsets, demos.positions, demos.durations, times, even, others)


def _hashed(
    offsets: NDArray[np.intp],
    positions: Array,
    durations: Array,
    times: Array | None,
    even: NDArray[np.bool_],
    others: list[bytes] | None,
) -> list[int]:
    blob, row = np.ascontiguousarray(positions).data.cast("B"), 8 * positions.shape[1]
    stamps = None if times is None else times.data.cast("B")
    lasting = durations.tobytes()
    parts = []
    for i, (a, b) in enumerate(pairwise(offsets.tolist())):
        digest = hashlib.blake2b(blob[a * row : b * row], digest_size=8)
        digest.update(lasting[8 * i : 8 * i + 8] if stamps is None or even[i] else stamps[8 * a : 8 * b])
        if others is not None:
            digest.update(others[i])
        parts.append(digest.digest())
    return np.frombuffer(b"".join(parts), np.int64).tolist()


def _other_columns(demos: Demonstrations) -> list[bytes] | None:
    """Of each movement what its positions do not say: the steps of discrete columns, and how it is turned at its start.

    A quaternion that is read has norm 1 again, and so other last digits than were stored: they are left out.
    """
    recorded, channels = demos.movements.recorded, demos.channels or ()
    if recorded is None:
        return None
    others = other_columns(channels)
    kinds = [one.kind for one in channels for _ in one.columns]
    steps = recorded[:, [k for k in others if kinds[k] == "discrete"]].astype(np.float32)
    turned = recorded[demos.offsets[:-1]][:, [k for k in others if kinds[k] == "orientation"]].round(_DECIMALS) + 0.0
    return [one.tobytes() + steps[a:b].tobytes() for one, (a, b) in zip(turned, pairwise(demos.offsets), strict=True)]


def _times_as_read(demos: Demonstrations, even: NDArray[np.bool_]) -> Array:
    """Times from the start of each movement, of those that are stored as `read.movements` gives them."""
    relative, offsets = relative_times(demos), demos.offsets.tolist()
    for i in np.flatnonzero(~even).tolist():
        a, b = offsets[i : i + 2]
        stored = stored_times(relative[a:b])
        read = np.frombuffer(stored, np.float32 if len(stored) == 4 * (b - a) else np.float64)
        relative[a:b] = (demos.times[a] + read) - demos.times[a]
    return relative
