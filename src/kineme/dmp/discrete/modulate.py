"""Movements changed as little as possible so that they pass where they are asked to: via points and end velocity.

A path is linear in its weights W, so what is asked for at some times is ``A W = b`` with A the rows of the decode
matrix at these times, and the most probable change of the weights that grants it is one small solve,

    W += Sigma A' (A Sigma A' + eps I)^-1 e,        e = b - A W,

the same for all movements of a batch; see `kineme.dmp.condition`. Two rows are always among those of A: the
goal, at the end, and the velocity there. The forcing term acts on neither the start nor the velocity there.

Source: Y. Zhou, J. Gao, T. Asfour, "Learning Via-Movement Primitives with Inter- and Extrapolation Capabilities",
IROS 2019. There Sigma is the covariance of the demonstrations' weights. Our choice where there is one
demonstration only, and beside those where there are few: Sigma is such that the change of the path has the least mean
square acceleration (`smoothness_factor`), as a cubic spline has. See docs/guide/modulation.md for what was measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.dmp.condition import condition
from kineme.dmp.discrete.changes import SLACK, changes, looks_of, loose_changes
from kineme.dmp.discrete.extrapolation import MEASURED, Changed, Measured, extents_of, warn_changed, warn_far
from kineme.dmp.discrete.operators import decoder, decoder_at, smoothness_factor
from kineme.dmp.discrete.per_movement import broadcast_length, per_movement
from kineme.dmp.discrete.position_limits import within_limits
from kineme.dmp.discrete.rollout import Change, Rollout
from kineme.dmp.discrete.specification import Specification
from kineme.dmp.discrete.via_points import ViaLike, ViaPoints, via_points
from kineme.validation import Array

_WORTH = 10.0  # demonstrations; so much the smoothness of changes counts beside the spread of demonstrations


def modulated(
    movement: Rollout,
    via: ViaLike | ViaPoints | None,
    end_velocity: ArrayLike | None,
    position_limits: tuple[ArrayLike, ArrayLike] | None = None,
    factor: Array | None = None,
    measured: Sequence[Measured] = (MEASURED,),
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
    measured : sequence of Measured
        Dimensions whose distances are measured together, when it is said how far movements are led away.
    """
    if via is None and end_velocity is None and position_limits is None:
        return movement
    d = movement.starts.shape[1]
    asked = via if isinstance(via, ViaPoints) else via_points(() if via is None else via, d)
    velocity = per_movement(end_velocity, "end_velocity", d)
    n = broadcast_length(len(movement), {"via": asked.points, "end_velocity": velocity}, "movements")
    movement = movement if len(movement) == n else movement[np.zeros(n, dtype=np.intp)]
    observed = _observed(movement.primitives.dmp, tuple(asked.times.tolist()))
    errors = _errors(movement, asked, velocity, observed)
    for one in measured:
        warn_far(extents_of(movement, one), asked, errors, one)
    if factor is None or not factor.any():
        change = _smooth_change(movement, asked, observed, errors)
    else:
        change = _shown_change(movement, asked, observed, errors, factor)
    left = errors - change.coefficients @ (change.directions @ observed.weights.T) if asked.stretch.any() else None
    looks = looks_of(movement.primitives.dmp)
    for one in measured:
        warn_changed(extents_of(movement, one), asked, errors, Changed(change, left, looks), one)
    fixed = movement.fixed_velocity or (velocity is not None and bool(velocity.any()))
    movement = replace(movement, change=change, fixed_velocity=fixed)
    return (
        movement
        if position_limits is None
        else within_limits(movement, position_limits, asked.points, observed.weights, SLACK * _stretch(asked))
    )


def path_at(movement: Rollout, times: tuple[float, ...]) -> Array:
    """Positions (n, d, k) at any times, as shares of the duration."""
    response = decoder_at(movement.primitives.dmp, times)
    return _along(movement, _Observed(*(part[0] for part in response))) + movement.starts[:, :, None]


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
    k, errors = len(asked.times), -_along(movement, observed)
    errors[:, :, :k] += asked.points.transpose(0, 2, 1) - movement.starts[:, :, None]
    errors[:, :, k] += movement.arrivals - movement.starts
    errors[:, :, k + 1] = 0.0 if velocity is None else errors[:, :, k + 1] + velocity * movement.durations[:, None]
    return errors


