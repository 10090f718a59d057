"""What a change through via points should cost least: how near it comes to another demonstration; noisy stretches.

Of the 30 sets of LASA, each demonstration goes to the start and the goal of each other one of its set, and through
points of it at even times. The distance that remains between the two is compared for four covariances of the weights,

    W += Sigma A' (A Sigma A' + eps I)^-1 e,

of which the library takes the first. See docs/guide/modulation.md.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from bench.movements import Array
from bench.rows import Row
from kineme import DMP, load_lasa
from kineme.datasets.lasa import LASA_30
from kineme.dmp import Primitives, Rollout
from kineme.dmp.discrete.modulate import SLACK, changes
from kineme.dmp.discrete.operators import condition, decoder, decoder_at, smoothness_factor, trajectory_columns
from kineme.errors import ExtrapolationWarning

DEMONSTRATIONS = 7  # of each set
STEPS = 480  # of a path, so that even times of 1, 3 and 5 points are among its samples
COUNTS = (1, 3, 5)
N_NOISY, NOISE, STRETCH = 20, 0.01, (0.4, 0.6)  # points, share of the extent, shares of the duration
SEED = 0


class Pairs(NamedTuple):
    """Movements on the way from the start to the goal of others, and these."""

    movements: Primitives
    plain: Rollout
    others: Array  # (n, T, d)
    extents: Array  # (n,)


def measure(quick: bool) -> list[Row]:
    shapes = LASA_30[:3] if quick else LASA_30
    free, gated = (pairs(shapes, dmp) for dmp in (DMP(), DMP(gating="phase")))
    details = {"shapes": len(shapes), "pairs": len(free.others), "seed": SEED}
    rows = [Row("plain", "%", distance(free, free.plain.positions), details=details)]
    for prior, factor in PRIORS.items():
        for name, both, counts in (("", free, COUNTS), (", gated", gated, (3,))):
            for count in counts:
                path = through(both, factor(both.movements.dmp), count)
                rows.append(Row(f"{prior}, {count}{name}", "%", distance(both, path)))
    return rows + noisy(shapes)


def pairs(shapes: tuple[str, ...], dmp: DMP) -> Pairs:
    """Every demonstration with every other one of its set."""
    learned = dmp.learn(load_lasa(shapes))
    first = DEMONSTRATIONS * np.arange(len(shapes))
    two = [(i, j) for i in range(DEMONSTRATIONS) for j in range(DEMONSTRATIONS) if i != j]
    one, other = ((first[:, None] + np.array(two)[:, k]).ravel() for k in (0, 1))
    moving, goal = learned[one], learned[other]
    plain = moving.rollout(goal.starts, goal.goals, n_samples=STEPS + 1)
    return Pairs(moving, plain, goal.rollout(n_samples=STEPS + 1).positions, goal.extents.max(axis=1))


def through(both: Pairs, factor: Array, count: int) -> Array:
    """Paths (n, T, d) through points of the others at even times, by the change that ``factor' factor`` makes likely.

    As in `Primitives.rollout`, the goal is met and the velocity there does not change.
    """
    places = STEPS // (count + 1) * np.arange(1, count + 1)
    dmp, x = both.movements.dmp, both.plain.positions
    at = decoder_at(dmp, (*(places / STEPS).tolist(), 1.0)).Phi
    errors = np.zeros((*x[:, 0].shape, count + 2))
    errors[:, :, :-2] = (both.others - x)[:, places].transpose(0, 2, 1)
    errors[:, :, -2] = both.plain.goals - x[:, -1]
    change = errors @ condition(factor, np.vstack((at[0], at[1, -1]))).gain
    return np.asarray(x + (change @ decoder(dmp, STEPS + 1).Phi[0].T).transpose(0, 2, 1))


def distance(both: Pairs, path: Array) -> float:
    """Mean distance to the others, % of their extents."""
    apart = np.linalg.norm(path - both.others, axis=2).mean(axis=1)
    return float(100 * (apart / both.extents).mean())


def _small_weights(dmp: DMP) -> Array:
    return np.eye(dmp.n_basis)


def _weights_without_curvature(dmp: DMP) -> Array:
    return _factor(np.diff(np.eye(dmp.n_basis), n=2, axis=0))


def _cost_of_the_fit(dmp: DMP) -> Array:
    """What `fit="trajectory"` minimizes."""
    columns, curvature = trajectory_columns(decoder(dmp, dmp.n_points), dmp.K)
    return _factor(np.vstack((columns, math.sqrt(dmp.ridge_strength) * curvature))[:, :-1])


def _factor(penalized: Array) -> Array:
    """Of the covariance (N, N) under which ``|penalized W|^2`` is likely to be small, as `smoothness_factor`."""
    precision = penalized.T @ penalized
    values, vectors = np.linalg.eigh(precision)
    return np.asarray((vectors / np.sqrt(np.maximum(values, 0.0) + 1e-8 * np.trace(precision) / len(values))).T)


#: What is likely -> the factor of its covariance.
PRIORS: dict[str, Callable[[DMP], Array]] = {
    "smooth": smoothness_factor,
    "small weights": _small_weights,
    "weights without curvature": _weights_without_curvature,
    "cost of the fit": _cost_of_the_fit,
}


def noisy(shapes: tuple[str, ...]) -> list[Row]:
    """How far a path is led away by a stretch of noisy points: met as closely as possible, and as the library does."""
    primitives = DMP().learn(load_lasa(shapes))[::DEMONSTRATIONS]
    u, extents = np.linspace(*STRETCH, N_NOISY), primitives.extents.max(axis=1)
    noise = NOISE * extents[:, None, None] * np.random.default_rng(SEED).normal(size=(len(primitives), 2, N_NOISY))
    dmp, plain = primitives.dmp, primitives.rollout(n_samples=1001).positions
    at = decoder_at(dmp, (*u.tolist(), 1.0)).Phi
    observed = np.vstack((at[0], at[1, -1]))
    errors = np.pad(noise, ((0, 0), (0, 0), (0, 2)))
    slack = np.repeat((SLACK, 0.0), (N_NOISY, 2))
    closest = changes(smoothness_factor(dmp), observed, errors.reshape(-1, N_NOISY + 2), slack).reshape(
        *noise.shape[:2], -1
    )
    swung = (closest @ decoder(dmp, 1001).Phi[0].T).transpose(0, 2, 1)
    points = noise.transpose(0, 2, 1) + primitives.rollout(n_samples=96).positions[:, 38:58]  # 0.4 to 0.6 of 95 steps
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ExtrapolationWarning)
        ours = primitives.rollout(via=[(STRETCH, points)], n_samples=1001).positions - plain
    return [
        Row(f"led away by a noisy stretch, {what}", "extents", float(np.median(np.abs(x).max(axis=(1, 2)) / extents)))
        for what, x in (("met as closely as possible", swung), ("as rollout does", ours))
    ]
