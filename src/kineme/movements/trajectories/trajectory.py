"""One demonstrated movement, and what is taken for one and for many: the types of public signatures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import TrajectoryError
from kineme.movements.channels.channel import Channels, learned_names, recorded_names
from kineme.movements.trajectories.movements import Samples, axis_names, set_read_only_state
from kineme.movements.trajectories.presented import Presented, with_units
from kineme.validation import Array, as_positions, as_times, check_extents, check_finite, check_times


@dataclass(frozen=True, eq=False)
class Trajectory(Presented):
    """One movement: positions over time, with an optional label and name.

    Parameters
    ----------
    times : array_like of shape (T,)
        Strictly increasing time stamps [s]; any origin, any spacing. T >= 4.
    positions : array_like of shape (T, d)
        Positions, in any unit; angles in radians.
    label : str or int, optional
        The action that the movement shows.
    name : str, optional
        Where it comes from; error messages show it.

    Attributes
    ----------
    channels : tuple of Channel or None
        What the columns of its recording are, where that is known; see `kineme.read_recordings`.
    recorded : ndarray of shape (T, columns)
        The columns of the channels as recorded, where orientations are quaternions and discrete channels are there;
        without channels the positions.

    Raises
    ------
    TrajectoryError
        Fewer than 4 samples; NaN, infinity or complex numbers; times not strictly increasing or of another length;
        positions beyond 1e100 or an extent below 1e-100; stamps beyond 1e50 s or less than 1e-50 s apart.

    Notes
    -----
    Both arrays are copied once and write-protected.
    """

    times: Array
    positions: Array
    label: Any = None
    name: str | None = None
    channels: Channels | None = field(default=None, init=False)
    recorded: Array = field(init=False)

    __setstate__ = set_read_only_state

    def __post_init__(self) -> None:
        if getattr(self.name, "__hash__", None) is None:
            raise TrajectoryError(f"expected a name as text, got {type(self.name).__name__}")
        who = f"trajectory {self.name!r}" if self.name else "trajectory"
        x = as_positions(self.positions, who)
        t = as_times(self.times, len(x), who)
        ends = np.array([0, len(x)])
        names = [self.name] if self.name else None
        check_finite(x, ends, names, "positions")
        check_extents(x, ends, names)
        check_times(t, ends, names)
        for name, values in (("times", t), ("positions", x)):
            own = values.copy()
            own.setflags(write=False)
            object.__setattr__(self, name, own)
        object.__setattr__(self, "recorded", self.positions)

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.times[-1] - self.times[0])

    @property
    def n_dims(self) -> int:
        """Number of dimensions d."""
        return int(self.positions.shape[1])

    @property
    def _samples(self) -> Samples:
        names = heads = tuple(axis_names(self.n_dims))
        if self.channels is not None:
            names = with_units(learned_names(self.channels), self.channels)
            heads = with_units(recorded_names(self.channels), self.channels)
        ends, labels = np.array([0, len(self)]), None if self.label is None else np.array([self.label], dtype=object)
        return Samples(self.times, ends, self.positions, names, self.recorded, heads, labels)

    def __len__(self) -> int:
        return len(self.times)

    def __repr__(self) -> str:
        label = "" if self.label is None else f", label={self.label!r}"
        name = "" if self.name is None else f", name={self.name!r}"
        return f"Trajectory({len(self)} samples, {self.n_dims} dims, {self.duration:.3g} s{label}{name})"


def unchecked(**fields: Any) -> Trajectory:
    """A `Trajectory` of fields that have been checked already, which shares their memory."""
    trajectory = object.__new__(Trajectory)
    vars(trajectory).update(fields)
    return trajectory


@runtime_checkable
class HasDemonstrations(Protocol):
    """Whatever holds movements and hands them out: recordings that were read, a segmentation, a rollout."""

    @property
    def demonstrations(self) -> Sequence[Trajectory]:
        """The movements, as `Demonstrations`."""


#: One movement: a `Trajectory`, or positions of shape (T, d) or (T,), evenly sampled over one second.
MovementLike = Trajectory | ArrayLike

#: Whatever `Demonstrations.of` takes: Demonstrations, recordings that were read, a segmentation, a rollout; one
#: movement; one array of shape (n, T, d); a data frame; or a list of any of these. A list is typed as one of objects:
#: to a type checker that is what a list of a rollout and recordings holds.
MovementsLike = HasDemonstrations | MovementLike | Sequence[object]
