"""How far joined and coupled movements are from what they are made of, on the 30 shapes of LASA.

One demonstration of each of three shapes in a row, each moved to where the one before it ends: joined by `kineme.join`,
and, instead, changed as little as possible so that neighbors have a common velocity and acceleration where they meet.
"""

from __future__ import annotations

import numpy as np

from bench.movements import Array
from bench.rows import Row
from kineme import DMP, couple, join, load_lasa
from kineme.datasets.lasa import LASA_30
from kineme.dmp import Primitives, Rollout
from kineme.dmp.discrete.operators import condition, decoder, smoothness_factor

STEPS = 500  # of each part
DURING, OFFSET = (0.3, 0.7), (10.0, 0.0)  # of two that carry one thing: shares of the duration, millimeters


def measure(quick: bool) -> list[Row]:
    learned = DMP().learn(load_lasa(LASA_30[: 6 if quick else 30]))[::7]
    n = len(learned)
    rows = [[learned[(k + i) % n] for i in range(3)] for k in range(n)]
    made = [join(parts, shift=True).rollout(n_samples=4 * STEPS + 1) for parts in rows]
    found = {
        "joined": [off(parts, stretches(parts, whole)) for parts, whole in zip(rows, made, strict=True)],
        "common velocity and acceleration": [off(parts, met(parts)) for parts in rows],
        "coupled": [kept(learned[k], learned[(k + 1) % n]) for k in range(n)],
    }
    largest = max(larger_accelerations(parts, whole) for parts, whole in zip(rows, made, strict=True))
    return [
        *(
            Row(f"{what}, {name}", "%", take(100 * np.array(far)))
            for what, far in found.items()
            for name, take in TAKEN
        ),
        Row("largest acceleration of a joined movement, of its parts'", "times", largest),
    ]


TAKEN = (("median", lambda x: float(np.median(x))), ("largest", lambda x: float(x.max())))


def chained(parts: list[Primitives]) -> list[Array]:
    """Paths (T, d) of the parts, each from where the one before it ends."""
    paths: list[Array] = []
    for part in parts:
        path = part.rollout(n_samples=STEPS + 1).positions[0]
        paths.append(path - path[0] + (paths[-1][-1] if paths else path[0]))
    return paths


def off(parts: list[Primitives], paths: list[Array]) -> float:
    """The largest distance from the parts, as a share of the extent of all."""
    shown = chained(parts)
    apart = [np.linalg.norm(one - other, axis=1).max() for one, other in zip(paths, shown, strict=True)]
    return float(max(apart) / np.ptp(np.vstack(shown), axis=0).max())


def stretches(parts: list[Primitives], whole: Rollout) -> list[Array]:
    """The stretches (T, d) of the joined movement that belong to the parts."""
    durations = np.array([part.durations[0] for part in parts])
    ends = np.cumsum(durations)
    when = [np.linspace(end - duration, end, STEPS + 1) for end, duration in zip(ends, durations, strict=True)]
    return [np.column_stack([np.interp(t, whole.times[0], x) for x in whole.positions[0].T]) for t in when]


def larger_accelerations(parts: list[Primitives], whole: Rollout) -> float:
    """The largest acceleration of the joined movement, over that of its parts."""
    own = max(np.abs(part.rollout(n_samples=STEPS + 1).accelerations).max() for part in parts)
    return float(np.abs(whole.accelerations).max() / own)


def met(parts: list[Primitives]) -> list[Array]:
    """The parts, with the mean velocity and acceleration of both where two meet, by the smoothest change."""
    own = [part.rollout(n_samples=STEPS + 1) for part in parts]
    ends = np.array([[(x[0, 0], x[0, -1]) for x in (one.velocities, one.accelerations)] for one in own])
    middle = 0.5 * (ends[1:, :, 0] + ends[:-1, :, 1])  # (2 meetings, velocity and acceleration, d)
    ends[1:, :, 0], ends[:-1, :, 1] = middle, middle
    paths = [_with_ends(one, *pair) for one, pair in zip(parts, ends, strict=True)]
    return [path - path[0] + shown[0] for path, shown in zip(paths, chained(parts), strict=True)]


def _with_ends(one: Primitives, velocities: Array, accelerations: Array) -> Array:
    """The path (T, d) with these at the start and at the end, (2, d) each; start and goal stay."""
    moved, tau = one.rollout(velocity=velocities[0], n_samples=STEPS + 1), one.durations[0]
    Phi = decoder(one.dmp, STEPS + 1).Phi
    observed = np.stack((Phi[0, -1], Phi[1, -1], Phi[2, -1], Phi[2, 0]))
    missing = (
        one.goals[0] - moved.positions[0, -1],
        tau * (velocities[1] - moved.velocities[0, -1]),
        tau**2 * (accelerations[1] - moved.accelerations[0, -1]),
        tau**2 * (accelerations[0] - moved.accelerations[0, 0]),
    )
    change = np.stack(missing, axis=1) @ condition(smoothness_factor(one.dmp), observed).gain
    return np.asarray(moved.positions[0] + (change @ Phi[0].T).T)


def kept(left: Primitives, right: Primitives) -> float:
    """How far the difference of two that are coupled is from what was asked for, as a share of the larger extent."""
    paths = [one.rollout(n_samples=STEPS + 1).positions[0] for one in couple(left, right, DURING, OFFSET)]
    begin, end = (round(STEPS * share) for share in DURING)
    apart = np.abs(paths[1] - paths[0] - OFFSET)[begin : end + 1].max()
    return float(apart / max(left.extents.max(), right.extents.max()))
