"""Movements changed as little as possible so that they pass where they are asked to: via points and end velocity.

A path is linear in its weights W, so what is asked for is ``A W = b``, with A the rows of the decode matrix at these
times, and the most probable change of the weights that grants it is one small solve for all movements of a batch,

    W += Sigma A' (A Sigma A' + eps I)^-1 e,        e = b - A W.

Always among the rows of A: the goal, at the end, and the velocity there. Y. Zhou, J. Gao, T. Asfour, "Learning
Via-Movement Primitives with Inter- and Extrapolation Capabilities", IROS 2019, take the covariance of demonstrations
for Sigma. Our choice for one demonstration, and beside few, is the least mean square acceleration
(`smoothness_factor`), as of a cubic spline; docs/guide/modulation.md has what was measured.

The points of a stretch may be more than the basis functions can meet, or noisy, and the path would swing far out beside
them. So each has a deviation, of a millionth of its own under the covariance; where the path swings, larger ones are
tried. `python -m bench --only via_points` measures both on the shapes of LASA.

Positions kept within limits are a small quadratic program: with z the change in the coordinates of a covariance factor,
minimize |z| under ``low <= path + Phi F' z <= high``. It is least distance programming, a nonnegative least squares
problem (C. L. Lawson, R. J. Hanson, "Solving Least Squares Problems", 1974, chapter 23), solved by SciPy's. The factor
is conditioned on no change at via points, at the goal and of the velocity there.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.dmp.control.plan import MISSED, Plan, ViaPlaces, check_one
from kineme.dmp.discrete.operators import Response, condition, decoder, decoder_at, smoothness_factor
from kineme.dmp.discrete.rollout import Change, Rollout
from kineme.dmp.discrete.specification import Specification
from kineme.dmp.discrete.via_points import SHARES, Span, ViaLike, ViaPoints, broadcast_length, per_movement, via_points
from kineme.errors import ExtrapolationWarning, SpecificationError, warn
from kineme.validation import Array, as_numbers

_ROUNDING = 1e-9  # of the extent: so far outside counts as at a limit
_MISSED = 1e-6  # of the largest position: more than this is outside
_FINER = 16  # instants for each sample of the specification, at which a path is looked at
_BETWEEN = 1e-7  # of the extent: what may be outside at one of these instants
_ROUNDS = 8  # of adding instants between samples; two or three are enough
_INFEASIBLE = 1e-8  # residual of the nonnegative problem, 0 where no change is enough

_LOOSE = 1e-3  # of the extent: a stretch that is met less closely is said
_SETTLED = 1e-3  # of the demonstration's largest extent: distance within which a controlled movement has settled
_WIDE = 3.0  # times the extent and what is missing: a change that leads farther away is said


class Measured(NamedTuple):
    """Dimensions of one unit, whose distances are measured together."""

    dims: slice = slice(None)
    unit: str = ""  # with a space before it
    least: float = sys.float_info.min  # the extent of movements that hardly move in these dimensions


MEASURED = Measured()


class Changed(NamedTuple):
    """Change of the weights, and what it does to movements."""

    change: Change
    left: Array | None  # (n, d, K) of what it was to make up for; None where nothing is left
    looks: Array  # (N, T), from weights to the path


def warn_far(
    extents: Array, targets: ViaPoints, errors: Array, measured: Measured = MEASURED, span: Span = SHARES
) -> None:
    """Say how far a via point is from the path, if farther than the movement is large; errors are what is missing."""
    distances, unit = _distances(targets, errors, measured), measured.unit
    far = distances > extents[:, None]
    if far.any():
        i, j = np.unravel_index(int(np.argmax(distances / extents[:, None])), far.shape)
        warn(
            f"{far.any(axis=1).sum()} of {len(far)} movements have a via point outside what was demonstrated: the one "
            f"at {span.where.format(targets.times[j] * span.end)} is {distances[i, j]:.3g}{unit} from the path of "
            f"movement {i} at that time, which is {extents[i]:.3g}{unit} large; check its unit and frame, or "
            "demonstrate such a movement",
            ExtrapolationWarning,
            stacklevel=4,
        )


def warn_changed(
    extents: Array, targets: ViaPoints, errors: Array, changed: Changed, measured: Measured = MEASURED
) -> None:
    """Say how far a movement stays from a stretch that it does not follow, or how far it is led from its path."""
    unit = measured.unit
    asked_for = _distances(targets, errors, measured).max(axis=1, initial=0.0)
    much = _WIDE * np.maximum(extents, asked_for)
    farthest = _farthest(changed, much, measured)
    wide = farthest > much
    missed = np.zeros(len(much)) if changed.left is None else _distances(targets, changed.left, measured).max(axis=1)
    if (missed > _LOOSE * extents).any():
        i = int(np.argmax(missed / extents))
        worst = changed.change._replace(coefficients=changed.change.coefficients[[i]])
        swing = _farthest(changed._replace(change=worst), np.full(1, -1.0), measured)
        message = (
            f"movement {i} stays {missed[i]:.3g}{unit} from its via stretch, {100 * missed[i] / extents[i]:.2g} % of "
            f"its extent, and is led away from its path by {swing[0]:.3g}{unit}, where the stretch is "
            f"{asked_for[i]:.3g}{unit} from it: the stretch bends more than {len(changed.looks)} basis "
            "functions can; smooth its points, as kineme.Smooth does, give fewer of them, or use more basis functions; "
            "AveragePrimitive.condition(t, position, std) passes near points that are not exact"
        )
    elif wide.any():
        i = int(np.argmax(np.where(wide, farthest / extents, 0.0)))
        message = (
            f"{wide.sum()} of {len(wide)} movements are led far away by their via points or end velocity: movement {i}"
            f", {extents[i]:.3g}{unit} large, by {farthest[i]:.3g}{unit}; different places at almost the same "
            "time, or close to the start or the end, need high velocities: move their times apart, or ask for a lower "
            "velocity"
        )
    else:
        return
    warn(message, ExtrapolationWarning, stacklevel=4)


def extents_of(movement: Rollout, measured: Measured) -> Array:
    """Return the sizes (n,) of movements: the diagonal of its bounding box."""
    between = np.abs(movement.arrivals - movement.starts)
    sides = np.maximum(movement.primitives.row("extents"), between)[:, measured.dims]
    return np.maximum(np.sqrt(np.einsum("nd,nd->n", sides, sides)), measured.least)


def _distances(targets: ViaPoints, errors: Array, measured: Measured) -> Array:
    """Of the paths from the via points (n, k), in the dimensions that are not free."""
    missing = errors[:, measured.dims, : len(targets.times)]
    missing = np.where(np.isnan(missing), 0.0, missing)
    return np.asarray(np.sqrt(np.einsum("ndk,ndk->nk", missing, missing)))


def _farthest(changed: Changed, much: Array, measured: Measured) -> Array:
    """Return how far a change leads each movement away in a coordinate (n,); where it is not `much`, at most so far."""
    change, effect = changed.change, changed.change.directions @ changed.looks
    coefficients = change.coefficients[:, measured.dims]
    farthest = (np.abs(coefficients) @ np.abs(effect).max(axis=1)).max(axis=1)
    near = np.flatnonzero(farthest > much)
    farthest[near] = np.abs(coefficients[near] @ effect).max(axis=(1, 2))
    return np.asarray(farthest)


#: Of a row's own deviation: of the points of a stretch, which may be more than can be met.
SLACK = 1e-6
_SLACKS = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
_SWING = 3.0  # times the largest number that is missing: a change that is larger swings
_PRICE = 0.03  # of a change, beside what it leaves missing
_PER_BASIS = 3  # samples of a change for each basis function

_WORTH = 10.0  # demonstrations; so much the smoothness of changes counts beside the spread of demonstrations


def modulated(
    movement: Rollout,
    via: ViaLike | ViaPoints | None,
    end_velocity: ArrayLike | None,
    position_limits: tuple[ArrayLike, ArrayLike] | None = None,
    factor: Array | None = None,
    measured: Sequence[Measured] = (MEASURED,),
) -> Rollout:
    """The movement through the via points, with the end velocity and within the limits; see `Primitives.rollout`.

    `factor` (r, d, N) is of the covariance of demonstrations' weights; distances are measured in `measured` together.
    """
    if via is None and end_velocity is None and position_limits is None:
        return movement
    d = movement.starts.shape[1]
    targets = via_points(() if via is None else via, d)
    velocity = per_movement(end_velocity, "end_velocity", d)
    n = broadcast_length(len(movement), {"via": targets.points, "end_velocity": velocity}, "movements")
    movement = movement if len(movement) == n else movement[np.zeros(n, dtype=np.intp)]
    observed = _observed(movement.primitives.dmp, tuple(targets.times.tolist()))
    k, errors = len(targets.times), -_along(movement, observed)  # (n, d, K), NaN where a place is free
    errors[:, :, :k] += targets.points.transpose(0, 2, 1) - movement.starts[:, :, None]
    errors[:, :, k] += movement.arrivals - movement.starts
    errors[:, :, k + 1] = 0.0 if velocity is None else errors[:, :, k + 1] + velocity * movement.durations[:, None]
    for group in measured:
        warn_far(extents_of(movement, group), targets, errors, group)
    if factor is None or not factor.any():
        change = _smooth_change(movement, targets, observed, errors)
    else:
        change = _shown_change(movement, targets, observed, errors, factor)
    left = errors - change.coefficients @ (change.directions @ observed.Phi.T) if targets.stretch.any() else None
    looks = looks_of(movement.primitives.dmp)
    for group in measured:
        warn_changed(extents_of(movement, group), targets, errors, Changed(change, left, looks), group)
    fixed = movement.fixed_velocity or (velocity is not None and bool(velocity.any()))
    movement = replace(movement, change=change, fixed_velocity=fixed)
    return (
        movement
        if position_limits is None
        else within_limits(movement, position_limits, targets.points, observed.Phi, SLACK * _stretch(targets))
    )


def path_at(movement: Rollout, times: tuple[float, ...]) -> Array:
    """Positions (n, d, k) at any times, as shares of the duration."""
    response = decoder_at(movement.primitives.dmp, times)
    return _along(movement, Response(*(part[0] for part in response))) + movement.starts[:, :, None]


@lru_cache(maxsize=32)
def _observed(dmp: Specification, times: tuple[float, ...]) -> Response:
    """K linear functions of a movement, without the first axis: places at the times and the end, the velocity there."""
    response = decoder_at(dmp, (*times, 1.0))
    return Response(*(np.concatenate((part[0], part[1, -1:])) for part in response))


@lru_cache(maxsize=32)
def _smooth_gain(dmp: Specification, times: tuple[float, ...]) -> Array:
    return condition(smoothness_factor(dmp), _observed(dmp, times).Phi).gain


def _along(movement: Rollout, observed: Response) -> Array:
    """Evaluate these functions (n, d, K) of the movement relative to its start, before it is changed."""
    own = movement.primitives.row("scaled_weights")
    values = (own.reshape(-1, own.shape[2]) @ observed.Phi.T).reshape(*own.shape[:2], -1)
    values = values * movement.ratio[:, :, None]
    values += (movement.goals - movement.starts)[:, :, None] * observed.goal
    values += (movement.velocities_at_start * movement.durations[:, None])[:, :, None] * observed.velocity
    values += movement.goal_steps[:, :, None] * observed.moving_goal
    return np.asarray(values)


def _smooth_change(movement: Rollout, targets: ViaPoints, observed: Response, errors: Array) -> Change:
    """The change with the least mean square acceleration; few coefficients where all points are met."""
    dmp = movement.primitives.dmp
    rows = errors.reshape(-1, errors.shape[2])
    if targets.stretch.any():
        dense = loose_changes(looks_of(dmp), smoothness_factor(dmp), observed.Phi, rows, _stretch(targets))
        return Change(dense.reshape(*errors.shape[:2], -1), np.eye(dmp.n_basis))
    gain = _smooth_gain(dmp, tuple(targets.times.tolist()))
    if not np.isfinite(np.sum(rows)):  # free places follow from the others
        change = changes(smoothness_factor(dmp), observed.Phi, rows, np.zeros(rows.shape[1]))
        errors = (change @ observed.Phi.T).reshape(errors.shape)
    return Change(errors, gain)


def _shown_change(movement: Rollout, targets: ViaPoints, observed: Response, errors: Array, factor: Array) -> Change:
    """The change that is likely after the demonstrations' covariance, all dimensions at once."""
    dmp, (n, d, _) = movement.primitives.dmp, errors.shape
    scale = np.where(movement.ratio == 0.0, 1.0, movement.ratio)[:, :, None]  # the deviations scale like the weights
    rows = (errors / scale).reshape(n, -1)
    every_dim = np.asarray(np.kron(np.eye(d), observed.Phi), dtype=np.float64)
    change = loose_changes(looks_of(dmp), mixed_factor(dmp, factor), every_dim, rows, np.tile(_stretch(targets), d))
    return Change(change.reshape(n, d, -1) * scale, np.eye(dmp.n_basis))


