"""Anchoring: whether the kinds that are proposed without labels are those that people drew."""

from __future__ import annotations

import math
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kineme
from bench.rows import Row
from kineme.anchoring import propose
from kineme.movements.preparation.perturbations import Perturbation

#: All perturbations of one-shot recognition together.
_PERTURBATION = Perturbation(shift=1.0, scale=1.0, rotation=math.radians(20), warp=0.35, noise=0.01)


def measure(quick: bool) -> list[Row]:
    lasa = kineme.load_lasa()
    seeds = range(2 if quick else 10)
    rows = []
    for method in ("agglomerative", "hdbscan"):
        started = perf_counter()
        clean = _score(lasa, lasa.labels, method)
        seconds = perf_counter() - started
        perturbed = [_score(_PERTURBATION.apply(lasa, seed), lasa.labels, method) for seed in seeds]
        details = {"n": len(lasa), "seeds": list(seeds), "scores": perturbed, "perturbation": repr(_PERTURBATION)}
        rows += [
            Row(f"{method}: ARI, as recorded", "", clean, target=(">=", 0.95), details={"seconds": seconds}),
            Row(
                f"{method}: ARI, all perturbed, mean",
                "",
                float(np.mean(perturbed)),
                target=(">=", 0.9),
                details=details,
            ),
            Row(f"{method}: ARI, all perturbed, least", "", float(np.min(perturbed)), target=(">=", 0.9)),
            Row(f"{method}: {len(lasa)} movements", "s", seconds),
        ]
    return rows


def _score(movements: Any, labels: NDArray[Any], method: str) -> float:
    """Adjusted Rand index; every movement that is left over counts as a kind of its own."""
    from sklearn.metrics import adjusted_rand_score

    clusters = propose(movements, method).clusters.copy()
    alone = clusters < 0
    clusters[alone] = clusters.max(initial=-1) + 1 + np.arange(alone.sum())
    return float(adjusted_rand_score(labels, clusters))
