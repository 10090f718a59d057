"""How far a primitive, moved as demonstrated, is off its recording."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from kineme.dmp.generation.learned import Learned
from kineme.movements.channels.coordinates import as_wxyz, columns_of
from kineme.movements.rotations.quaternions import angle_between
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.validation import Array


class Deviation(NamedTuple):
    """The largest distance from a recording.

    Attributes
    ----------
    largest : float
        In the unit of the recording; of an orientation the angle [rad].
    share : float
        Of the extent: the diagonal of the bounding box, or the largest angle from the start.
    of : str
        What deviates so far: "positions", "angles", or the name of an orientation; empty if the recording is of one
        kind.
    """

    largest: float
    share: float
    of: str


def largest_deviation(learned: Learned) -> Deviation | None:
    """That of the positions, of the angles or of one orientation, whichever is off by the largest share of its extent.

    At the recorded times. None without a demonstration, or where nothing of it moves.
    """
    one = learned.demonstration
    if one is None:
        return None
    replay = learned.primitive.rollout(n_samples=max(1000, len(one))).demonstrations[0]
    at = one.times - one.times[0]
    made = np.stack([np.interp(at, replay.times, column) for column in replay.recorded.T], axis=1)
    found = [Deviation(off, off / extent, of) for off, extent, of in _deviations(one, made) if extent > 0.0]
    if not found:
        return None
    worst = max(found, key=lambda each: each.share)
    return worst if len(found) > 1 else worst._replace(of="")


def _deviations(one: Trajectory, made: Array) -> Iterator[tuple[float, float, str]]:
    """How far each kind of columns (T, columns) is off at most, its extent, and what it is."""
    channels = one.channels or ()
    kinds = [channel.kind for channel in channels for _ in channel.columns] or ["position"] * made.shape[1]
    for kind in ("position", "angle"):
        columns = [k for k, known in enumerate(kinds) if known == kind]
        recorded = one.recorded[:, columns]
        off = np.linalg.norm(made[:, columns] - recorded, axis=1)
        yield float(off.max()), float(np.linalg.norm(np.ptp(recorded, axis=0))), f"{kind}s"
    for channel, some in zip(channels, columns_of(channels), strict=True):
        if channel.kind == "orientation":
            q, fitted = as_wxyz(one.recorded[:, some], channel), as_wxyz(made[:, some], channel)
            fitted = fitted / np.linalg.norm(fitted, axis=1, keepdims=True)  # between samples shorter than 1
            yield float(angle_between(fitted, q).max()), float(angle_between(q, q[0]).max()), channel.name