def _stretch(targets: ViaPoints) -> Array:
    """1 for each of the rows (K,) that belongs to a stretch, 0 for the others."""
    return np.append(targets.stretch.astype(np.float64), (0.0, 0.0))


def mixed_factor(dmp: Specification, factor: Array) -> Array:
    """Of the covariance of all weights (d N): r demonstrations' spread, and smoothness with the share 10 / (r + 10)."""
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


def changes(factor: Array, observed: Array, errors: Array, slack: Array) -> Array:
    """The most probable changes (m, p) with ``observed @ change = errors`` (m, k), of which NaN need not be met.

    `slack` (k,) is the deviation of each, as a share of what it is under the covariance ``factor.T @ factor``.
    """
    slack = slack * np.linalg.norm(observed @ factor.T, axis=1)
    given = np.isfinite(errors)
    if given.all():
        return np.asarray(errors @ condition(factor, observed, slack).gain)
    patterns, which = np.unique(given, axis=0, return_inverse=True)
    change = np.empty((len(errors), observed.shape[1]))
    for i, pattern in enumerate(patterns):  # of free dimensions: few, however many movements
        rows = np.flatnonzero(which.ravel() == i)
        change[rows] = errors[rows][:, pattern] @ condition(factor, observed[pattern], slack[pattern]).gain
    return change


