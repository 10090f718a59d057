"""One answer at a time: a label, an answer, and one with its transform, beside $P+ and DTW 1-NN.

Words and gestures in space are from the folder that KINEME_RECORDINGS names, see `bench.people`. What they are compared
with is prepared beforehand, of each method; each has one core.
"""

from __future__ import annotations

from itertools import cycle

import numpy as np

import kineme
from bench.movements import SEED
from bench.people import Recorded, recorded
from bench.rows import Row
from bench.timing import alone, medians
from kineme_experiments.evaluation.methods import METHODS, Options

N_COPIES, N_MOVING = 11, 21  # of a movement of 21 points, 63 columns
#: Set -> how many movements one is compared with, and which method that is beside it.
ONE_ANSWER = {"words": (400, "plus-cloud"), "gestures in space": (950, "dtw"), "movements of 63 columns": (200, "dtw")}


def measure(quick: bool) -> list[Row]:
    """The time of a label, of an answer, and of one with its transform, to a movement of people among others."""
    words, gestures = recorded("words2d.npz"), recorded("gestures3d.npz")
    if words is None or gestures is None:
        return []
    sets = {"words": words, "gestures in space": gestures, "movements of 63 columns": _of_many_points(gestures)}
    return [row for name, movements in sets.items() for row in _beside_rival(name, movements, quick)]


def _beside_rival(name: str, movements: Recorded, quick: bool) -> list[Row]:
    n, rival = ONE_ANSWER[name][0], METHODS[ONE_ANSWER[name][1]]
    if rival.unavailable():
        return []
    order = np.random.default_rng(SEED).permutation(len(movements.labels))
    shown = movements.take(order[:n]).demos
    contender, recognizer = rival.contender(Options(seed=SEED)), kineme.Recognizer().fit(shown)
    contender.fit(shown)
    asked = cycle([movements.demos[order[i : i + 1]] for i in range(n, n + 20)])
    works = {
        "a label": recognizer.predict,
        "an answer": recognizer.recognize,
        "an answer with its transform": lambda movement: recognizer.recognize(movement)[0].transform,
        "": contender.classify,
    }
    timed = {what: alone(lambda work=work: work(next(asked))) for what, work in works.items()}
    seconds = medians(timed, 20 if quick else 200, warm_up=5)
    return [
        Row(f"{what} among {n} {name}", "ms", 1000 * seconds[what], 1000 * seconds[""], rival.title,
            seconds[""] / seconds[what], (">=", 1.0), {"n": n})
        for what in works
        if what
    ]  # fmt: skip


def _of_many_points(gestures: Recorded, n_samples: int = 80) -> Recorded:
    """Twenty kinds of movements of 21 points, each of which makes a gesture, with points that wander a little."""
    rng, u = np.random.default_rng(SEED), np.linspace(0, 1, n_samples)
    paths = kineme.preprocess(gestures.demos, [kineme.Resample(n_samples)]).positions.reshape(-1, n_samples, 3)
    arrays, labels = [], []
    for kind in range(20):
        chosen = rng.choice(len(paths), N_MOVING, replace=False)
        for _ in range(N_COPIES):
            wander = 0.02 * rng.normal(size=(N_MOVING, n_samples, 3)).cumsum(axis=1) / np.sqrt(n_samples)
            arrays.append(np.hstack([paths[k] + away for k, away in zip(chosen, wander, strict=True)]))
            labels.append(f"kind {kind}")
    demos = kineme.Demonstrations.from_arrays(arrays, labels, [u] * len(arrays))
    return Recorded(demos, np.array(labels), np.zeros(len(arrays), dtype=int))
