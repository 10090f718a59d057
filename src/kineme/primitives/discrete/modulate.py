"""Movements changed as little as possible so that they pass where they are asked to: via points and end velocity.

A path is linear in its weights W, so what is asked for at some times is ``A W = b`` with A the rows of the decode
matrix at these times, and the most probable change of the weights that grants it is one small solve,

    W += Sigma A' (A Sigma A' + eps I)^-1 e,        e = b - A W,

the same for all movements of a batch; see `kineme.primitives.condition`. Two rows are always among those of A: the
goal, at the end, and the velocity there. The forcing term acts on neither the start nor the velocity there.

Source: Y. Zhou, J. Gao, T. Asfour, "Learning Via-Movement Primitives with Inter- and Extrapolation Capabilities",
IROS 2019, Eq. (9) to (11). There Sigma is the covariance of the demonstrations' weights. Our choice where there is one
demonstration only, and beside those where there are few: Sigma is such that the change of the path has the least mean
square acceleration (`smoothness_factor`), as a cubic spline has. See docs/modulation.md for what was measured.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import ExtrapolationWarning
from kineme.primitives.condition import condition
from kineme.primitives.discrete.operators import decoder, decoder_at, smoothness_factor
from kineme.primitives.discrete.per_movement import broadcast_length, per_movement
from kineme.primitives.discrete.position_limits import within_limits
from kineme.primitives.discrete.rollout import Change, Rollout
from kineme.primitives.discrete.specification import Specification
from kineme.primitives.discrete.via_points import ViaLike, ViaPoints, via_points
from kineme.validation import Array

_WORTH = 10.0  # demonstrations; so much the smoothness of changes counts beside the spread of demonstrations
_SLACK = 1e-6  # of a row's own deviation: of the points of a stretch, which may be more than can be met
_LOOSE = 1e-3  # of the extent: a stretch that is met less closely is said
_WIDE = 3.0  # times the extent and what is missing: a change that leads farther away is said
_LOOKS = 3  # samples of a change for each basis function


def modulated(
    movement: Rollout,
    via: ViaLike | None,
    end_velocity: ArrayLike | None,
    position_limits: tuple[ArrayLike, ArrayLike] | None = None,
    factor: Array | None = None,
) -> Rollout:
    """The movement through the via points, with the end velocity and within the limits.

    Parameters
    ----------
    movement : Rollout
        As asked for otherwise.
    via, end_velocity, position_limits
        As in `Primitives.rollout`.
    factor : ndarray of shape (r, d, N), optional
        Of the covariance of the demonstrations' scaled weights.
    """
    if via is None and end_velocity is None and position_limits is None:
        return movement
    d = movement.starts.shape[1]
    asked = via_points(() if via is None else via, d)
    velocity = per_movement(end_velocity, "end_velocity", d)
    n = broadcast_length(len(movement), {"via": asked.points, "end_velocity": velocity}, "movements")
    movement = movement if len(movement) == n else movement[np.zeros(n, dtype=np.intp)]
    observed = _observed(movement.primitives.dmp, tuple(asked.times.tolist()))
    errors = _errors(movement, asked, velocity, observed)
    _warn_far(movement, asked, errors)
    if factor is None or not factor.any():
        change = _smooth_change(movement, asked, observed, errors)
    else:
        change = _shown_change(movement, asked, observed, errors, factor)
    missing = errors - change.coefficients @ (change.directions @ observed.weights.T) if asked.stretch.any() else None
    if missing is None or not _warn_loose(movement, asked, missing):
        _warn_wide(movement, change, _distances(asked, errors))
    fixed = movement.fixed_velocity or (velocity is not None and bool(velocity.any()))
    movement = replace(movement, change=change, fixed_velocity=fixed)
    return (
        movement
        if position_limits is None
        else within_limits(movement, position_limits, asked.points, observed.weights, _slack(asked))
    )


class _Observed(NamedTuple):
    """K linear functions of a movement: its places at the via points, at the end, and the velocity there."""

    weights: Array  # (K, N)
    goal: Array  # (K,)
    velocity: Array  # (K,)
    moving_goal: Array  # (K,)


@lru_cache(maxsize=32)
def _observed(dmp: Specification, times: tuple[float, ...]) -> _Observed:
    response = decoder_at(dmp, (*times, 1.0))
    return _Observed(*(np.concatenate((part[0], part[1, -1:])) for part in response))


@lru_cache(maxsize=32)
def _smooth_gain(dmp: Specification, times: tuple[float, ...]) -> Array:
    return condition(smoothness_factor(dmp), _observed(dmp, times).weights).gain


def _errors(movement: Rollout, asked: ViaPoints, velocity: Array | None, observed: _Observed) -> Array:
    """What is missing (n, d, K) at the via points, at the goal, and of the velocity there; NaN where it is free."""
    k, durations = len(asked.times), movement.durations[:, None]
    own = movement.primitives.scaled_weights
    errors = -(own.reshape(-1, own.shape[2]) @ observed.weights.T).reshape(*own.shape[:2], -1)
    errors = errors * movement.ratio[:, :, None]
    errors -= (movement.goals - movement.starts)[:, :, None] * observed.goal
    errors -= (movement.velocities_at_start * durations)[:, :, None] * observed.velocity
    errors -= movement.goal_steps[:, :, None] * observed.moving_goal
    errors[:, :, :k] += asked.points.transpose(0, 2, 1) - movement.starts[:, :, None]
    errors[:, :, k] += movement.arrivals - movement.starts
    errors[:, :, k + 1] = 0.0 if velocity is None else errors[:, :, k + 1] + velocity * durations
    return errors


def _smooth_change(movement: Rollout, asked: ViaPoints, observed: _Observed, errors: Array) -> Change:
    """The change with the least mean square acceleration; few coefficients where all points are met."""
    dmp = movement.primitives.dmp
    rows = errors.reshape(-1, errors.shape[2])
    if asked.stretch.any():
        dense = changes(smoothness_factor(dmp), observed.weights, rows, _slack(asked))
        return Change(dense.reshape(*errors.shape[:2], -1), np.eye(dmp.n_basis))
    gain = _smooth_gain(dmp, tuple(asked.times.tolist()))
    if not np.isfinite(np.sum(rows)):  # free places follow from the others
        found = changes(smoothness_factor(dmp), observed.weights, rows, _slack(asked))
        errors = (found @ observed.weights.T).reshape(errors.shape)
    return Change(errors, gain)


def _shown_change(movement: Rollout, asked: ViaPoints, observed: _Observed, errors: Array, factor: Array) -> Change:
    """The change that is likely after the demonstrations' covariance, all dimensions at once."""
    dmp, (n, d, _) = movement.primitives.dmp, errors.shape
    scale = np.where(movement.ratio == 0.0, 1.0, movement.ratio)[:, :, None]  # the deviations scale like the weights
    rows = (errors / scale).reshape(n, -1)
    every_dim = np.asarray(np.kron(np.eye(d), observed.weights), dtype=np.float64)
    change = changes(_mixed_factor(dmp, factor), every_dim, rows, np.tile(_slack(asked), d))
    return Change(change.reshape(n, d, -1) * scale, np.eye(dmp.n_basis))


