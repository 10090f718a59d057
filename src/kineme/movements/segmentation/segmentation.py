"""The record of how a recording was cut."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from kineme.movements.channels.channel import is_plain, learned_names
from kineme.movements.segmentation.bouts import Rows
from kineme.movements.segmentation.table import Segmenter
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movement_sequence import MovementSequence
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.validation import Array


@dataclass(frozen=True, eq=False)
class Segmentation(MovementSequence):
    """Movements cut from one recording, and where: a sequence of `Trajectory`, taken wherever movements are expected.

    Attributes
    ----------
    recording : Trajectory
        The recording that was cut.
    method : Segmenter
        The method, with all its parameters.
    rows : ndarray of shape (n, 2)
        First sample of each movement, and one past its last.
    """

    recording: Trajectory
    method: Segmenter
    rows: Rows

    @property
    def cuts(self) -> Array:
        """Time of the first and last sample of each movement, shape (n, 2) [s]."""
        return np.column_stack((self.recording.times[self.rows[:, 0]], self.recording.times[self.rows[:, 1] - 1]))

    @cached_property
    def demonstrations(self) -> Demonstrations:
        """The movements, as recorded: neither smoothed nor moved in time, named like ``recording[12.3-14.1 s]``."""
        return pieces_of(self.recording, self.rows)

    @property
    def trajectories(self) -> Demonstrations:
        """The same as `demonstrations`."""
        return self.demonstrations

    def __len__(self) -> int:
        return len(self.rows)

    def __repr__(self) -> str:
        return f"Segmentation({len(self)} movements in {self.recording.duration:.3g} s, {self.method!r})"


def pieces_of(recording: Trajectory, rows: Rows) -> Demonstrations:
    """Samples rows[i, 0]:rows[i, 1] of a recording as movements; they may overlap."""
    name = recording.name or "recording"
    whole = [slice(first, stop) for first, stop in rows.tolist()]
    spans = [(recording.times[one][0], recording.times[one][-1]) for one in whole]
    pieces = Demonstrations.from_arrays(
        [recording.positions[one] for one in whole],
        None if recording.label is None else [recording.label] * len(whole),
        [recording.times[one] for one in whole],
        [f"{name}[{_seconds(start)}-{_seconds(end)} s]" for start, end in spans],
    )
    if (channels := recording.channels) is None:
        return pieces
    recorded = None if is_plain(channels) else np.concatenate([recording.recorded[one] for one in whole])
    known = replace(pieces.movements, dimensions=learned_names(channels), channels=channels, recorded=recorded)
    return Demonstrations.of_movements(known)


def _seconds(time: float) -> str:
    """Seconds with four decimals, for seconds since 1970 too."""
    return np.format_float_positional(time, precision=4, trim="-")
