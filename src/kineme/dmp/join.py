"""Several movements as one: one after another, or one that turns into another on the way.

The paths are laid out over time and learned again as one primitive whose basis functions are as dense in time as those
of the densest part. They overlap across the transitions, so all is continuous, as in T. Kulvicius, K. Ning, M.
Tamosiunaite, F. Worgotter, "Joining Movement Sequences: Modified Dynamic Movement Primitives for Robotics Applications
Exemplified on Handwriting", IEEE Transactions on Robotics 28(1), 2012. Ours are fitted anew, so the path stays near its
parts; docs/guide/modulation.md holds both as `python -m bench --only joining` measures them.

Two arms that carry one thing keep a difference over a stretch. With the changes of both weights in one vector,

    Phi_right(u) dW_right - Phi_left(u) dW_left = offset - (x_right - x_left)        for u in the stretch,

is linear in it, as via points are, and goals and end velocities stay: the most probable change of both together, under
the covariances of `kineme.dmp.discrete.modulate`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag, solve_triangular

from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.dmp.discrete.modulate import SLACK, changes, mixed_factor, path_at, path_variance, smooth_factor
from kineme.dmp.discrete.operators import condition, decoder, decoder_at, smoothness_factor, trajectory_columns
from kineme.dmp.discrete.rollout import Rollout
from kineme.dmp.discrete.specification import MOST_POINTS
from kineme.dmp.discrete.via_points import per_movement
from kineme.dmp.pose.pose_dmp import PosePrimitives
from kineme.dmp.pose.pose_rollout import PoseRollout, rates_in_tangent
from kineme.dmp.pose.tangent import unwrapped
from kineme.dmp.recorded_as import DiscreteSteps, RecordedAs, concatenated, merged
from kineme.dmp.styles.average import AveragePrimitive
from kineme.errors import ExtrapolationWarning, SpecificationError, TrajectoryError, warn
from kineme.movements.channels.channel import check_alike
from kineme.movements.rotations import conjugate, product
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.validation import Array, as_numbers, check_number

_POINTS_PER_BASIS = 2  # points of the stretch for each basis function in it
_LOOSE = 1e-3  # of the extent: a difference that is kept less closely is said

_PER_BASIS = 5  # samples of the whole for each basis function

_OF_POSES = "; poses are joined with poses, and neither blended nor coupled: learn their positions alone"
#: What to do with parts that are none.
_REMEDIES = {
    "AveragePrimitive": "; pass its primitive, or what it does: average.rollout(via=...)",
    "RhythmicPrimitives": "; a rhythm has no end: record or generate as much of it as is to be moved, and learn that",
    "PosePrimitives": _OF_POSES,
    "PoseRollout": _OF_POSES,
    "RhythmicRollout": "; a rhythm has no end: learn what was generated, kineme.DMP().learn(rollout)",
}

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

    It has the specification of the first part, ``fit="trajectory"``, and as many basis functions per second as that
    part which has most, and that movement which needs most. Labels, names and channels are kept where they are those of
    all parts; discrete channels step when they did in the parts, those of each part until the next one begins.

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

    Raises
    ------
    TrajectoryError
        No part, something else than primitives and rollouts, different dimensions or numbers of movements; channels
        that are known to differ, as joint angles and positions; orientations farther than a full turn from the last.
    SpecificationError
        An overlap that is negative or longer than half a part; more than 2,000 basis functions.
    """
    movements = moving(parts, poses=True)
    durations = np.stack([movement.durations for movement in movements])  # (parts, n)
    check_number("overlap", overlap, least=0.0)
    if len(movements) > 1 and overlap > 0.5 * durations.min():
        raise SpecificationError(
            f"expected overlap of at most half the shortest part, {0.5 * durations.min():.3g} s, got {overlap:g} s"
        )
    turning = isinstance(movements[0], PosePrimitives)
    laid, references = laid_out_poses(movements, shift) if turning else (laid_out(movements, shift), None)
    begins = np.vstack((np.zeros(durations.shape[1]), np.cumsum(durations[:-1] - overlap, axis=0)))
    total = begins[-1] + durations[-1]
    dmp = fitting_specification(
        movements, float(total.max() * max(movement.dmp.n_basis / movement.durations.min() for movement in movements))
    )
    times = total[:, None] * np.linspace(0.0, 1.0, dmp.n_points)
    rises = [smooth_rise(times - begin[:, None], overlap) for begin in begins[1:]]
    shares = [a - b for a, b in zip([np.ones_like(times), *rises], [*rises, np.zeros_like(times)], strict=True)]
    path = np.zeros((*times.shape, laid[0].positions.shape[2]))
    for part, begin, share in zip(laid, begins, shares, strict=True):
        path += share[:, :, None] * _at(part.positions, (times - begin[:, None]) / part.durations[:, None])
    when = [np.column_stack((a, a + b)) / total[:, None] for a, b in zip(begins, durations, strict=True)]
    ends = (laid[0].begin_velocities, laid[-1].positions[:, -1], laid[-1].end_velocities)
    joined = carried_over(refitted(dmp, path, times, ends), movements, when, begins[1:] / total)
    if references is None:
        return joined
    return PosePrimitives(replace(joined, recorded_as=None), references, joined.recorded_as)


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
    for movement in movements:
        start = laid[-1].positions[:, -1] if laid else movement.starts
        goal = movement.goals + (start - movement.starts) if shift else movement.goals
        path = movement.rollout(start, goal, n_samples=_SAMPLES)
        laid.append(LaidOut(path.durations, path.positions, path.velocities[:, 0], path.velocities[:, -1]))
    return laid