def loose_changes(looks: Array, factor: Array, observed: Array, errors: Array, stretch: Array) -> Array:
    """The same (m, p), with rows of a `stretch` (k,) met as closely as the path, by `looks`, does not swing."""
    change = changes(factor, observed, errors, SLACK * stretch)
    if not stretch.any():
        return change
    missing = np.where(np.isnan(errors), 0.0, errors)
    rows = np.flatnonzero(_swing(looks, change) > _SWING * np.abs(missing).max(axis=1))
    if len(rows):
        tried = np.stack([change[rows], *(changes(factor, observed, errors[rows], k * stretch) for k in _SLACKS)])
        left = np.where(np.isnan(errors[rows]), 0.0, missing[rows] - tried @ observed.T)[:, :, stretch > 0.0]
        cost = np.abs(left).max(axis=2) + _PRICE * np.stack([_swing(looks, candidate) for candidate in tried])
        change[rows] = tried[cost.argmin(axis=0), np.arange(len(rows))]
    return change


def _swing(looks: Array, changed: Array) -> Array:
    """The largest change of a coordinate, anywhere along the paths (m,)."""
    paths = changed.reshape(-1, len(looks)) @ looks
    return np.asarray(np.abs(paths).max(axis=1).reshape(len(changed), -1).max(axis=1))


