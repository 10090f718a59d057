"""From orientations to rotation vectors relative to the goal, where an ordinary DMP applies, and back."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from kineme.errors import TrajectoryError
from kineme.movements.channels.channel import Channels, is_plain, learned_names
from kineme.movements.channels.coordinates import as_wxyz, columns_of
from kineme.movements.preparation.preprocess import Step, preprocess
from kineme.movements.rotations.quaternions import conjugate, normalized_rows, product
from kineme.movements.rotations.rotation_vectors import exp
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements_like import MovementsLike
from kineme.primitives.pose.unwrap import unwrapped
from kineme.runtime.parallel import for_tiles
from kineme.validation import Array, describe

COLUMNS = (4, 7)
_ROUNDING = 1e-13  # rad; below it quaternions do not know whether they turn
_TILE_SAMPLES = 10_000  # samples in one tile: with its intermediate results it stays in a core's cache


def to_tangent(movements: MovementsLike, steps: Iterable[Step] = ()) -> tuple[Demonstrations, Array]:
    """Replace quaternion columns by the rotation vector from the goal to the orientation, continuous along time.

    ``p(t) = 2 log(q(t) conj(q_goal))``, in the world frame, so that ``q(t) = exp(p(t)) q_goal`` and p ends at 0.
    Koutras and Doulgeri (2020) write ``e_Q = 2 log(q_goal conj(q)) = -p``; the DMP is linear, so the movement is one.

    Parameters
    ----------
    movements : Demonstrations, Trajectory, sequence of Trajectory or of arrays, or (n, T, d) array
        d = 4: orientations (w, x, y, z). d = 7: poses, a position and an orientation. Movements whose `channels` are
        an orientation, with or without three positions, and any discrete ones, are taken as recorded.
    steps : iterable of preprocessing steps, default ()
        Applied to positions and rotation vectors; the goal is read again from what remains.

    Returns
    -------
    demonstrations : Demonstrations
        Of 3 dimensions (rotation vector [rad]) or 6 (position, rotation vector), with the times, labels and names.
    references : ndarray of shape (n, 4)
        The goal orientations q_goal.

    Raises
    ------
    TrajectoryError
        Another number of columns; a quaternion that is not of norm 1; more than a full turn about a changing axis.
    """
    demos = as_poses(movements)
    positions = np.empty((len(demos.positions), demos.n_dims - 1))
    positions[:, :-3] = demos.positions[:, :-4]
    references = np.empty((len(demos), 4))

    def tile(start: int, stop: int) -> None:
        rows = slice(demos.offsets[start], demos.offsets[stop])
        references[start:stop], positions[rows, -3:] = _rotation_vectors(demos, start, stop)

    for_tiles(tile, len(demos), max(1, _TILE_SAMPLES * len(demos) // len(positions)))
    tangent = _with_positions(demos, positions)
    steps = tuple(steps)
    if not steps:
        return tangent, references
    return to_tangent(from_tangent(preprocess(tangent, steps), references))


def as_poses(movements: MovementsLike) -> Demonstrations:
    """Movements of 4 columns (w, x, y, z) or 7, a position before it; see `to_tangent`.

    Raises
    ------
    TrajectoryError
        Another number of columns, or channels that are no pose.
    """
    demos = Demonstrations.of(movements)
    if demos.channels is not None and not is_plain(demos.channels):
        kinds = [one.kind for one in demos.channels]
        if kinds.count("orientation") != 1 or len(learned_names(demos.channels)) not in (3, 6):
            raise TrajectoryError(
                "expected channels that are an orientation, or an orientation and three positions, got "
                f"{', '.join(f'{one.name} ({one.kind})' for one in demos.channels)}; "
                "choose the columns by columns= of read_recordings, in the shell --columns"
            )
        return _with_positions(demos, np.concatenate(_pose_columns(demos.channels, demos.recorded), axis=1))
    if demos.n_dims not in COLUMNS:
        raise TrajectoryError(
            "expected movements of 4 columns, an orientation (w, x, y, z), or 7, a position (x, y, z) and an "
            f"orientation, got {demos.n_dims} columns"
        )
    return demos


def _pose_columns(channels: Channels, recorded: Array) -> list[Array]:
    """The positions, and after them the orientation as (w, x, y, z)."""
    named = list(zip(channels, columns_of(channels), strict=True))
    positions = [recorded[:, columns] for one, columns in named if one.kind in ("position", "angle")]
    return positions + [as_wxyz(recorded[:, columns], one) for one, columns in named if one.kind == "orientation"]


def _rotation_vectors(demos: Demonstrations, start: int, stop: int) -> tuple[Array, Array]:
    """Goals (m, 4) and rotation vectors (samples, 3) of movements start:stop."""
    first, last = demos.offsets[[start, stop]]
    offsets = demos.offsets[start : stop + 1] - first

    def where(row: int) -> str:
        i = int(np.searchsorted(offsets, row, side="right")) - 1
        return f"{describe(start + i, demos.names)}: sample {row - offsets[i]}"

    q = normalized_rows(demos.positions[first:last, -4:], where)
    goals = q[offsets[1:] - 1]
    relative = product(q, conjugate(np.repeat(goals, np.diff(offsets), axis=0)))
    p = unwrapped(relative, offsets, where)
    p[offsets[1:] - 1] = 0.0  # but for rounding they are
    # Rounding is no movement, and no axis that the original formulation could divide by.
    flat = np.maximum.reduceat(np.abs(p), offsets[:-1]) < _ROUNDING
    p[np.repeat(flat, np.diff(offsets), axis=0)] = 0.0
    return goals, p


def from_tangent(tangent: Demonstrations, references: Array) -> Demonstrations:
    """The inverse of `to_tangent`: ``q = exp(p) q_goal``, movements of 4 or 7 columns.

    Parameters
    ----------
    tangent : Demonstrations
        Of 3 or 6 dimensions.
    references : ndarray of shape (n, 4)
        The goal orientations.
    """
    q = product(exp(tangent.positions[:, -3:]), np.repeat(references, tangent.lengths, axis=0))
    return _with_positions(tangent, np.concatenate((tangent.positions[:, :-3], q), axis=1))


def _with_positions(demos: Demonstrations, positions: Array) -> Demonstrations:
    return Demonstrations.of_movements(
        replace(demos.movements, positions=positions, dimensions=None, channels=None, recorded=None), demos.steps
    )