def _slack(asked: ViaPoints) -> Array:
    return np.append(np.where(asked.stretch, _SLACK, 0.0), (0.0, 0.0))


def changes(factor: Array, observed: Array, errors: Array, slack: Array) -> Array:
    """The most probable changes (m, p) with ``observed @ change = errors`` (m, k), of which NaN need not be met.

    `slack` (k,) is the deviation of each, as a share of what it is under the covariance ``factor.T @ factor``.
    """
    slack = slack * np.linalg.norm(observed @ factor.T, axis=1)
    known = np.isfinite(errors)
    if known.all():
        return np.asarray(errors @ condition(factor, observed, slack).gain)
    patterns, which = np.unique(known, axis=0, return_inverse=True)
    found = np.empty((len(errors), observed.shape[1]))
    for i, pattern in enumerate(patterns):  # of free dimensions: few, however many movements
        rows = np.flatnonzero(which.ravel() == i)
        found[rows] = errors[rows][:, pattern] @ condition(factor, observed[pattern], slack[pattern]).gain
    return found


def _mixed_factor(dmp: Specification, factor: Array) -> Array:
    """Of the covariance of all weights (d N): r demonstrations' spread, and smoothness that is worth ten of them.

    r demonstrations vary in r directions only. The share of the smooth changes is ``10 / (r + 10)``, and they are as
    large: they have the same mean variance of the path.
    """
    r, d, _ = factor.shape
    Phi, smooth = decoder(dmp, dmp.n_points).Phi[0], smoothness_factor(dmp)
    size = np.sqrt(np.sum((factor @ Phi.T) ** 2) / d / np.sum((smooth @ Phi.T) ** 2))
    share = _WORTH / (r + _WORTH)
    shown = np.sqrt(1.0 - share) * factor.reshape(r, -1)
    return np.vstack((shown, np.sqrt(share) * size * np.kron(np.eye(d), smooth)))


