"""`segment`: cut one long recording into movements; and the record of how it was cut."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.channels.channel import is_plain, learned_names
from kineme.movements.segmentation.table import SEGMENTERS, Motion, Rows, Segmenter, consecutive, observe, onset_rows
from kineme.movements.trajectories.demonstrations import Demonstrations, MovementSequence
from kineme.movements.trajectories.trajectory import MovementsLike, Trajectory
from kineme.validation import MIN_SAMPLES, Array, check_choice, check_switch


def segment(
    recording: MovementsLike, by: str | Segmenter = "rest", *, cover: bool = False, **parameters: Any
) -> Segmentation:
    """Cut a continuous recording into movements.

    Parameters
    ----------
    recording : MovementsLike
        One movement, in any way that `Demonstrations.of` takes it. An array (T, d) is taken as evenly sampled over one
        second; pass a `Trajectory` with its time stamps, so that parameters in seconds mean something.
    by : {"rest", "speed", "change-points"} or Segmenter, default "rest"
        Where to cut: at rests, at minima of speed, or at change points of the velocity (needs
        ``pip install kineme[segmentation]``). See `Rest`, `SpeedMinima` and `ChangePoints`.
    cover : bool, default False
        Whether every sample belongs to exactly one movement. By default rests belong to none.
    **parameters
        Of the method, as in ``segment(recording, min_rest=0.2)``.

    Returns
    -------
    Segmentation
        ``cuts`` (n, 2) in seconds, the movements as ``demonstrations``, the method and the rows. It is taken wherever
        movements are expected.

    Raises
    ------
    TrajectoryError
        A recording without motion, with fewer than eight samples, or with values that are not finite.
    SpecificationError
        An unknown method or parameter, a parameter out of range, or the library of "change-points" is missing.

    Examples
    --------
    >>> import numpy as np, kineme
    >>> t = np.linspace(0.0, 5.0, 501)
    >>> there, back = np.clip(t - 1.0, 0.0, 1.0), np.clip(t - 3.0, 0.0, 1.0)
    >>> x = 0.5 * (np.cos(np.pi * back) - np.cos(np.pi * there))
    >>> kineme.segment(kineme.Trajectory(t, x)).cuts.round(1)
    array([[1., 2.],
           [3., 4.]])
    """
    check_switch("cover", cover)
    method = as_segmenter(by, parameters)
    trajectory = as_recording(recording)
    motion = observe(trajectory, method.resolution)
    if cover:
        return Segmentation(trajectory, method, enough_samples(consecutive(method.inner_cuts(motion), len(trajectory))))
    return Segmentation(trajectory, method, moving(motion, method.pieces(motion), method.resolution))


def as_segmenter(by: str | Segmenter, parameters: dict[str, Any]) -> Segmenter:
    """The method of that name with these parameters; a method that is passed itself takes no parameters."""
    if not isinstance(by, str):
        if isinstance(by, type) or not callable(getattr(by, "inner_cuts", None)) or parameters:
            raise SpecificationError(
                f"expected by to be one of {list(SEGMENTERS)} with its parameters, or a method that has them, "
                f"got {by!r}" + (f" and {parameters}" if parameters else "")
            )
        return by
    check_choice("by", by, list(SEGMENTERS))
    names = [field.name for field in fields(SEGMENTERS[by])]
    unknown = [name for name in parameters if name not in names]
    if unknown:
        raise SpecificationError(f"expected parameters of by={by!r} among {names}, got {unknown[0]!r}")
    chosen: Segmenter = SEGMENTERS[by](**parameters)
    return chosen


def as_recording(recording: MovementsLike) -> Trajectory:
    """One recording as a `Trajectory`."""
    if isinstance(recording, Trajectory):
        return recording
    several = Demonstrations.of(recording)
    if len(several) != 1:
        raise TrajectoryError(f"expected one recording, got {len(several)} movements; pass them one by one")
    return several[0]


def enough_samples(pieces: Rows) -> Rows:
    """Merge pieces of fewer samples than a trajectory needs with the piece before, the first with the one after."""
    starts = [0]
    for start in pieces[1:, 0].tolist():
        if start - starts[-1] >= MIN_SAMPLES and pieces[-1, 1] - start >= MIN_SAMPLES:
            starts.append(start)
    return np.column_stack((starts, [*starts[1:], pieces[-1, 1]])).astype(np.intp)


def moving(motion: Motion, pieces: Rows, resolution: float) -> Rows:
    """The pieces with motion, narrowed to it."""
    padded = np.append(motion.speed, 0.0)
    fastest = np.maximum.reduceat(padded, pieces.ravel())[::2]
    pieces = pieces[fastest > 2.0 * max(resolution * motion.peak, 2.0 * motion.noise)]
    narrow = onset_rows(motion, pieces)
    return narrow[narrow[:, 1] - narrow[:, 0] >= MIN_SAMPLES]


@dataclass(frozen=True, eq=False)
class Segmentation(MovementSequence):
    """Movements cut from one recording, and where: a sequence of `Trajectory`, taken wherever movements are expected.

    - `recording`: the recording that was cut.
    - `method`: the method, with all its parameters.
    - `rows` (n, 2): first sample of each movement, and one past its last.
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
    slices = [slice(first, stop) for first, stop in rows.tolist()]
    spans = [(recording.times[piece][0], recording.times[piece][-1]) for piece in slices]
    pieces = Demonstrations.from_arrays(
        [recording.positions[piece] for piece in slices],
        None if recording.label is None else [recording.label] * len(slices),
        [recording.times[piece] for piece in slices],
        [f"{name}[{_seconds(start)}-{_seconds(end)} s]" for start, end in spans],
    )
    if (channels := recording.channels) is None:
        return pieces
    recorded = None if is_plain(channels) else np.concatenate([recording.recorded[piece] for piece in slices])
    movements = replace(pieces.movements, dimensions=learned_names(channels), channels=channels, recorded=recorded)
    return Demonstrations.of_movements(movements)


def _seconds(time: float) -> str:
    """Seconds with four decimals, for seconds since 1970 too."""
    return np.format_float_positional(time, precision=4, trim="-")
