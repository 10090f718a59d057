"""Gestures of people in space, templates by the other people only: kineme beside the best of its rivals.

The recordings are no part of the project: the environment variable KINEME_RECORDINGS names the folder of
gestures3d.npz, by default shared/data beside the checkout. Rivals that are not installed are left out; those of
experiments/rivals.txt are all.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from bench.rows import Row
from kineme_experiments.evaluation.conclusions import OURS
from kineme_experiments.evaluation.data import DataSet, load_data
from kineme_experiments.evaluation.methods import METHODS
from kineme_experiments.evaluation.score_split import score_split
from kineme_experiments.evaluation.trials import Settings

FOLDER = Path(os.environ.get("KINEME_RECORDINGS", Path(__file__).resolve().parents[3] / "shared" / "data"))
RIVALS = ("dtw", "dtw-path", "minirocket", "point-cloud", "plus-cloud", "quick-cloud")
SHOTS = (1, 3)
#: Classes -> wanted accuracy with one and with three shots.
WANTED = {"digits": (0.93, 0.99), "solids": (0.70, 0.85), "all 20": (0.80, 0.90)}


def measure(quick: bool) -> list[Row]:
    path = FOLDER / "gestures3d.npz"
    if not path.is_file():
        print(f"by_person: no {path.name} in {FOLDER}; name the folder in KINEME_RECORDINGS")
        return []
    data = load_data(str(path))
    methods = [OURS, *(name for name in RIVALS if not METHODS[name].unavailable())]
    rows = []
    for name, wanted in WANTED.items():
        chosen = _classes(data, name)
        means = {method: accuracies(chosen, method, 5 if quick else 15) for method in methods}
        best = [max((name for name in methods if name != OURS), key=lambda name, k=k: means[name][k]) for k in (0, 1)]
        rows += [
            Row(
                f"{name}, {shots} by others", "of 1", means[OURS][k], means[best[k]][k], METHODS[best[k]].title,
                target=(">=", wanted[k]), details={"by_method": {method: both[k] for method, both in means.items()}},
            )
            for k, shots in enumerate(SHOTS)
        ]  # fmt: skip
    return rows


def accuracies(data: DataSet, method: str, n_splits: int) -> list[float]:
    """Mean accuracy with one and with three shots; each of five people is tested equally often."""
    settings = Settings(n_splits, 0, SHOTS)
    scores = [score_split(data, "user-independent", method, k, settings) for k in range(n_splits)]
    return [float(np.mean([split[k].values["accuracy"] for split in scores])) for k in range(len(SHOTS))]


def _classes(data: DataSet, name: str) -> DataSet:
    digits = np.char.isdigit(np.asarray(data.demonstrations.labels, dtype=str))
    chosen = {"digits": digits, "solids": ~digits}.get(name, np.ones(len(digits), dtype=bool))
    people = np.asarray(data.people)[chosen]
    return DataSet(name, data.demonstrations[np.flatnonzero(chosen)], {}, people)
