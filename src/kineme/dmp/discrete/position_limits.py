"""Positions kept within limits: the smoothest change of the weights under inequalities, a small quadratic program.

With z the change in the coordinates of a covariance factor, minimize |z| under ``low <= path + Phi F' z <= high`` at
the specification's samples, and between them where the path would leave the limits by more than 1e-7 of its extent:
least distance programming, which is a nonnegative least squares problem (C. L. Lawson, R. J. Hanson, "Solving Least
Squares Problems", 1974, chapter 23), and solved by SciPy's. The factor is conditioned on no change at the via
points, at the goal and of the velocity there.
A few problems for each dimension of each movement that leaves the limits, a few milliseconds each; all others cost
nothing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import nnls

from kineme.dmp.condition import condition
from kineme.dmp.discrete.operators import decoder, smoothness_factor
from kineme.dmp.discrete.rollout import Change, Rollout
from kineme.errors import SpecificationError
from kineme.validation import Array, as_numbers

_ROUNDING = 1e-9  # of the extent: so far outside counts as at a limit
_MISSED = 1e-6  # of the largest position: more than this is outside
_FINER = 16  # instants for each sample of the specification, at which a path is looked at
_BETWEEN = 1e-7  # of the extent: what may be outside at one of these instants
_ROUNDS = 8  # of adding instants between samples; two or three are enough
_INFEASIBLE = 1e-8  # residual of the nonnegative problem, 0 where no change is enough


def within_limits(
    movement: Rollout, limits: tuple[ArrayLike, ArrayLike], points: Array, held: Array, slack: Array
) -> Rollout:
    """The movement within limits (low, high), each a number or (d,), with ``held @ W`` (K,) as it is.

    `points` (1 or n, k, d) are those at which it is held, `slack` (K,) how
    loosely, as a share of what each deviates under the covariance: more points of a stretch than can be met are held.

    Raises `SpecificationError`: limits of the wrong shape or order; a start, goal or via point outside; a movement that
    cannot stay inside.
    """
    low, high = as_limits(limits, movement.starts.shape[1])
    dmp = movement.primitives.dmp
    rounding = _ROUNDING * movement.primitives.row("extents").max(axis=1)[:, None]  # (1 or n, 1)
    held_at = {"start": movement.starts[:, None], "goal": movement.arrivals[:, None], "via points": points}
    for name, places in held_at.items():
        outside = (places < low - rounding[:, None]) | (places > high + rounding[:, None])
        if outside.any():
            i, j, k = (int(index) for index in np.argwhere(outside)[0])
            raise SpecificationError(
                f"expected the {name} within the position limits, got {places[i, j, k]:g} in dimension {k} of movement "
                f"{i}, where they are {low[k]:g} and {high[k]:g}"
            )
    near = _near(movement, low, high, rounding)
    if not near.any():
        return movement
    smooth, fine = smoothness_factor(dmp), _FINER * (dmp.n_points - 1) + 1
    Phi = decoder(dmp, fine).Phi[0]
    deviation = slack * np.linalg.norm(held @ smooth.T, axis=1)
    factors: dict[bytes, tuple[Array, Array]] = {}  # of the rows that are held: few, however many movements
    dense = np.zeros((*movement.starts.shape, dmp.n_basis))
    for i in np.flatnonzero(near.any(axis=1)).tolist():
        path = replace(movement[i : i + 1], n_samples=fine, end=1.0).positions[0]
        for k in np.flatnonzero(near[i]).tolist():
            held_rows = np.append(
                ~np.isnan(points[min(i, len(points) - 1), :, k]), np.ones(len(held) - points.shape[1], bool)
            )
            if held_rows.tobytes() not in factors:
                factor = condition(smooth, held[held_rows], deviation[held_rows]).factor
                factors[held_rows.tobytes()] = factor, Phi @ factor.T
            factor, effect = factors[held_rows.tobytes()]
            tolerance = _BETWEEN * float(movement.primitives.row("extents")[min(i, len(movement.primitives) - 1)].max())
            dense[i, k] = _inside_between(effect, path[:, k], (low[k], high[k]), (i, k), tolerance) @ factor
    if not dense.any():
        return movement
    if movement.change is not None:
        dense += movement.change.coefficients @ movement.change.directions
    return replace(movement, change=Change(dense, np.eye(dmp.n_basis)))


def as_limits(limits: tuple[ArrayLike, ArrayLike], n_dims: int) -> tuple[Array, Array]:
    """Limits (low, high), each (d,), of numbers or arrays.

    Raises `SpecificationError`: no two numbers or (d,) arrays, or low that is not below high.
    """
    try:
        low, high = (np.broadcast_to(as_numbers(limit, "position_limits"), n_dims) for limit in limits)
    except (TypeError, ValueError) as error:
        raise SpecificationError(
            f"expected position_limits=(low, high), each a number or {n_dims} of them, got {limits!r}"
        ) from error
    if not (low < high).all():
        raise SpecificationError(f"expected position_limits with low below high, got {limits!r}")
    return low, high


def _near(movement: Rollout, low: Array, high: Array, rounding: Array) -> NDArray[np.bool_]:
    """Dimensions of movements (n, d) that leave the limits at a sample, or may do so between two of them.

    Between samples h apart a path goes beyond both by ``h^2 |x''| / 8``; counted twice, from differences of samples.
    """
    path = replace(movement, n_samples=movement.primitives.dmp.n_points, end=1.0).positions  # (n, T, d)
    beyond = np.abs(np.diff(path, 2, axis=1)).max(axis=1) / 4 - rounding
    return np.asarray((path.min(axis=1) < low + beyond) | (path.max(axis=1) > high - beyond))


def _inside_between(
    effect: Array, path: Array, limits: tuple[float, float], where: tuple[int, int], tolerance: float
) -> Array:
    """The shortest z (r,) with which the path (T,) is inside at its samples and, but for a tolerance, between them."""
    low, high = limits
    if not (np.maximum(low - path, path - high) > tolerance).any():
        return np.zeros(effect.shape[1])
    bounded = np.zeros(len(path), bool)
    bounded[::_FINER] = True
    for _ in range(_ROUNDS):
        z = _inside(effect[bounded], path[bounded], limits, where)
        reached = path + effect @ z
        beyond = np.maximum(low - reached, reached - high)
        if not (beyond > tolerance).any():
            break
        tops = np.flatnonzero((beyond[1:-1] > tolerance) & (beyond[1:-1] >= np.maximum(beyond[:-2], beyond[2:]))) + 1
        bounded[np.concatenate((tops - 1, tops, tops + 1))] = True
    return z


def _inside(effect: Array, path: Array, limits: tuple[float, float], where: tuple[int, int]) -> Array:
    """The shortest z (r,) with ``low <= path + effect @ z <= high``; `where` is for the message."""
    low, high = limits
    G, h = np.vstack((effect, -effect)), np.concatenate((low - path, path - high))  # G z >= h
    size = np.linalg.norm(G, axis=1)
    felt = np.isfinite(h) & (size > _INFEASIBLE * size.max())  # neither the start nor the end can be changed
    G, h, unit = G[felt], h[felt], np.abs(path).max() + np.abs(h[felt]).max()
    rows = np.vstack((G.T, h / unit))
    solution, residual = nnls(rows, np.eye(1, len(rows), len(rows) - 1)[0])
    rest = rows @ solution
    z = np.asarray(rest[:-1] * unit / max(1.0 - rest[-1], _INFEASIBLE))
    if residual < _INFEASIBLE or (G @ z < h - _MISSED * unit).any():
        raise SpecificationError(
            f"expected a movement that can stay between {low:g} and {high:g} in dimension {where[1]}, movement "
            f"{where[0]} cannot; start more slowly, move the via points inside, or use more basis functions"
        )
    return z
