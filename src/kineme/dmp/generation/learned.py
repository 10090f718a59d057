"""One primitive with the movement that it was learned from: a recording, or the prototype of a symbol."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.dmp.pose.pose_dmp import PoseDMP
from kineme.dmp.pose.pose_primitives import PosePrimitives
from kineme.io.arrays.npz import kind_of
from kineme.movements.channels.channel import learned_names, recorded_names
from kineme.movements.trajectories.movements import axis_names
from kineme.movements.trajectories.trajectory import Trajectory
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

    Raises
    ------
    TrajectoryError
        A movement that cannot be learned.
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
