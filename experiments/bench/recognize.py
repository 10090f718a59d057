"""Recognizing: one demonstration per class from ragged arrays, against DTW 1-NN; and one movement among many."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

import kineme
from bench.movements import SEED, Array
from bench.peers import dtw_nearest
from bench.rows import Row
from bench.space import lifted
from bench.timing import medians
from kineme.movements.preparation.perturbations import Perturbation
from kineme.similarity.scores import Compared

SHORTEST, LONGEST = 120, 200
N_POINTS = 200
_PERTURBATION = Perturbation(shift=1.0, scale=1.0, rotation=np.radians(20), warp=0.35, noise=0.01)


def measure(quick: bool) -> list[Row]:
    lasa = kineme.load_lasa()
    rows, demos = _fit_and_predict(lasa, "the plane", 60.0, quick)
    in_space, _ = _fit_and_predict(lifted(lasa), "space", 30.0, quick)
    return [*rows, *_among_many(demos, quick), in_space[0]]


def _fit_and_predict(lasa: Any, where: str, target: float, quick: bool) -> tuple[list[Row], Any]:
    """The whole, beside the peer, and its stages; and the movements that were recognized."""
    n, n_peer, repeats = (2_000, 50, 3) if quick else (10_000, 500, 7)
    train = np.arange(0, len(lasa), 7)
    arrays, times, labels = _ragged(lasa, n)
    shots = [np.array(lasa[int(i)].positions) for i in train], [np.array(lasa[int(i)].times) for i in train]
    known = lasa.labels[train]

    def one_shot() -> Any:
        recognizer = kineme.Recognizer().fit(kineme.Demonstrations.from_arrays(shots[0], known, shots[1]))
        return recognizer.predict(kineme.Demonstrations.from_arrays(arrays, times=times))

    demos = kineme.Demonstrations.from_arrays(arrays, labels, times)
    stored, asked = _paths(lasa[train]), _paths(demos[:n_peer])  # resampled beforehand: DTW pays for comparing alone
    recognizer = kineme.Recognizer().fit(lasa[train])
    compared = Compared(recognizer.comparison_, recognizer.references_, recognizer.describe(demos))
    smoothed = kineme.preprocess(demos, [kineme.Smooth(10.0)])
    seconds = medians(
        {
            "one shot": one_shot,
            "collect": lambda: kineme.Demonstrations.from_arrays(arrays, times=times),
            "fit": lambda: kineme.Recognizer().fit(lasa[train]),
            "smooth": lambda: kineme.preprocess(demos, [kineme.Smooth(10.0)]),
            "look": lambda: recognizer.describe(demos),
            "look without smoothing": lambda: recognizer.__class__(cutoff=None).fit(lasa[train]).describe(smoothed),
            "compare": lambda: recognizer.classifier_.best(replace(compared)),
            "DTW": lambda: dtw_nearest(asked, stored, N_POINTS // 10),
        },
        repeats,
    )
    ours, theirs = n / seconds["one shot"], n_peer / seconds["DTW"]
    details = {"n": n, "n_peer": n_peer, "classes": len(train), "lengths": [SHORTEST, LONGEST], "seed": SEED}
    details |= {"repeats": repeats, "seconds": seconds, "perturbation": repr(_PERTURBATION)}
    details |= {
        "accuracy": float(np.mean(one_shot() == labels)),
        "accuracy_dtw": float(np.mean(known[dtw_nearest(asked, stored, N_POINTS // 10)] == labels[:n_peer])),
    }
    what = f"fit and predict in {where}, 26 classes, {n:,} ragged movements"
    peer = "dtaidistance, 10 % band"
    stages = {"collect": "collect", "smooth": "smooth", "compare": "compare"}
    rows = [
        Row(what, "/s", ours, theirs, peer, ours / theirs, (">=", target), details),
        *(Row(f"  of which {words}", "ms", 1000 * seconds[stage]) for words, stage in stages.items()),
        Row("  of which phases and forcing terms", "ms", 1000 * (seconds["look"] - seconds["smooth"])),
    ]
    return rows, demos


def _among_many(demos: Any, quick: bool) -> list[Row]:
    """The time of one question; the whole answer is asked for, not the label alone."""
    recognizer = kineme.Recognizer().fit(demos)
    movements = [demos[i] for i in range(20)]
    turn = iter(range(10**9))
    seconds = medians(
        {"ask": lambda: recognizer.recognize(movements[next(turn) % 20])}, 20 if quick else 200, warm_up=5
    )
    what = f"one movement among {len(demos):,}"
    return [Row(what, "ms", 1000 * seconds["ask"], target=("<=", 10.0), details={"n": len(demos)})]


def _ragged(lasa: Any, n: int) -> tuple[list[Array], list[Array], Array]:
    """Perturbed copies of the demonstrations that do not train, unevenly sampled: positions, stamps, labels."""
    random = np.random.default_rng(SEED)
    others = np.setdiff1d(np.arange(len(lasa)), np.arange(0, len(lasa), 7))
    demos = _PERTURBATION.apply(lasa[random.choice(others, n)], SEED)
    arrays, times = [], []
    for one, length in zip(demos, random.integers(SHORTEST, LONGEST + 1, n), strict=True):
        inner = np.sort(random.choice(np.arange(1, len(one) - 1), length - 2, replace=False))
        kept = np.concatenate(([0], inner, [len(one) - 1]))
        arrays.append(one.positions[kept])
        times.append(one.times[kept])
    return arrays, times, demos.labels


def _paths(demos: Any) -> Array:
    """Centered and scaled positions, (n, 200, d)."""
    x = kineme.preprocess(demos, [kineme.Resample(N_POINTS)]).positions.reshape(len(demos), N_POINTS, -1)
    x = x - x.mean(axis=1, keepdims=True)
    return np.ascontiguousarray(x / np.sqrt((x**2).sum(axis=2).mean(axis=1))[:, None, None])