def _along(movement: Rollout, observed: _Observed) -> Array:
    """What these functions (n, d, K) of the movement relative to its start are, before it is changed."""
    own = movement.primitives.scaled_weights
    found = (own.reshape(-1, own.shape[2]) @ observed.weights.T).reshape(*own.shape[:2], -1)
    found = found * movement.ratio[:, :, None]
    found += (movement.goals - movement.starts)[:, :, None] * observed.goal
    found += (movement.velocities_at_start * movement.durations[:, None])[:, :, None] * observed.velocity
    found += movement.goal_steps[:, :, None] * observed.moving_goal
    return np.asarray(found)


def _smooth_change(movement: Rollout, asked: ViaPoints, observed: _Observed, errors: Array) -> Change:
    """The change with the least mean square acceleration; few coefficients where all points are met."""
    dmp = movement.primitives.dmp
    rows = errors.reshape(-1, errors.shape[2])
    if asked.stretch.any():
        dense = loose_changes(looks_of(dmp), smoothness_factor(dmp), observed.weights, rows, _stretch(asked))
        return Change(dense.reshape(*errors.shape[:2], -1), np.eye(dmp.n_basis))
    gain = _smooth_gain(dmp, tuple(asked.times.tolist()))
    if not np.isfinite(np.sum(rows)):  # free places follow from the others
        found = changes(smoothness_factor(dmp), observed.weights, rows, np.zeros(rows.shape[1]))
        errors = (found @ observed.weights.T).reshape(errors.shape)
    return Change(errors, gain)


def _shown_change(movement: Rollout, asked: ViaPoints, observed: _Observed, errors: Array, factor: Array) -> Change:
    """The change that is likely after the demonstrations' covariance, all dimensions at once."""
    dmp, (n, d, _) = movement.primitives.dmp, errors.shape
    scale = np.where(movement.ratio == 0.0, 1.0, movement.ratio)[:, :, None]  # the deviations scale like the weights
    rows = (errors / scale).reshape(n, -1)
    every_dim = np.asarray(np.kron(np.eye(d), observed.weights), dtype=np.float64)
    change = loose_changes(looks_of(dmp), mixed_factor(dmp, factor), every_dim, rows, np.tile(_stretch(asked), d))
    return Change(change.reshape(n, d, -1) * scale, np.eye(dmp.n_basis))


def _stretch(asked: ViaPoints) -> Array:
    """1 for each of the rows (K,) that belongs to a stretch, 0 for the others."""
    return np.append(asked.stretch.astype(np.float64), (0.0, 0.0))


def mixed_factor(dmp: Specification, factor: Array) -> Array:
    """Of the covariance of all weights (d N): r demonstrations' spread, and smoothness that is worth ten of them.

    r demonstrations vary in r directions only. The share of the smooth changes is ``10 / (r + 10)``, and they are as
    large: they have the same mean variance of the path.
    """
    r, d, _ = factor.shape
    share = _WORTH / (r + _WORTH)
    shown = np.sqrt(1.0 - share) * factor.reshape(r, -1)
    return np.vstack((shown, np.sqrt(share) * smooth_factor(dmp, d, path_variance(dmp, factor))))


def smooth_factor(dmp: Specification, n_dims: int, variance: float) -> Array:
    """Of the covariance of all weights (d N) under which smooth changes are likely, of a mean variance of the path."""
    smooth = smoothness_factor(dmp)
    size = np.sqrt(variance / path_variance(dmp, smooth[:, None]))
    return np.asarray(size * np.kron(np.eye(n_dims), smooth))


def path_variance(dmp: Specification, factor: Array) -> float:
    """Mean over time and dimensions of the path's variance, of the weights' covariance by its factor (r, d, N)."""
    paths = factor @ decoder(dmp, dmp.n_points).Phi[0].T
    return float(np.sum(paths**2)) / (paths.shape[1] * paths.shape[2])
