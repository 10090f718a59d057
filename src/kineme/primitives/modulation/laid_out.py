"""Parts of a movement where they lie one after another, in the coordinates that are learned."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kineme.movements.rotations.quaternions import conjugate, product
from kineme.primitives.discrete.dmp import Primitives
from kineme.primitives.pose.in_tangent import rates_in_tangent
from kineme.primitives.pose.pose_primitives import PosePrimitives
from kineme.primitives.pose.pose_rollout import PoseRollout
from kineme.primitives.pose.unwrap import unwrapped
from kineme.validation import Array

_SAMPLES = 2_000  # of each part, between which a straight line is 1e-6 of the extent off


class LaidOut(NamedTuple):
    """n movements of one part."""

    durations: Array  # (n,)
    positions: Array  # (n, S, d), at even times
    begin_velocities: Array  # (n, d)
    end_velocities: Array  # (n, d)


def laid_out(movements: Sequence[Primitives], shift: bool) -> list[LaidOut]:
    """Each part from where the one before it ends, to its own goal or, shifted, as far as it was shown to go."""
    laid: list[LaidOut] = []
    for one in movements:
        start = laid[-1].positions[:, -1] if laid else one.starts
        goal = one.goals + (start - one.starts) if shift else one.goals
        path = one.rollout(start, goal, n_samples=_SAMPLES)
        laid.append(LaidOut(path.durations, path.positions, path.velocities[:, 0], path.velocities[:, -1]))
    return laid


def laid_out_poses(movements: Sequence[PosePrimitives], shift: bool) -> tuple[list[LaidOut], Array]:
    """The same of poses, in positions and rotation vectors from the last orientations of all, and these (n, 4 k).

    A shifted part is turned as a tool that is mounted otherwise: its angular velocities stay.

    Raises
    ------
    TrajectoryError
        Orientations farther than a full turn from the last one, about an axis that changes.
    """
    rolled: list[PoseRollout] = []
    for one in movements:
        start = rolled[-1].positions[:, -1] if rolled else one.starts
        rolled.append(one.rollout(start, _shifted(one, start) if shift else one.goals, n_samples=_SAMPLES))
    m = movements[0].n_positions
    turned = np.concatenate([path.orientations for path in rolled], axis=1)
    references = turned[:, -1].copy()
    vectors = _vectors(turned, references)
    laid = []
    for i, (one, path) in enumerate(zip(movements, rolled, strict=True)):
        here = vectors[:, i * _SAMPLES : (i + 1) * _SAMPLES]
        places = np.concatenate((path.positions[:, :, :m], here), axis=2)
        begin, end = (rates_in_tangent(path.velocities[:, k], places[:, k], m, "velocity") for k in (0, -1))
        assert begin is not None
        assert end is not None
        laid.append(LaidOut(one.durations, places, begin, end))
    return laid, references


def _shifted(one: PosePrimitives, starts: Array) -> Array:
    """The goals of poses that begin elsewhere."""
    m, own, goals = one.n_positions, one.starts, one.goals
    q, q_own, q_goal = (columns[:, m:].reshape(len(columns), -1, 4) for columns in (starts, own, goals))
    turned = product(q_goal, product(conjugate(q_own), q))
    return np.concatenate((goals[:, :m] + starts[:, :m] - own[:, :m], turned.reshape(len(turned), -1)), axis=1)


def _vectors(turned: Array, references: Array) -> Array:
    """Rotation vectors (n, T, 3 k) of orientations (n, T, 4 k) from the references, continuous along each movement."""
    n, n_samples, width = turned.shape
    offsets = np.arange(n + 1) * n_samples

    def where(row: int) -> str:
        return f"part {row % n_samples // _SAMPLES} of movement {row // n_samples}"

    parts = []
    for at in range(0, width, 4):
        relative = product(turned[:, :, at : at + 4], conjugate(references[:, None, at : at + 4]))
        parts.append(unwrapped(relative.reshape(-1, 4), offsets, where).reshape(n, n_samples, 3))
    vectors = np.concatenate(parts, axis=2)
    vectors[:, -1] = 0.0  # but for rounding they are
    return vectors
