"""What p-values promise with one demonstration of each class: how many true members are rejected at 0.05."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import kineme
from bench.rows import Row
from kineme.movements.preparation.perturbations import Perturbation
from kineme_experiments.evaluation.conditions import TOGETHER

SPREADS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5)
SHOWN = (1, 5)
N_CLASSES, N_MEMBERS, N_SAMPLES, N_WAVES = 10, 20, 80, 5
ERROR_RATE = 0.05
LASA = {"as recorded": Perturbation(), **dict(zip(("weakly", "moderately", "strongly"), TOGETHER, strict=True))}


def measure(quick: bool) -> list[Row]:
    draws = range(2 if quick else 10)
    rows = []
    for n_shown in SHOWN:
        for spread in SPREADS:
            shares = [made_up(spread, n_shown, seed) for seed in draws]
            target = ("<=", 100 * ERROR_RATE) if n_shown > 1 else None  # fifty left-out distances calibrate
            rows.append(_row(f"shapes that differ by {spread:.0%}, {n_shown} shown", shares, target))
    rows += [_row(f"LASA {name}, 1 shown", [lasa(changes, seed) for seed in draws]) for name, changes in LASA.items()]
    return rows


def _row(what: str, shares: list[float], target: tuple[str, float] | None = None) -> Row:
    percent = [100 * share for share in shares]
    return Row(what, "% rejected", float(np.mean(percent)), target=target, details={"by_draw": percent})


def made_up(spread: float, n_shown: int, seed: int) -> float:
    """Share rejected of 20 members of each of ten random shapes; members differ from it by `spread` of its size."""
    rng = np.random.default_rng(seed)
    u = np.linspace(0, 1, N_SAMPLES)
    sines = np.sin(np.pi * u * np.arange(1, N_WAVES + 1)[:, None])
    shapes, lines = _waves(rng, N_CLASSES), rng.normal(size=(N_CLASSES, 2, 1)) * u
    which = np.repeat(np.arange(N_CLASSES), n_shown + N_MEMBERS)
    paths = lines[which] + (shapes[which] + spread * _waves(rng, len(which))) @ sines
    demos = kineme.Demonstrations.from_arrays(paths.transpose(0, 2, 1), which)
    return rejected(demos, np.tile(np.arange(n_shown + N_MEMBERS) < n_shown, N_CLASSES))


def lasa(changes: Perturbation, seed: int) -> float:
    """Share rejected of LASA's 26 shapes, shown once, all changed in the same way."""
    demos = changes.apply(kineme.load_lasa(), [seed, 0])
    rng = np.random.default_rng(seed)
    shown = np.zeros(len(demos), bool)
    shown[7 * np.arange(26) + rng.integers(0, 7, 26)] = True
    return rejected(demos, shown)


def rejected(demos: kineme.Demonstrations, shown: NDArray[np.bool_]) -> float:
    """Share of the movements not shown whose p-value for their own class is at most 0.05."""
    recognizer = kineme.Recognizer().fit(demos[shown])
    rest = demos[~shown]
    own = np.searchsorted(recognizer.classes_, rest.labels)
    p_values = recognizer.p_values(rest, ERROR_RATE)[np.arange(len(rest)), own]
    return float(np.mean(p_values <= ERROR_RATE))


def _waves(rng: np.random.Generator, n: int) -> NDArray[np.float64]:
    return rng.normal(size=(n, 2, N_WAVES)) / np.arange(1, N_WAVES + 1) ** 0.5