def laid_out_poses(movements: Sequence[PosePrimitives], shift: bool) -> tuple[list[LaidOut], Array]:
    """The same of poses, in positions and rotation vectors from the last orientations of all, and these (n, 4 k)."""
    rolled: list[PoseRollout] = []
    for movement in movements:
        start = rolled[-1].positions[:, -1] if rolled else movement.starts
        rolled.append(
            movement.rollout(start, _shifted(movement, start) if shift else movement.goals, n_samples=_SAMPLES)
        )
    m = movements[0].n_positions
    turned = np.concatenate([path.orientations for path in rolled], axis=1)
    references = turned[:, -1].copy()
    vectors = _vectors(turned, references)
    laid = []
    for i, (movement, path) in enumerate(zip(movements, rolled, strict=True)):
        here = vectors[:, i * _SAMPLES : (i + 1) * _SAMPLES]
        places = np.concatenate((path.positions[:, :, :m], here), axis=2)
        begin, end = (rates_in_tangent(path.velocities[:, k], places[:, k], m, "velocity") for k in (0, -1))
        assert begin is not None
        assert end is not None
        laid.append(LaidOut(movement.durations, places, begin, end))
    return laid, references


def _shifted(movement: PosePrimitives, starts: Array) -> Array:
    """The goals of poses that begin elsewhere."""
    m, own, goals = movement.n_positions, movement.starts, movement.goals
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


def moving(parts: Sequence[Any], poses: bool = False) -> list[Any]:
    """All parts as primitives of the same number of movements; all of poses where that is possible and the first is."""
    if (
        isinstance(parts, (Primitives, Rollout, PosePrimitives, PoseRollout))
        or not isinstance(parts, Sequence)
        or not len(parts)
    ):
        raise TrajectoryError(f"expected several movements, as [reach, pour], got {parts!r}")
    poses = poses and isinstance(parts[0], (PosePrimitives, PoseRollout))
    expected = (PosePrimitives, PoseRollout) if poses else (Primitives, Rollout)
    for i, movement in enumerate(parts):
        if not isinstance(movement, expected):
            what, remedy = type(movement).__name__, _REMEDIES.get(type(movement).__name__, "")
            names = " or ".join(kind.__name__ for kind in expected)
            raise TrajectoryError(f"expected {names} as part {i}, got {what}{remedy}")
    own: Any = PosePrimitives if poses else Primitives
    moving: Any = [movement if isinstance(movement, own) else own.from_rollout(movement) for movement in parts]
    n = max(len(movement) for movement in moving)
    for i, movement in enumerate(moving):
        if movement.n_dims != moving[0].n_dims:
            raise TrajectoryError(
                f"part {i}: expected {moving[0].n_dims} dimensions as in part 0, got {movement.n_dims}"
            )
        if len(movement) not in (1, n):
            raise TrajectoryError(f"part {i}: expected one movement or {n}, got {len(movement)}")
    check_alike([movement.moving_channels for movement in moving])
    return [movement if len(movement) == n else movement[np.zeros(n, dtype=np.intp)] for movement in moving]


def within(stretch: tuple[float, float], name: str) -> tuple[float, float]:
    """A stretch (begin, end) as shares of the duration."""
    try:
        begin, end = (float(bound) for bound in stretch)
    except (TypeError, ValueError) as error:
        raise SpecificationError(f"expected {name}=(begin, end), shares of the duration, got {stretch!r}") from error
    if not 0.0 <= begin < end <= 1.0:
        raise SpecificationError(
            f"expected {name} to be 0 <= begin < end <= 1, shares of the duration, got {stretch!r}"
        )
    return begin, end


