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

from kineme.dmp.discrete.dmp import DMP, Primitives
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
    spread = [_spread(one) for one in (left, right)]
    arms = moving([one.primitive if isinstance(one, AveragePrimitive) else one for one in (left, right)])
    begin, end = within(during, "during")
    if begin == 0.0 or end == 1.0:
        raise SpecificationError(
            f"expected during=(begin, end) above 0 and below 1, got {during!r}; starts and goals say what it is there"
        )
    longer = np.maximum(*(one.durations for one in arms))
    arms = [Primitives.from_rollout(one.rollout(duration=longer)) for one in arms]
    times = _times([one.dmp for one in arms], (begin, end))
    paths = [_at(one, times) for one in arms]  # (n, d, K)
    wanted = _offset(offset, paths[1] - paths[0])
    made = [
        replace(one, scaled_weights=one.scaled_weights + change)
        for one, change in zip(arms, _shared(arms, spread, times, wanted - (paths[1] - paths[0])), strict=True)
    ]
    _warn_loose(made, times, wanted)
    return made[0], made[1]


def _times(dmps: list[DMP], stretch: tuple[float, float]) -> tuple[float, ...]:
    n = math.ceil(_PER_BASIS * max(dmp.n_basis for dmp in dmps) * (stretch[1] - stretch[0]))
    return tuple(np.linspace(*stretch, n + 2).tolist())


def _at(one: Primitives, times: tuple[float, ...]) -> Array:
    """Positions (n, d, K) at any times."""
    response = decoder_at(one.dmp, times)
    path = one.scaled_weights @ response.Phi[0].T + one.starts[:, :, None]
    path += (one.goals - one.starts)[:, :, None] * response.goal[0]
    path += (one.velocities * one.durations[:, None])[:, :, None] * response.velocity[0]
    return np.asarray(path)


def _offset(offset: ArrayLike | None, difference: Array) -> Array:
    """What the difference is to be (n, d, 1), NaN where it is free."""
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


def _spread(one: Primitives | Rollout | AveragePrimitive) -> Array | None:
    """Factor (r, d, N) of the covariance of the demonstrations' weights, where there are several."""
    shown = one.factor[:, :, :-3] if isinstance(one, AveragePrimitive) else np.zeros(0)
    return shown if shown.any() else None


def _shared(arms: list[Primitives], spread: list[Array | None], times: tuple[float, ...], errors: Array) -> list[Array]:
    """The changes of both arms' weights (n, d, N), the most probable ones together."""
    n, d, k = errors.shape
    along = [decoder_at(one.dmp, (*times, 1.0)).Phi for one in arms]
    kept = block_diag(*(np.vstack((Phi[0, -1], Phi[1, -1])) for Phi in along))  # goals and velocities there
    observed = np.vstack((np.hstack((-along[0][0, :-1], along[1][0, :-1])), kept))
    rows, slack = np.concatenate((errors, np.zeros((n, d, 4))), axis=2), np.repeat((SLACK, 0.0), (k, 4))
    if all(one is None for one in spread):
        factor = block_diag(*(smoothness_factor(one.dmp) for one in arms))
        both = changes(factor, observed, rows.reshape(n * d, -1), slack).reshape(n, d, -1)
        return np.split(both, [arms[0].dmp.n_basis], axis=2)
    # All dimensions at once: the numbers of one arm, dimension after dimension, then those of the other.
    factor = block_diag(*_scaled_factors(arms, spread))
    every_dim = np.hstack([np.kron(np.eye(d), part) for part in np.split(observed, [arms[0].dmp.n_basis], axis=1)])
    both = changes(factor, every_dim, rows.reshape(n, -1), np.tile(slack, d))
    parts = np.split(both, [d * arms[0].dmp.n_basis], axis=1)
    return [part.reshape(n, d, -1) for part in parts]


def _scaled_factors(arms: list[Primitives], spread: list[Array | None]) -> list[Array]:
    """Of the covariance of each arm's weights (d N); one that was shown once varies as much as the other, smoothly."""
    known = next((one.dmp, shown) for one, shown in zip(arms, spread, strict=True) if shown is not None)
    variance, d = path_variance(*known), known[1].shape[1]
    return [
        smooth_factor(one.dmp, d, variance) if shown is None else mixed_factor(one.dmp, shown)
        for one, shown in zip(arms, spread, strict=True)
    ]


def _warn_loose(made: list[Primitives], times: tuple[float, ...], wanted: Array) -> None:
    missing = np.abs(_at(made[1], times) - _at(made[0], times) - wanted)
    worst = np.where(np.isnan(missing), 0.0, missing).max(axis=(1, 2))
    extents = np.maximum(*(one.extents.max(axis=1) for one in made))
    if (worst > _LOOSE * extents).any():
        i = int(np.argmax(worst / extents))
        warn(
            f"the difference of movements {i} is {worst[i]:.3g} off, {100 * worst[i] / extents[i]:.2g} % of their "
            "extent: it bends more than the basis functions can; use more of them, or a shorter stretch",
            ExtrapolationWarning,
            stacklevel=3,
        )
