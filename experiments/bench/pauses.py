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
N_ASKED = 150  # movements of each draw, at most
N_ANSWERS = 6000  # of each set, in as many draws as that takes: standard errors are then a few thousandths


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
        draws, answers = [], 0
        while answers < (2 * N_ASKED if quick else N_ANSWERS):
            n_asked, plain, differences = _draw(demos, labels, people, len(draws))
            draws.append((plain, *differences))
            answers += n_asked
        plain, *means = np.mean(draws, axis=0).tolist()
        _, *errors = (np.std(draws, axis=0, ddof=1) / np.sqrt(len(draws))).tolist()
        for (seconds, at_rest), mean, error in zip(PAUSES, means, errors, strict=True):
            what = f"{name}, {seconds:g} s {'at rest' if at_rest else 'without samples'}"
            details = {"standard_error": error, "draws": len(draws), "accuracy_without_pause": plain}
            rows.append(Row(what, "difference of accuracy", mean, target=(">=", LEAST), details=details))
    return rows


def _draw(
    demos: kineme.Demonstrations, labels: np.ndarray, people: np.ndarray | None, seed: int
) -> tuple[int, float, list[float]]:
    """How many movements were asked, accuracy without a pause, and with each pause minus that."""
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
    return len(asked), plain, [accuracy(interrupted(demos[asked], *pause, seed)) - plain for pause in PAUSES]


def interrupted(demos: kineme.Demonstrations, seconds: float, at_rest: bool, seed: int) -> kineme.Demonstrations:
    """Each movement with one pause somewhere."""
    rng, arrays, times = np.random.default_rng(seed), [], []
    for demo in demos:
        t, x = np.array(demo.times), np.array(demo.positions)
        at = int(rng.uniform(0.05, 0.95) * (len(t) - 1)) + 1
        n_rest = max(1, int(seconds / np.median(np.diff(t)))) if at_rest else 0
        rest = t[at - 1] + seconds / max(1, n_rest) * np.arange(1, n_rest + 1)
        still = x[at - 1] + NOISE * np.ptp(x, axis=0).max() * rng.normal(size=(n_rest, x.shape[1]))
        times.append(np.concatenate((t[:at], rest, t[at:] + seconds)))
        arrays.append(np.concatenate((x[:at], still, x[at:])))
    return kineme.Demonstrations.from_arrays(arrays, demos.labels, times)
