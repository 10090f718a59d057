"""Movements changed: 10,000 conditioned samples and paths through via points beside plain ones; chosen specifications.

`DMP.choose` is compared with the default at samples that neither has learned: every second one of LASA's and, where
the folder that KINEME_RECORDINGS names has them, of capital letters and gestures in space; see by_person.py.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from bench.by_person import FOLDER
from bench.movements import Array
from bench.rows import Row
from kineme import DMP, Trajectory, improve, load_lasa
from kineme.styles import average

N, REPEATS, SEED = 10_000, 7, 0
NOISES = (0.0, 0.003, 0.01, 0.03)  # shares of the extent
N_SAMPLES = 2001


def measure(quick: bool) -> list[Row]:
    n = N // 10 if quick else N
    return [*speeds(n), *tried(5 if quick else 30), *chosen(10 if quick else 1)]


def speeds(n: int) -> list[Row]:
    """How many times as fast as plain ones, in one run; at least half as fast is wanted."""
    primitives = DMP().learn(load_lasa(["GShape"]))
    plain = average(primitives)
    point = plain.primitive.rollout(n_samples=101).positions[0, 40] + [2.0, -1.0]
    conditioned = plain.condition(t=0.4, position=point)
    goals = primitives.goals[0] + np.random.default_rng(SEED).normal(size=(n, 2))
    points = point + np.random.default_rng(SEED).normal(size=(n, 2))
    pairs: dict[str, tuple[Callable[[], Array], Callable[[], Array]]] = {
        f"{n:,} samples of a conditioned average": (
            lambda: conditioned.sample(n, SEED).rollout().positions,
            lambda: plain.sample(n, SEED).rollout().positions,
        ),
        f"{n:,} paths to other goals through a via point": (
            lambda: primitives[0].rollout(goal=goals, via=[(0.4, points)]).positions,
            lambda: primitives[0].rollout(goal=goals).positions,
        ),
    }
    rows = []
    for what, (ours, peer) in pairs.items():
        taken = np.array([[_seconds(ours), _seconds(peer)] for _ in range(REPEATS)]).min(axis=0)
        rows.append(Row(what, "/s", n / taken[0], n / taken[1], "plain", taken[1] / taken[0], (">=", 0.5)))
    return rows


def _seconds(call: Callable[[], Array]) -> float:
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def tried(n_seeds: int) -> list[Row]:
    """Rollouts until a point 30 % of the extent away is met to 1 % of it."""
    primitive = DMP().learn(load_lasa(["CShape"]))[0]
    extent, x = primitive.extents.max(), primitive.rollout().positions[0, 100]
    rows = []
    for method in ("cma-es", "pi-bb"):
        used = []
        for seed in range(n_seeds):
            point = x + 0.3 * extent * np.array([np.cos(2.4 * seed), np.sin(2.4 * seed)])
            found = improve(
                primitive,
                lambda rollout, point=point: np.linalg.norm(rollout.positions[:, 100] - point, axis=1),
                method=method, seed=seed, target=0.01 * extent, updates=100,
            )  # fmt: skip
            used.append(found.costs.size if found.cost <= 0.01 * extent else 10**6)
        details = {"seeds": n_seeds, "median": float(np.median(used))}
        rows.append(
            Row(f"{method}: rollouts to a via point, worst", "", max(used), target=("<=", 400), details=details)
        )
    return rows


def chosen(step: int) -> list[Row]:
    """Mean error at samples left out, % of the extent: no more than the default's wherever there is noise or none."""
    rows = []
    for name, movements in data_sets(step).items():
        extents = [float(np.ptp(movement.positions, axis=0).max()) for movement in movements]
        for noise in NOISES:
            rng = np.random.default_rng(SEED)
            shown = [
                Trajectory(one.times[::2], (one.positions + noise * extent * rng.normal(size=one.positions.shape))[::2])
                for one, extent in zip(movements, extents, strict=True)
            ]
            dmp = DMP().choose(shown).dmp
            ours, peer = (errors(one, movements, shown, extents).mean() for one in (dmp, DMP()))
            what = f"{name}, {100 * noise:g} % noise: N = {dmp.n_basis}, ridge {dmp.ridge:g}"
            rows.append(Row(what, "%", float(ours), float(peer), "default", float(peer / ours), (">=", 0.995)))
    return rows


def errors(dmp: DMP, movements: list[Trajectory], shown: list[Trajectory], extents: list[float]) -> Array:
    """Root mean square distance at the samples that were not shown, % of the extent."""
    found = []
    paths = dmp.learn(shown).rollout(n_samples=N_SAMPLES).positions
    for path, one, known, extent in zip(paths, movements, shown, extents, strict=True):
        u = (one.times[1::2] - known.times[0]) / known.duration
        inside = u <= 1.0
        at = np.column_stack([np.interp(u[inside], np.linspace(0, 1, N_SAMPLES), column) for column in path.T])
        distances = np.sum((at - one.positions[1::2][inside]) ** 2, axis=1)
        found.append(100 * np.sqrt(distances.mean()) / extent)
    return np.array(found)


def data_sets(step: int) -> dict[str, list[Trajectory]]:
    found = {"LASA": list(load_lasa())[::step]}
    for name, file, every in (("letters", "letters2d.npz", 1), ("gestures", "gestures3d.npz", 5)):
        if (FOLDER / file).is_file():
            with np.load(FOLDER / file) as read:
                parts = [np.split(read[key].astype(float), read["offsets"][1:-1]) for key in ("times", "positions")]
            found[name] = [Trajectory(*one) for one in zip(*parts, strict=True)][:: every * step]
    return found
