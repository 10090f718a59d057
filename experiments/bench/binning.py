"""A linear SVM on random binning features: the truncated kernel on a million movements, in time linear in them."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np

import kineme
from bench.movements import SEED, Array
from bench.rows import Row
from kineme.kernels import TruncatedEuclidean
from kineme.kernels.random_binning import RandomBinning

N_SAMPLES, N_TEST, PASSES = 20, 5_000, 3
NOISE = 0.5  # of the spread of each number over the recordings: hard enough to tell sizes of training sets apart


def measure(quick: bool) -> list[Row]:
    few, many = (2_000, 20_000) if quick else (100_000, 1_000_000)
    rows, labels = _rows()
    test, truth = _copies(rows, labels, N_TEST, SEED + 1)
    binning = RandomBinning(n_shifts=2, seed=SEED).fit(_copies(rows, labels, few, SEED)[0])
    found = []
    for n in (few, many):
        X, y = _copies(rows, labels, n, SEED)
        started = perf_counter()
        model = _train(binning, X, y)
        seconds = perf_counter() - started
        found.append((seconds, float(model.score(binning.transform(test), truth))))
    exact = _exact(rows, labels, test, truth)
    (short, low), (long, high) = found
    details = {"n_samples": N_SAMPLES, "noise": NOISE, "passes": PASSES, "seed": SEED, "n_columns": binning.n_columns_}
    return [
        Row(f"train on {few:,} movements", "s", short, details=details),
        Row(f"train on {many:,} movements", "s", long),
        Row("time for ten times as many", "x", long / short, target=("<=", 12.0)),
        Row(f"accuracy after {few:,}", "", low),
        Row(f"accuracy after {many:,}", "", high),
        Row("accuracy of the exact kernel, 4,000 movements", "", exact),
    ]


def _train(binning: RandomBinning, X: Array, y: Any) -> Any:
    from sklearn.linear_model import SGDClassifier

    return SGDClassifier(max_iter=PASSES, tol=None, average=True, n_jobs=2, random_state=SEED).fit(
        binning.transform(X), y
    )


def _exact(rows: Array, labels: Any, test: Array, truth: Any) -> float:
    from sklearn.svm import SVC

    X, y = _copies(rows, labels, 4_000, SEED)
    return float(SVC(kernel=TruncatedEuclidean().fit(X), C=1.0).fit(X, y).score(test, truth))


def _rows() -> tuple[Array, Any]:
    """Forcing terms of the LASA movements, thinned, each column of unit spread."""
    lasa = kineme.load_lasa()
    rows = kineme.DMPFeatures("forcing", kineme.DMP(fit="forcing", n_basis=80), n_samples=N_SAMPLES).fit_transform(lasa)
    return (rows - rows.mean(axis=0)) / rows.std(axis=0), lasa.labels


def _copies(rows: Array, labels: Any, n: int, seed: int) -> tuple[Array, Any]:
    random = np.random.default_rng(seed)
    chosen = random.integers(0, len(rows), n)
    return rows[chosen] + NOISE * random.normal(size=(n, rows.shape[1])), labels[chosen]