def fitting_specification(parts: Sequence[Primitives | PosePrimitives], n_basis: float) -> DMP:
    """The specification of the first part, with which a path that was generated is fitted as it is."""
    first, n = parts[0].dmp, math.ceil(n_basis - 1e-9)
    n_points = max(min(MOST_POINTS, _PER_BASIS * n), *(part.dmp.n_points for part in parts))
    ridge = first.ridge if first.fit == "trajectory" else None
    return replace(first, n_basis=n, n_points=n_points, fit="trajectory", ridge=ridge, preprocessing=())


def smooth_rise(passed: Array, length: float) -> Array:
    """From 0 to 1 over a length, ``10 z^3 - 15 z^4 + 6 z^5``, with two derivatives of 0 at both ends; or a step."""
    if length == 0.0:
        return np.asarray(np.where(passed >= 0.0, 1.0, 0.0))
    z = np.clip(passed / length, 0.0, 1.0)
    return np.asarray(z**3 * (10.0 - 15.0 * z + 6.0 * z**2))


def refitted(dmp: DMP, path: Array, times: Array, ends: tuple[Array, Array, Array]) -> Primitives:
    """Learn paths (n, T, d) at times (n, T), under the condition that their ends are exactly as given.

    `ends` are the velocities at the start (n, d), the positions at the end, and the velocities there.
    """
    learned = dmp.learn(Demonstrations.from_arrays(path, times=list(times)))
    movement = learned.rollout(n_samples=2)
    wanted = np.stack(ends, axis=2)
    reached = np.stack((learned.velocities, movement.positions[:, -1], movement.velocities[:, -1]), axis=2)
    errors = (wanted - reached) * np.stack((learned.durations, np.ones(len(learned)), learned.durations), axis=1)[
        :, None
    ]
    change = errors @ _end_gain(dmp)  # (n, d, N + 1)
    return replace(
        learned,
        scaled_weights=learned.scaled_weights + change[:, :, :-1] * dmp.K,
        velocities=learned.velocities + change[:, :, -1] / learned.durations[:, None],
    )


def _end_gain(dmp: DMP) -> Array:
    """From initial velocity, goal and end velocity that are missing to W / K and v0 (3, N + 1), at the least cost."""
    response = decoder(dmp, dmp.n_points)
    columns, curvature = trajectory_columns(response, dmp.K)
    R = np.linalg.qr(np.vstack((columns, math.sqrt(dmp.ridge_strength) * curvature)), mode="r")
    factor = solve_triangular(R, np.eye(len(R))).T
    start = np.eye(1, dmp.n_basis + 1, dmp.n_basis)
    ends = np.column_stack((response.Phi[:2, -1] * dmp.K, response.velocity[:2, -1]))
    return condition(factor, np.vstack((start, ends))).gain


def carried_over(
    joined: Primitives, parts: Sequence[Primitives | PosePrimitives], when: Sequence[Array], switches: Array
) -> Primitives:
    """The n movements with the labels, names and channels that all p parts have in common.

    Of each part `when` (n, 2 or more) is the time of even shares of its duration, as a share of the whole; from
    `switches` (p - 1, n) on, discrete channels are those of the next part.
    """
    labels, names = [part.labels for part in parts], [part.names for part in parts]
    first = labels[0]
    same = first is not None and all(other is not None and np.array_equal(other, first) for other in labels)
    about = merged([part.recorded_as for part in parts])
    steps = [part.recorded_as.steps for part in parts if part.recorded_as is not None]
    stepping = [steps_of_part for steps_of_part in steps if steps_of_part is not None]
    if about is not None:
        complete = len(stepping) == len(parts)
        about = RecordedAs(about.channels, _one_after_another(stepping, when, switches) if complete else None)
    return replace(
        joined,
        labels=first if same else None,
        names=names[0] if all(other == names[0] for other in names) else None,
        recorded_as=about,
    )


def _one_after_another(parts: Sequence[DiscreteSteps], when: Sequence[Array], switches: Array) -> DiscreteSteps:
    """The steps of all parts at their new times, each part from one switch to the next."""
    n = len(when[0])
    begins = np.vstack((np.zeros((1, n)), switches))
    ends = np.vstack((switches, np.full((1, n), np.inf)))
    movements = []
    for i in range(n):
        rows = [
            _within(part, i, at[i], (begins[k, i], ends[k, i]))
            for k, (part, at) in enumerate(zip(parts, when, strict=True))
        ]
        value, share = (np.concatenate([row[k] for row in rows]) for k in (0, 1))
        changed = np.append(True, (value[1:] != value[:-1]).any(axis=1))
        movements.append(DiscreteSteps(value[changed], share[changed], np.array([0, changed.sum()])))
    return concatenated(movements)


