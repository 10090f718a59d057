"""Two movements over one phase, whose places keep a difference over a stretch: two arms that carry one thing.

With the changes of both weights in one vector, what is asked for is linear in it as via points are,

    Phi_right(u) dW_right - Phi_left(u) dW_left = offset - (x_right - x_left)        for u in the stretch,

and goals and end velocities stay. Both give: the most probable change of both together, under the covariances of
`kineme.dmp.discrete.modulate`: of single demonstrations, so that the sum of both mean square accelerations of
the change is least; of averages, as their demonstrations differ.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from kineme.dmp.discrete.dmp import Primitives
from kineme.dmp.discrete.modulate import SLACK, changes, mixed_factor, path_variance, smooth_factor
from kineme.dmp.discrete.operators import decoder_at, smoothness_factor
from kineme.dmp.discrete.rollout import Rollout
from kineme.dmp.discrete.via_points import per_movement
from kineme.dmp.join import moving, within
from kineme.dmp.styles.average import AveragePrimitive
from kineme.errors import ExtrapolationWarning, SpecificationError, TrajectoryError, warn
from kineme.validation import Array, as_numbers

_PER_BASIS = 2  # points of the stretch for each basis function in it
_LOOSE = 1e-3  # of the extent: a difference that is kept less closely is said


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
        Something else than primitives and rollouts, different dimensions or numbers of movements; channels
        that are known to differ, as joint angles and positions; an offset of the wrong shape.
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
    n_times = math.ceil(_PER_BASIS * max(arm.dmp.n_basis for arm in arms) * (end - begin)) + 2
    times = tuple(np.linspace(begin, end, n_times).tolist())
    paths = [_at(arm, times) for arm in arms]  # (n, d, K)
    wanted = _offset(offset, paths[1] - paths[0])
    coupled = [
        replace(arm, scaled_weights=arm.scaled_weights + change)
        for arm, change in zip(arms, _shared(arms, spread, times, wanted - (paths[1] - paths[0])), strict=True)
    ]
    missing = np.abs(_at(coupled[1], times) - _at(coupled[0], times) - wanted)
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


def _at(arm: Primitives, times: tuple[float, ...]) -> Array:
    """Positions (n, d, K) at any times."""
    response = decoder_at(arm.dmp, times)
    path = arm.scaled_weights @ response.Phi[0].T + arm.starts[:, :, None]
    path += (arm.goals - arm.starts)[:, :, None] * response.goal[0]
    path += (arm.velocities * arm.durations[:, None])[:, :, None] * response.velocity[0]
    return np.asarray(path)


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