def _extents(movement: Rollout) -> Array:
    """How large each movement is (n,): the diagonal of its bounding box."""
    sides = np.maximum(movement.primitives.extents, np.abs(movement.arrivals - movement.starts))
    return np.asarray(np.sqrt(np.einsum("nd,nd->n", sides, sides)))


def _distances(asked: ViaPoints, errors: Array) -> Array:
    """Of the paths from the via points (n, k), in the dimensions that are not free."""
    missing = errors[:, :, : len(asked.times)]
    missing = np.where(np.isnan(missing), 0.0, missing)
    return np.asarray(np.sqrt(np.einsum("ndk,ndk->nk", missing, missing)))


def _warn_far(movement: Rollout, asked: ViaPoints, errors: Array) -> None:
    """Say how far a via point is from the path as it is, if that is farther than the movement is large."""
    distances, extents = _distances(asked, errors), _extents(movement)
    far = distances > extents[:, None]
    if far.any():
        i, j = np.unravel_index(int(np.argmax(distances / extents[:, None])), far.shape)
        warnings.warn(
            f"{far.any(axis=1).sum()} of {len(far)} movements have a via point outside what was demonstrated: the one "
            f"at {asked.times[j]:g} of the duration is {distances[i, j]:.3g} from the path of movement {i} at that "
            f"time, which is {extents[i]:.3g} large; check its unit and frame, or demonstrate such a movement",
            ExtrapolationWarning,
            stacklevel=4,
        )


def _warn_loose(movement: Rollout, asked: ViaPoints, missing: Array) -> bool:
    """Say how far a movement stays from a stretch that it cannot follow; whether there is one."""
    distances = _distances(asked, missing).max(axis=1)
    share = distances / _extents(movement)
    loose = bool((share > _LOOSE).any())
    if loose:
        i = int(np.argmax(share))
        warnings.warn(
            f"movement {i} stays {distances[i]:.3g} from its via stretch, {100 * share[i]:.2g} % of its extent: the "
            f"stretch bends more than {movement.primitives.dmp.n_basis} basis functions can; use more, or fewer points",
            ExtrapolationWarning,
            stacklevel=4,
        )
    return loose


def _warn_wide(movement: Rollout, change: Change, distances: Array) -> None:
    """Say how far a change leads a movement away from its path, if that is much farther than what was missing."""
    dmp, extents = movement.primitives.dmp, _extents(movement)
    much = _WIDE * np.maximum(extents, distances.max(axis=1, initial=0.0))
    looks = change.directions @ decoder(dmp, _LOOKS * dmp.n_basis).Phi[0].T
    farthest = (np.abs(change.coefficients) @ np.abs(looks).max(axis=1)).max(axis=1)  # at most
    near = np.flatnonzero(farthest > much)
    farthest[near] = np.abs(change.coefficients[near] @ looks).max(axis=(1, 2))
    wide = farthest > much
    if wide.any():
        i = int(np.argmax(np.where(wide, farthest / extents, 0.0)))
        warnings.warn(
            f"{wide.sum()} of {len(wide)} movements are led far away by their via points or end velocity: movement {i} "
            f"by {farthest[i]:.3g}, which is {extents[i]:.3g} large; different places at almost the same time, or "
            "close to the start or the end, need high velocities: move their times apart, or ask for a lower velocity",
            ExtrapolationWarning,
            stacklevel=4,
        )