def _within(part: DiscreteSteps, i: int, when: Array, stretch: tuple[float, float]) -> tuple[Array, Array]:
    """Values (m, c) and times (m,) of movement i: what is in force where the stretch begins, and all steps in it."""
    rows = slice(part.offsets[i], part.offsets[i + 1])
    times = np.interp(part.shares[rows], np.linspace(0.0, 1.0, len(when)), when)
    begin, end = stretch
    first = max(0, int(np.searchsorted(times, begin, side="right")) - 1)
    last = max(first + 1, int(np.searchsorted(times, end, side="left")))
    return part.values[rows][first:last], np.append(begin, times[first + 1 : last])


def blend(first: Primitives | Rollout, second: Primitives | Rollout, stretch: tuple[float, float]) -> Primitives:
    """One movement that begins as the first and ends as the second, and changes from one to the other over a stretch.

    Both go on at the same phase t / tau, ``x = (1 - b) x_first + b x_second``, with b rising from 0 to 1 over the
    stretch, with its first two derivatives: so position, velocity and acceleration are continuous. The tempo changes
    in the same way, discrete channels in the middle of the stretch; the larger number of basis functions is taken.

    Parameters
    ----------
    first, second : Primitives or Rollout
        Of one movement or of n.
    stretch : tuple of float
        Where the change begins and where it ends, as shares of the duration.

    Raises
    ------
    TrajectoryError
        As of `join`.
    SpecificationError
        A stretch that is not within the movement.
    """
    movements = moving([first, second])
    begin, end = within(stretch, "stretch")
    dmp = fitting_specification(movements, max(movement.dmp.n_basis for movement in movements))
    laid = [movement.rollout(n_samples=dmp.n_points) for movement in movements]
    u = np.linspace(0.0, 1.0, dmp.n_points)
    share = smooth_rise(u - begin, end - begin)
    path = (1.0 - share)[:, None] * laid[0].positions + share[:, None] * laid[1].positions
    pace = np.outer(movements[0].durations, 1.0 - share) + np.outer(movements[1].durations, share)  # dt / du
    steps = 0.5 * (pace[:, 1:] + pace[:, :-1]) / (dmp.n_points - 1)
    times = np.concatenate((np.zeros((len(path), 1)), np.cumsum(steps, axis=1)), axis=1)
    shares = times / times[:, -1:]
    switch = np.array([np.interp(0.5 * (begin + end), u, row) for row in shares])
    ends = (laid[0].velocities[:, 0], laid[1].positions[:, -1], laid[1].velocities[:, -1])
    return carried_over(refitted(dmp, path, times, ends), movements, [shares, shares], switch[None])


