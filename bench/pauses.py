"""What a pause in the middle of a drawing does to one-shot accuracy: with samples, at rest, and without."""

from __future__ import annotations

import numpy as np

import kineme
from bench.by_person import FOLDER
from bench.people import recorded
from bench.rows import Row

PAUSES = ((1.0, False), (10.0, False), (30.0, False), (1.0, True), (10.0, True), (30.0, True))  # seconds; with samples
NOISE = 0.002  # of the largest extent, at rest
LEAST = -0.01  # accuracy that a pause may cost
N_ASKED = 150


def measure(quick: bool) -> list[Row]:
    """Of LASA, and of recordings of people, whose templates are by other people."""
    files = sorted(FOLDER.glob("*.npz")) if FOLDER.is_dir() and not quick else []
    sets = [("LASA", kineme.load_lasa(), None)]
    for file in files:
        data = recorded(file.name)
        if data is not None:
            sets.append((file.stem, data.demos, data.people))
    rows = []
    for name, demos, people in sets:
        labels = np.asarray(demos.labels).astype(str)
        differences = np.mean([_differences(demos, labels, people, seed) for seed in range(2 if quick else 12)], axis=0)
        for (seconds, at_rest), difference in zip(PAUSES, differences.tolist(), strict=True):
            what = f"{name}, {seconds:g} s {'at rest' if at_rest else 'without samples'}"
            rows.append(Row(what, "difference of accuracy", difference, target=(">=", LEAST)))
    return rows


def _differences(demos: kineme.Demonstrations, labels: np.ndarray, people: np.ndarray | None, seed: int) -> list[float]:
    """Accuracy with each pause minus that without."""
    rng = np.random.default_rng(seed)
    chosen = people is not None and len(set(people)) > 1
    own = people == rng.choice(np.unique(people)) if chosen else np.ones(len(demos), bool)
    others = ~own if chosen else own
    shown = [rng.choice(np.flatnonzero(others & (labels == one))) for one in np.unique(labels[others])]
    asked = np.setdiff1d(np.flatnonzero(own), shown)
    asked = rng.choice(asked, min(N_ASKED, len(asked)), replace=False)
    recognizer = kineme.Recognizer().fit(demos[shown], labels[shown])

    def accuracy(movements: kineme.Demonstrations) -> float:
        return float(np.mean(recognizer.predict(movements) == labels[asked]))

    plain = accuracy(demos[asked])
    return [accuracy(interrupted(demos[asked], *pause, seed)) - plain for pause in PAUSES]


def interrupted(demos: kineme.Demonstrations, seconds: float, at_rest: bool, seed: int) -> kineme.Demonstrations:
    """Each movement with one pause somewhere."""
    rng, arrays, times = np.random.default_rng(seed), [], []
    for one in demos:
        t, x = np.array(one.times), np.array(one.positions)
        at = int(rng.uniform(0.05, 0.95) * (len(t) - 1)) + 1
        n_rest = max(1, int(seconds / np.median(np.diff(t)))) if at_rest else 0
        rest = t[at - 1] + seconds / max(1, n_rest) * np.arange(1, n_rest + 1)
        still = x[at - 1] + NOISE * np.ptp(x, axis=0).max() * rng.normal(size=(n_rest, x.shape[1]))
        times.append(np.concatenate((t[:at], rest, t[at:] + seconds)))
        arrays.append(np.concatenate((x[:at], still, x[at:])))
    return kineme.Demonstrations.from_arrays(arrays, demos.labels, times)
