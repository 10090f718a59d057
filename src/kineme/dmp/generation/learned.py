"""One primitive with the movement that it was learned from: a recording, or the prototype of a symbol."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.dmp.pose.pose_dmp import PoseDMP, PosePrimitives
from kineme.io.arrays.npz import kind_of
from kineme.movements.channels.channel import learned_names, recorded_names
from kineme.movements.channels.coordinates import as_wxyz, columns_of
from kineme.movements.rotations import angle_between
from kineme.movements.trajectories.movements import axis_names
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.validation import Array

SAVED = ".kineme"  # file extension of saved primitives


@dataclass(frozen=True, eq=False)
class Learned:
    """A primitive, and its demonstration where that is known."""

    primitive: Primitives | PosePrimitives  # a batch of one
    demonstration: Trajectory | None = None  # as it was recorded; its channels say what the columns are

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns that are generated: those that were recorded."""
        about = self.primitive.to_recording
        if about is not None:
            return recorded_names(about.channels)
        if isinstance(self.primitive, PosePrimitives):
            return (*"xyz"[: self.primitive.n_positions], "qw", "qx", "qy", "qz")
        return self.rates

    @property
    def moving_columns(self) -> tuple[str, ...]:
        """Those that a start and a goal have: all but the discrete ones."""
        about = self.primitive.to_recording
        return self.columns if about is None else recorded_names(about.moving)

    @property
    def rates(self) -> tuple[str, ...]:
        """Names of the columns that have velocities: an orientation has three, a discrete channel none."""
        channels = self.primitive.channels
        if channels is not None:
            return learned_names(channels)
        if isinstance(self.primitive, PosePrimitives):
            return (*"xyz"[: self.primitive.n_positions], "q.rx", "q.ry", "q.rz")
        return tuple(axis_names(self.primitive.n_dims))

    @property
    def recorded(self) -> Array | None:
        """The demonstration in these columns, shape (T, columns)."""
        return None if self.demonstration is None else self.demonstration.recorded

    @property
    def example(self) -> Array:
        """The movement as it was learned, in the columns of the recording, shape (T, columns)."""
        return np.asarray(self.primitive.rollout()[0].recorded)


def learn_one(demonstration: Trajectory, dmp: DMP) -> Learned:
    """The primitive of a recording, whatever it holds; with orientations it is one of poses.

    Raises `TrajectoryError`: a movement that cannot be learned.
    """
    return Learned((PoseDMP(dmp) if has_orientation(demonstration) else dmp).learn([demonstration]), demonstration)


def has_orientation(demonstration: Trajectory) -> bool:
    """Tell whether a channel of the recording is an orientation."""
    return any(channel.kind == "orientation" for channel in demonstration.channels or ())


def load_saved(path: Path) -> Primitives | PosePrimitives:
    """Saved primitives of either kind.

    Raises `DataError` or `FileNotFoundError`: see `Primitives.load`.
    """
    is_pose = path.is_file() and kind_of(path) == PosePrimitives.KIND
    return PosePrimitives.load(path) if is_pose else Primitives.load(path)


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
    """Return the deviation of positions, angles or one orientation that is the largest share of its extent.

    It is measured at the recorded times. None without a demonstration, or where nothing of it moves.
    """
    demonstration = learned.demonstration
    if demonstration is None:
        return None
    replay = learned.primitive.rollout(n_samples=max(1000, len(demonstration))).demonstrations[0]
    at = demonstration.times - demonstration.times[0]
    generated = np.stack([np.interp(at, replay.times, column) for column in replay.recorded.T], axis=1)
    deviations = [
        Deviation(off, off / extent, of) for off, extent, of in _deviations(demonstration, generated) if extent > 0.0
    ]
    if not deviations:
        return None
    worst = max(deviations, key=lambda each: each.share)
    return worst if len(deviations) > 1 else worst._replace(of="")


def _deviations(demonstration: Trajectory, generated: Array) -> Iterator[tuple[float, float, str]]:
    """Yield the largest distance of each kind of columns (T, columns), its extent, and what it is."""
    channels = demonstration.channels or ()
    kinds = [channel.kind for channel in channels for _ in channel.columns] or ["position"] * generated.shape[1]
    for kind in ("position", "angle"):
        columns = [k for k, name in enumerate(kinds) if name == kind]
        recorded = demonstration.recorded[:, columns]
        off = np.linalg.norm(generated[:, columns] - recorded, axis=1)
        yield float(off.max()), float(np.linalg.norm(np.ptp(recorded, axis=0))), f"{kind}s"
    for channel, some in zip(channels, columns_of(channels), strict=True):
        if channel.kind == "orientation":
            q, fitted = as_wxyz(demonstration.recorded[:, some], channel), as_wxyz(generated[:, some], channel)
            fitted = fitted / np.linalg.norm(fitted, axis=1, keepdims=True)  # between samples shorter than 1
            yield float(angle_between(fitted, q).max()), float(angle_between(q, q[0]).max()), channel.name