def looks_of(dmp: Specification) -> Array:
    """From weights to the path at as many times as show how far a change leads (N, T)."""
    return decoder(dmp, _PER_BASIS * dmp.n_basis).Phi[0].T


def within_limits(
    movement: Rollout, limits: tuple[ArrayLike, ArrayLike], points: Array, held: Array, slack: Array
) -> Rollout:
    """The movement within limits (low, high), with via points and ``held @ W`` as they are, but for their slack."""
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
    """Limits (low, high), each (d,), of numbers or arrays."""
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
    """Dimensions of movements (n, d) that leave the limits, or may between samples: by ``h^2 |x''| / 8``, doubled."""
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
    from scipy.optimize import nnls  # takes a quarter of a second to load

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


def _ratio(dmp: Specification, learned: Array, extents: Array, goal: Array) -> Array:
    """What scale f of one movement is multiplied by for a goal (d,)."""
    return np.array(dmp.system.ratio(goal[None], learned, extents)[0])


def plan_along(movement: Rollout, n_positions: int, via: ViaPoints | None) -> Plan:
    """The plan of one generated movement through via points, with that many positions, others behind them."""
    check_one(len(movement))
    primitive, own = movement.primitives, movement.change is None
    dmp, d, extents = primitive.dmp, primitive.n_dims, primitive.row("extents")
    x0, tau = movement.starts[0].copy(), float(movement.durations[0])
    learned = primitive.row("goals") - primitive.row("starts") if own else movement.goals - movement.starts
    columns = slice(0, n_positions or None)
    mixing = np.zeros((dmp.n_basis + 1, d + 1))
    mixing[:-1, :-1], mixing[-1, -1] = (primitive.row("scaled_weights") if own else movement.weights)[0].T, 1.0

    return Plan(
        dmp,
        mixing,
        ratio=partial(_ratio, dmp, learned, extents),
        origin=x0,
        goal=movement.goals[0] - x0,
        state=np.vstack((np.zeros(d), movement.velocities_at_start[0] * tau)),
        duration=tau,
        settle=_SETTLED * float(extents.max()),
        n_positions=n_positions,
        via=None
        if via is None
        else ViaPlaces(via.times, via.points[0, :, columns] - x0[columns], MISSED * float(extents.max())),
    )
