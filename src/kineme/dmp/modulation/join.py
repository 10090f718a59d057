"""Several movements as one, one after another.

The paths are laid out over time and learned again as one primitive whose basis functions are as dense in time as those
of the densest part. They overlap across the transitions, so position, velocity and acceleration are continuous
everywhere, as in T. Kulvicius, K. Ning, M. Tamosiunaite, F. Worgotter, "Joining Movement Sequences: Modified Dynamic
Movement Primitives for Robotics Applications Exemplified on Handwriting", IEEE Transactions on Robotics 28(1), 2012,
which lets the kernels of two movements overlap. Ours are fitted anew, so the path stays near its parts; giving these a
common velocity and acceleration at each transition, by an exact solve, bends them more. docs/guide/modulation.md holds
both as `python -m bench --only joining` measures them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, overload

import numpy as np

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.discrete.rollout import Rollout
from kineme.dmp.modulation.carried_over import carried_over
from kineme.dmp.modulation.parts import moving
from kineme.dmp.modulation.refit import fitting_specification, refitted, smooth_rise
from kineme.dmp.pose.in_tangent import rates_in_tangent
from kineme.dmp.pose.pose_primitives import PosePrimitives
from kineme.dmp.pose.pose_rollout import PoseRollout
from kineme.dmp.pose.unwrap import unwrapped
from kineme.errors import SpecificationError
from kineme.movements.rotations.quaternions import conjugate, product
from kineme.validation import Array, check_number

_SAMPLES = 2_000  # of each part, between which a straight line is 1e-6 of the extent off


@overload
def join(parts: Sequence[Primitives | Rollout], *, shift: bool = ..., overlap: float = ...) -> Primitives: ...
@overload
def join(
    parts: Sequence[PosePrimitives | PoseRollout], *, shift: bool = ..., overlap: float = ...
) -> PosePrimitives: ...
def join(
    parts: Sequence[Primitives | Rollout] | Sequence[PosePrimitives | PoseRollout],
    *,
    shift: bool = False,
    overlap: float = 0.0,
) -> Primitives | PosePrimitives:
    """One movement out of several, one after another; smooth in velocity and acceleration.

    Each part begins where the one before it ends, and goes on to its own goal, or as far as it was shown to go
    (`shift`). Learned again from the path of all, the result is rolled out, saved, controlled and recognized like any
    other primitive. Its start, goal and the velocities there are exact; in between it deviates by tenths of a percent
    of its extent from the parts, near the transitions.

    Parameters
    ----------
    parts : sequence of Primitives or Rollout, or of PosePrimitives or PoseRollout
        Of one movement each, or some of them of n: then n movements come out.
    shift : bool, default False
        Move each part to where the one before it ends, goal and all; else its goal stays where it was. Orientations are
        turned as a tool that is mounted otherwise: angular velocities stay.
    overlap : float, default 0.0
        Time [s] for which two neighbors go on together: the end of one fades into the beginning of the next, which
        begins that much earlier. It cuts the corner instead of slowing down in it.

    Returns
    -------
    Primitives, or PosePrimitives of poses
        With the specification of the first part, ``fit="trajectory"``, and as many basis functions per second as
        that part which has most; the movements of a batch share one specification, so all have as many as the one that
        needs most. Labels and names are kept where they are those of all parts, channels if all were recorded as the
        same; discrete channels step when they did in the parts, those of each part until the next one begins.

    Raises
    ------
    TrajectoryError
        No part, something else than primitives and rollouts, different dimensions or numbers of movements; channels
        that are known to differ, as joint angles and positions; orientations farther than a full turn from the last.
    SpecificationError
        An overlap that is negative or longer than half a part; more than 2,000 basis functions.
    """
    movements = moving(parts, poses=True)
    durations = np.stack([one.durations for one in movements])  # (parts, n)
    check_number("overlap", overlap, least=0.0)
    if len(movements) > 1 and overlap > 0.5 * durations.min():
        raise SpecificationError(
            f"expected overlap of at most half the shortest part, {0.5 * durations.min():.3g} s, got {overlap:g} s"
        )
    plain = [one for one in movements if isinstance(one, Primitives)]
    turning = [one for one in movements if isinstance(one, PosePrimitives)]
    laid, references = laid_out_poses(turning, shift) if turning else (laid_out(plain, shift), None)
    begins = np.vstack((np.zeros(durations.shape[1]), np.cumsum(durations[:-1] - overlap, axis=0)))
    total = begins[-1] + durations[-1]
    dmp = fitting_specification(
        movements, float(total.max() * max(one.dmp.n_basis / one.durations.min() for one in movements))
    )
    times = total[:, None] * np.linspace(0.0, 1.0, dmp.n_points)
    rises = [smooth_rise(times - begin[:, None], overlap) for begin in begins[1:]]
    shares = [a - b for a, b in zip([np.ones_like(times), *rises], [*rises, np.zeros_like(times)], strict=True)]
    path = np.zeros((*times.shape, laid[0].positions.shape[2]))
    for part, begin, share in zip(laid, begins, shares, strict=True):
        path += share[:, :, None] * _at(part.positions, (times - begin[:, None]) / part.durations[:, None])
    when = [np.column_stack((a, a + b)) / total[:, None] for a, b in zip(begins, durations, strict=True)]
    ends = (laid[0].begin_velocities, laid[-1].positions[:, -1], laid[-1].end_velocities)
    made = carried_over(refitted(dmp, path, times, ends), movements, when, begins[1:] / total)
    return made if references is None else PosePrimitives(replace(made, recorded_as=None), references, made.recorded_as)


def _at(x: Array, u: Array) -> Array:
    """Positions (n, T, d) at normalized times (n, T), of each movement its own, from even samples (n, S, d)."""
    place = np.clip(u, 0.0, 1.0) * (x.shape[1] - 1)
    before = np.minimum(place.astype(np.intp), x.shape[1] - 2)[:, :, None]
    share = place[:, :, None] - before
    return np.asarray((1.0 - share) * np.take_along_axis(x, before, 1) + share * np.take_along_axis(x, before + 1, 1))


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
