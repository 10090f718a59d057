"""From orientations to rotation vectors relative to the goal, where an ordinary DMP applies, and back."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from kineme.dmp.pose.unwrap import unwrapped
from kineme.errors import TrajectoryError
from kineme.movements.channels.channel import Channels, is_plain, learned_names
from kineme.movements.channels.coordinates import as_wxyz, columns_of
from kineme.movements.preparation.preprocess import Step, preprocess
from kineme.movements.rotations.quaternions import conjugate, normalized_rows, product
from kineme.movements.rotations.rotation_vectors import exp
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements_like import MovementsLike
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
        d = 4: orientations (w, x, y, z). d = 7: poses, a position and an orientation. Movements with `channels` may be
        any mixture of p positions and angles with k >= 1 orientations; their columns are taken with the positions and
        angles first, and discrete channels are left out.
    steps : iterable of preprocessing steps, default ()
        Applied to positions and rotation vectors; the goal is read again from what remains.

    Returns
    -------
    demonstrations : Demonstrations
        Of 3 dimensions (rotation vector [rad]), 6 (position, rotation vector) or p + 3 k, with the times, labels and
        names.
    references : ndarray of shape (n, 4 k)
        The goal orientations q_goal, one after the other.

    Raises
    ------
    TrajectoryError
        Another number of columns; a quaternion that is not of norm 1; more than a full turn about a changing axis.
    """
    demos, k = with_orientations_last(movements)
    tangent, references = _to_tangent(demos, k)
    steps = tuple(steps)
    if not steps:
        return tangent, references
    return _to_tangent(from_tangent(preprocess(tangent, steps), references), k)


def _to_tangent(demos: Demonstrations, k: int) -> tuple[Demonstrations, Array]:
    """`to_tangent` of movements whose last columns are k orientations."""
    p = demos.n_dims - 4 * k
    positions, references = np.empty((len(demos.positions), p + 3 * k)), np.empty((len(demos), 4 * k))
    positions[:, :p] = demos.positions[:, :p]

    def tile(start: int, stop: int) -> None:
        rows = slice(demos.offsets[start], demos.offsets[stop])
        for i in range(k):
            goals, vectors = _rotation_vectors(demos, slice(p + 4 * i, p + 4 * i + 4), start, stop)
            references[start:stop, 4 * i : 4 * i + 4] = goals
            positions[rows, p + 3 * i : p + 3 * i + 3] = vectors

    for_tiles(tile, len(demos), max(1, _TILE_SAMPLES * len(demos) // len(positions)))
    return _with_positions(demos, positions), references


def with_orientations_last(movements: MovementsLike) -> tuple[Demonstrations, int]:
    """Movements in columns with the orientations (w, x, y, z) last, and how many these are.

    Raises
    ------
    TrajectoryError
        Movements without known channels that are of other than 4 or 7 columns.
    """
    demos = Demonstrations.of(movements)
    k = sum(one.kind == "orientation" for one in demos.channels or ())
    if k and demos.channels is not None:
        return _with_positions(demos, np.concatenate(_columns(demos.channels, demos.recorded), axis=1)), k
    return as_poses(demos), 1


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
        return _with_positions(demos, np.concatenate(_columns(demos.channels, demos.recorded), axis=1))
    if demos.n_dims not in COLUMNS:
        raise TrajectoryError(
            "expected movements of 4 columns, an orientation (w, x, y, z), or 7, a position (x, y, z) and an "
            f"orientation, got {demos.n_dims} columns"
        )
    return demos


def _columns(channels: Channels, recorded: Array) -> list[Array]:
    """The positions and angles, and after them the orientations as (w, x, y, z)."""
    named = list(zip(channels, columns_of(channels), strict=True))
    positions = [recorded[:, columns] for one, columns in named if one.kind in ("position", "angle")]
    return positions + [as_wxyz(recorded[:, columns], one) for one, columns in named if one.kind == "orientation"]


def _rotation_vectors(demos: Demonstrations, columns: slice, start: int, stop: int) -> tuple[Array, Array]:
    """Goals (m, 4) and rotation vectors (samples, 3) of the orientation in these columns, of movements start:stop."""
    first, last = demos.offsets[[start, stop]]
    offsets = demos.offsets[start : stop + 1] - first

    def where(row: int) -> str:
        i = int(np.searchsorted(offsets, row, side="right")) - 1
        return f"{describe(start + i, demos.names)}: sample {row - offsets[i]}"

    q = normalized_rows(demos.positions[first:last, columns], where)
    goals = q[offsets[1:] - 1]
    relative = product(q, conjugate(np.repeat(goals, np.diff(offsets), axis=0)))
    p = unwrapped(relative, offsets, where)
    p[offsets[1:] - 1] = 0.0  # but for rounding they are
    # Rounding is no movement, and no axis that the original formulation could divide by.
    flat = np.maximum.reduceat(np.abs(p), offsets[:-1]) < _ROUNDING
    p[np.repeat(flat, np.diff(offsets), axis=0)] = 0.0
    return goals, p


def from_tangent(tangent: Demonstrations, references: Array) -> Demonstrations:
    """The inverse of `to_tangent`: ``q = exp(p) q_goal``, movements of 4 or 7 columns, or of p + 4 k.

    Parameters
    ----------
    tangent : Demonstrations
        Of 3 or 6 dimensions, or of p + 3 k.
    references : ndarray of shape (n, 4 k)
        The goal orientations.
    """
    n_vectors = 3 * (references.shape[1] // 4)
    vectors = tangent.positions[:, -n_vectors:].reshape(len(tangent.positions), -1, 3)
    q = product(exp(vectors), np.repeat(references.reshape(len(references), -1, 4), tangent.lengths, axis=0))
    columns = np.concatenate((tangent.positions[:, :-n_vectors], q.reshape(len(q), -1)), axis=1)
    return _with_positions(tangent, columns)


def _with_positions(demos: Demonstrations, positions: Array) -> Demonstrations:
    return Demonstrations.of_movements(
        replace(demos.movements, positions=positions, dimensions=None, channels=None, recorded=None), demos.steps
    )
