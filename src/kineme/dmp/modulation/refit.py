"""A path that was put together from others, learned again: as it is, and exact at both ends."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import solve_triangular

from kineme.dmp.condition import condition
from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.dmp.discrete.fits import trajectory_columns
from kineme.dmp.discrete.operators import decoder
from kineme.dmp.pose.pose_primitives import PosePrimitives
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.validation import Array

_PER_BASIS = 5  # samples of the whole for each basis function


def fitting_specification(parts: Sequence[Primitives | PosePrimitives], n_basis: float) -> DMP:
    """The specification of the first part, with which a path that was generated is fitted as it is.

    Raises
    ------
    SpecificationError
        More than 2,000 basis functions.
    """
    first = parts[0].dmp
    least = max(one.dmp.n_points for one in parts)
    n = math.ceil(n_basis - 1e-9)
    ridge = first.ridge if first.fit == "trajectory" else None
    return replace(
        first,
        n_basis=n,
        n_points=max(least, min(10_000, _PER_BASIS * n)),
        fit="trajectory",
        ridge=ridge,
        preprocessing=(),
    )


def smooth_rise(passed: Array, length: float) -> Array:
    """From 0 to 1 over a length, ``10 z^3 - 15 z^4 + 6 z^5`` with z = passed / length; a step if the length is 0.

    Its first two derivatives are 0 at both ends.
    """
    if length == 0.0:
        return np.asarray(np.where(passed >= 0.0, 1.0, 0.0))
    z = np.clip(passed / length, 0.0, 1.0)
    return np.asarray(z**3 * (10.0 - 15.0 * z + 6.0 * z**2))


def refitted(dmp: DMP, path: Array, times: Array, ends: tuple[Array, Array, Array]) -> Primitives:
    """Learn paths (n, T, d) at times (n, T), under the condition that their ends are exactly those that are given.

    `ends` are the velocities at the start (n, d), the positions at the end, and the velocities there.
    """
    made = dmp.learn(Demonstrations.from_arrays(path, times=list(times)))
    movement = made.rollout(n_samples=2)
    asked = np.stack(ends, axis=2)
    reached = np.stack((made.velocities, movement.positions[:, -1], movement.velocities[:, -1]), axis=2)
    errors = (asked - reached) * np.stack((made.durations, np.ones(len(made)), made.durations), axis=1)[:, None]
    change = errors @ _end_gain(dmp)  # (n, d, N + 1)
    return replace(
        made,
        scaled_weights=made.scaled_weights + change[:, :, :-1] * dmp.K,
        velocities=made.velocities + change[:, :, -1] / made.durations[:, None],
    )


def _end_gain(dmp: DMP) -> Array:
    """From initial velocity, goal and end velocity that are missing to W / K and v0 (3, N + 1), at the least cost.

    The cost is what the fit minimizes, so the result is the fit under these conditions. The inverse of its second
    derivatives is the covariance of `condition`; it keeps the path where it is, but near the ends.
    """
    response = decoder(dmp, dmp.n_points)
    columns, curvature = trajectory_columns(response, dmp.K)
    R = np.linalg.qr(np.vstack((columns, math.sqrt(dmp.ridge_strength) * curvature)), mode="r")
    factor = solve_triangular(R, np.eye(len(R))).T
    start = np.eye(1, dmp.n_basis + 1, dmp.n_basis)
    ends = np.column_stack((response.Phi[:2, -1] * dmp.K, response.velocity[:2, -1]))
    return condition(factor, np.vstack((start, ends))).gain
