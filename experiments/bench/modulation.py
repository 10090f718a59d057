"""10,000 movements through via points: beside as many plain ones, and how closely the points are met."""

from __future__ import annotations

import numpy as np

from bench.movements import even_movements
from bench.rows import Row
from bench.timing import medians
from kineme import DMP

N_SAMPLES, N_BASIS, N_DIMS = 200, 40, 3
SHARES = (0.3, 0.5, 0.75)
LEAST = 0.5  # of the speed of plain rollouts
CLOSEST = 1e-6  # of the extent


def measure(quick: bool) -> list[Row]:
    n, repeats = (1_000, 5) if quick else (10_000, 30)
    primitive = DMP(n_basis=N_BASIS, n_points=N_SAMPLES).learn(even_movements(1, N_SAMPLES, N_DIMS))[0]
    rng, extent = np.random.default_rng(0), float(primitive.extents.max())
    goals = primitive.goals + 0.2 * extent * rng.normal(size=(n, N_DIMS))
    plain = primitive.rollout(goal=goals, n_samples=401).positions
    places = [round(400 * share) for share in SHARES]
    via = [
        (share, plain[:, k] + 0.1 * extent * rng.normal(size=(n, N_DIMS)))
        for share, k in zip(SHARES, places, strict=True)
    ]
    through = primitive.rollout(goal=goals, via=via, n_samples=401).positions
    missed = max(float(np.abs(through[:, k] - points).max()) for k, (_, points) in zip(places, via, strict=True))
    seconds = medians(
        {
            "plain": lambda: primitive.rollout(goal=goals).positions,
            "via": lambda: primitive.rollout(goal=goals, via=via).positions,
            "end": lambda: primitive.rollout(goal=goals, via=via, end_velocity=goals - primitive.goals).positions,
        },
        repeats,
    )
    details = {"n": n, "n_dims": N_DIMS, "n_samples": N_SAMPLES, "n_basis": N_BASIS, "repeats": repeats}
    details["seconds"] = seconds
    rows = [
        Row(
            f"{n} rollouts {what}",
            "ms",
            1e3 * seconds[name],
            1e3 * seconds["plain"],
            "plain rollouts",
            seconds["plain"] / seconds[name],
            (">=", LEAST),
            details,
        )
        for name, what in (("via", "through 3 via points each"), ("end", "through 3 via points, with an end velocity"))
    ]
    return [*rows, Row("via points missed by, share of the extent", "", missed / extent, target=("<=", CLOSEST))]