def couple(
    left: Primitives | Rollout | AveragePrimitive,
    right: Primitives | Rollout | AveragePrimitive,
    during: tuple[float, float],
    offset: ArrayLike | None = None,
) -> tuple[Primitives, Primitives]:
    """Two movements that keep ``x_right - x_left`` as it is asked for, over a stretch of one common phase.

    Both are changed, as little as possible: the sum of the mean square accelerations of their changes is least, and of
    averages they change as their demonstrations differ. Starts, goals and the velocities there stay.

    Parameters
    ----------
    left, right : Primitives, Rollout or AveragePrimitive
        Of one movement or of n, of d dimensions, in one frame. Of an average the mean moves, as its covariance makes
        likely; one that hardly varies lets the other one give.
    during : (begin, end)
        The stretch, above 0 and below 1 as shares of the duration.
    offset : array_like of shape (d,) or (n, d), optional
        x_right - x_left over the stretch, NaN where it is free; by default the mean of what it is over the stretch.

    Returns
    -------
    left, right : Primitives
        Of n movements each, both with the longer of their durations. They are rolled out, saved and controlled as any
        others; give both controllers the same tempo.

    Raises
    ------
    TrajectoryError
        As of `join`; an offset of the wrong shape.
    SpecificationError
        A stretch that is not within the movement; too few basis functions to keep goals and velocities.

    Warns
    -----
    ExtrapolationWarning
        A difference that the basis functions cannot keep.

    Examples
    --------
    >>> import kineme
    >>> learned = kineme.DMP().learn(kineme.load_lasa(["Line", "Angle"]))
    >>> left, right = kineme.couple(learned[0], learned[7], during=(0.3, 0.7))
    """
    factors = [arm.factor[:, :, :-3] if isinstance(arm, AveragePrimitive) else np.zeros(0) for arm in (left, right)]
    spread = [factor if factor.any() else None for factor in factors]
    arms = moving([part.primitive if isinstance(part, AveragePrimitive) else part for part in (left, right)])
    begin, end = within(during, "during")
    if begin == 0.0 or end == 1.0:
        raise SpecificationError(
            f"expected during=(begin, end) above 0 and below 1, got {during!r}; starts and goals say what it is there"
        )
    longer = np.maximum(*(arm.durations for arm in arms))
    arms = [Primitives.from_rollout(arm.rollout(duration=longer)) for arm in arms]
    n_times = math.ceil(_POINTS_PER_BASIS * max(arm.dmp.n_basis for arm in arms) * (end - begin)) + 2
    times = tuple(np.linspace(begin, end, n_times).tolist())
    paths = [path_at(arm.rollout(), times) for arm in arms]  # (n, d, K)
    wanted = _offset(offset, paths[1] - paths[0])
    coupled = [
        replace(arm, scaled_weights=arm.scaled_weights + change)
        for arm, change in zip(arms, _shared(arms, spread, times, wanted - (paths[1] - paths[0])), strict=True)
    ]
    reached = [path_at(arm.rollout(), times) for arm in coupled]
    missing = np.abs(reached[1] - reached[0] - wanted)
    worst = np.where(np.isnan(missing), 0.0, missing).max(axis=(1, 2))
    extents = np.maximum(*(arm.extents.max(axis=1) for arm in coupled))
    if (worst > _LOOSE * extents).any():
        i = int(np.argmax(worst / extents))
        warn(
            f"the difference of movements {i} is {worst[i]:.3g} off, {100 * worst[i] / extents[i]:.2g} % of their "
            "extent: it bends more than the basis functions can; use more of them, or a shorter stretch",
            ExtrapolationWarning,
            stacklevel=2,
        )
    return coupled[0], coupled[1]


def _offset(offset: ArrayLike | None, difference: Array) -> Array:
    """Return the difference that is asked for (n, d, 1), NaN where it is free."""
    if offset is None:
        return np.asarray(difference.mean(axis=2, keepdims=True))
    given = np.asarray(as_numbers(offset, "offset"))
    free = np.isnan(given)
    value = per_movement(np.where(free, 0.0, given), "offset", difference.shape[1])
    assert value is not None
    if len(value) not in {1, len(difference)}:
        raise TrajectoryError(f"expected offset of one movement or of {len(difference)}, got {len(value)}")
    value = np.where(free.reshape(value.shape), np.nan, value)
    return np.asarray(np.broadcast_to(value, difference.shape[:2])[:, :, None])


def _shared(arms: list[Primitives], spread: list[Array | None], times: tuple[float, ...], errors: Array) -> list[Array]:
    """The changes of both arms' weights (n, d, N), the most probable ones together."""
    n, d, k = errors.shape
    along = [decoder_at(arm.dmp, (*times, 1.0)).Phi for arm in arms]
    held = block_diag(*(np.vstack((Phi[0, -1], Phi[1, -1])) for Phi in along))  # goals and velocities there
    observed = np.vstack((np.hstack((-along[0][0, :-1], along[1][0, :-1])), held))
    rows, slack = np.concatenate((errors, np.zeros((n, d, 4))), axis=2), np.repeat((SLACK, 0.0), (k, 4))
    if all(factor_of is None for factor_of in spread):
        factor = block_diag(*(smoothness_factor(arm.dmp) for arm in arms))
        both = changes(factor, observed, rows.reshape(n * d, -1), slack).reshape(n, d, -1)
        return np.split(both, [arms[0].dmp.n_basis], axis=2)
    # All dimensions at once: the numbers of one arm, dimension after dimension, then those of the other.
    # An arm that was shown once varies as much as the other, smoothly.
    dmp, shown = next((arm.dmp, shown) for arm, shown in zip(arms, spread, strict=True) if shown is not None)
    variance = path_variance(dmp, shown)
    factor = block_diag(
        *(
            smooth_factor(arm.dmp, d, variance) if shown is None else mixed_factor(arm.dmp, shown)
            for arm, shown in zip(arms, spread, strict=True)
        )
    )
    every_dim = np.hstack([np.kron(np.eye(d), part) for part in np.split(observed, [arms[0].dmp.n_basis], axis=1)])
    both = changes(factor, every_dim, rows.reshape(n, -1), np.tile(slack, d))
    parts = np.split(both, [d * arms[0].dmp.n_basis], axis=1)
    return [part.reshape(n, d, -1) for part in parts]
