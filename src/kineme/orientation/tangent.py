"""From orientations to rotation vectors relative to the goal, where an ordinary DMP applies, and back."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from kineme.errors import TrajectoryError
from kineme.orientation.quaternions import conjugate, normalized_rows, product
from kineme.orientation.rotation_vectors import exp
from kineme.orientation.unwrap import unwrapped
from kineme.trajectories.demonstrations import Demonstrations
from kineme.trajectories.preprocess import Step, preprocess
from kineme.validation import Array, describe

COLUMNS = (4, 7)


def to_tangent(movements: Any, steps: Iterable[Step] = ()) -> tuple[Demonstrations, Array]:
    """Replace quaternion columns by the rotation vector from the goal to the orientation, continuous along time.

    ``p(t) = 2 log(q(t) conj(q_goal))``, in the world frame, so that ``q(t) = exp(p(t)) q_goal`` and p ends at 0.
    Koutras and Doulgeri (2020) write ``e_Q = 2 log(q_goal conj(q)) = -p``; the DMP is linear, so the movement is one.

    Parameters
    ----------
    movements : Demonstrations, Trajectory, sequence of Trajectory or of arrays, or (n, T, d) array
        d = 4: orientations (w, x, y, z). d = 7: poses, a position and an orientation.
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
    demos = Demonstrations.of(movements)
    if demos.n_dims not in COLUMNS:
        raise TrajectoryError(
            "expected movements of 4 columns, an orientation (w, x, y, z), or 7, a position (x, y, z) and an "
            f"orientation, got {demos.n_dims} columns"
        )
    offsets, names = demos.offsets, demos.names

    def where(row: int) -> str:
        i = int(np.searchsorted(offsets, row, side="right")) - 1
        return f"{describe(i, names)}: sample {row - offsets[i]}"

    q = normalized_rows(demos.positions[:, -4:], where)
    references = q[offsets[1:] - 1]
    p = unwrapped(product(q, conjugate(np.repeat(references, demos.lengths, axis=0))), offsets, names)
    tangent = _with_positions(demos, np.concatenate((demos.positions[:, :-4], p), axis=1))
    steps = tuple(steps)
    if not steps:
        return tangent, references
    return to_tangent(from_tangent(preprocess(tangent, steps), references))


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
    return Demonstrations.of_movements(replace(demos.movements, positions=positions), demos.steps)
