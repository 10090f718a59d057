"""One primitive with the movement that it was learned from: a recording, or the prototype of a symbol."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kineme.files.container import kind_of
from kineme.movements.channels.channel import learned_names, recorded_names
from kineme.movements.trajectories.movements import axis_names
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.primitives.discrete.dmp import DMP, Primitives
from kineme.primitives.pose.pose_dmp import PoseDMP
from kineme.primitives.pose.pose_primitives import PosePrimitives
from kineme.validation import Array

SAVED = ".kineme"  # file extension of saved primitives


@dataclass(frozen=True, eq=False)
class Learned:
    """A primitive, and its demonstration where that is known.

    Attributes
    ----------
    primitive : Primitives or PosePrimitives
        A batch of one.
    demonstration : Trajectory or None
        As it was recorded; its channels say what the columns are.
    """

    primitive: Primitives | PosePrimitives
    demonstration: Trajectory | None = None

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns that are generated: those that were recorded."""
        if self.demonstration is not None and self.demonstration.channels is not None:
            return recorded_names(self.demonstration.channels)
        if isinstance(self.primitive, PosePrimitives):
            return (*"xyz"[: self.primitive.n_dims - 3], "qw", "qx", "qy", "qz")
        return tuple(axis_names(self.primitive.n_dims))

    @property
    def rates(self) -> tuple[str, ...]:
        """Names of the columns that have velocities: an orientation has three, a discrete channel none."""
        if self.demonstration is not None and self.demonstration.channels is not None:
            return learned_names(self.demonstration.channels)
        if isinstance(self.primitive, PosePrimitives):
            return (*"xyz"[: self.primitive.n_dims - 3], "q.rx", "q.ry", "q.rz")
        return tuple(axis_names(self.primitive.n_dims))

    @property
    def recorded(self) -> Array | None:
        """The demonstration in these columns, shape (T, columns)."""
        return None if self.demonstration is None else self.demonstration.recorded


def learn_one(demonstration: Trajectory, dmp: DMP) -> Learned:
    """The primitive of a recording; of one with an orientation, a pose.

    Raises
    ------
    TrajectoryError
        An orientation beside anything but three positions, or a movement that cannot be learned.
    """
    return Learned((PoseDMP(dmp) if has_orientation(demonstration) else dmp).learn([demonstration]), demonstration)


def has_orientation(demonstration: Trajectory) -> bool:
    """Whether a channel of the recording is an orientation."""
    return any(one.kind == "orientation" for one in demonstration.channels or ())


def load_saved(path: Path) -> Primitives | PosePrimitives:
    """Saved primitives of either kind.

    Raises
    ------
    DataError, FileNotFoundError
        See `Primitives.load`.
    """
    is_pose = path.is_file() and kind_of(path) == PosePrimitives.KIND
    return PosePrimitives.load(path) if is_pose else Primitives.load(path)


def largest_deviation(learned: Learned) -> tuple[float, float] | None:
    """How far the primitive, moved as demonstrated, is off the recording at most: in its unit, and as a share.

    Over positions and angles, without orientations: the largest distance at the recorded times, and that divided by
    the diagonal of the recording's bounding box. None without a demonstration or positions.
    """
    one = learned.demonstration
    if one is None:
        return None
    replay = learned.primitive.rollout(n_samples=max(1000, len(one)))
    columns = slice(0, -4) if isinstance(learned.primitive, PosePrimitives) else slice(None)
    made, times = replay.positions[0][:, columns], replay.times[0]
    recorded = _positions_of(one)
    extent = float(np.linalg.norm(np.ptp(recorded, axis=0))) if recorded.size else 0.0
    if extent == 0.0:
        return None
    at = one.times - one.times[0]
    off = np.stack([np.interp(at, times, made[:, k]) - recorded[:, k] for k in range(recorded.shape[1])])
    largest = float(np.linalg.norm(off, axis=0).max())
    return largest, largest / extent


def _positions_of(one: Trajectory) -> Array:
    """The coordinates that are no rotation."""
    if one.channels is None:
        return one.positions
    kinds = [channel.kind for channel in one.channels for _ in channel.coordinates]
    return one.positions[:, [kind != "orientation" for kind in kinds]]
