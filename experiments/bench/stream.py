"""The rate that a live stream holds: processor time of each update over whole movements, and of `finish`."""

from __future__ import annotations

import time

import numpy as np

import kineme
from bench.movements import SEED
from bench.rows import Row
from bench.space import lifted
from kineme.movements.preparation.perturbations import Perturbation

RATE = 100.0  # Hz
_PERTURBATION = Perturbation(shift=1.0, scale=1.0, rotation=np.radians(20), warp=0.35, noise=0.01)


def measure(quick: bool) -> list[Row]:
    lasa = kineme.load_lasa()
    rows = []
    for n_dims, words in ((2, "the plane"), (3, "space")):
        shown = lasa if n_dims == 2 else lifted(lasa)
        for n in (52,) if quick else (100, 500):
            known = _perturbed(shown, n, SEED)
            recognizer = kineme.Recognizer().fit(known, known.labels)
            updates, ends = _timed(recognizer, _perturbed(shown, 3 if quick else 5, SEED + 1))
            slow = float(np.percentile(updates, 99))
            details = {"samples": len(updates), "rate": RATE, "perturbation": repr(_PERTURBATION), "seed": SEED}
            named = f"{n} demonstrations in {words}"
            rows += [
                Row(f"an update, {named}, median", "ms", 1e3 * float(np.median(updates)), details=details),
                Row(f"rate that 99 of 100 updates hold, {named}", "Hz", 1 / slow, target=(">=", RATE), details=details),
                Row(f"finish, {named}, slowest", "ms", 1e3 * max(ends), details=details),
            ]
    return rows


def _perturbed(demos: kineme.Demonstrations, n: int, seed: int) -> kineme.Demonstrations:
    return _PERTURBATION.apply(demos[np.random.default_rng(seed).integers(len(demos), size=n)], seed)


def _timed(recognizer: kineme.Recognizer, movements: kineme.Demonstrations) -> tuple[list[float], list[float]]:
    """Processor seconds of every update and of every end; the first movement warms up."""
    updates: list[float] = []
    ends: list[float] = []
    live = recognizer.stream()
    for i, one in enumerate(movements):
        live.reset()
        times = np.arange(one.times[0], one.times[-1], 1 / RATE)
        samples = np.column_stack([np.interp(times, one.times, x) for x in one.positions.T])
        took = []
        for t, x in zip(times, samples, strict=True):
            start = time.process_time()
            live.update(t, x)
            took.append(time.process_time() - start)
        start = time.process_time()
        live.finish()
        if i:
            updates += took
            ends.append(time.process_time() - start)
    return updates, ends
