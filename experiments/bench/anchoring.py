"""Anchoring: whether the clusters that are proposed without labels are the classes that people drew.

By several people: gestures in space and exercises from the folder that KINEME_RECORDINGS names, see `bench.by_person`.
"""

from __future__ import annotations

import math
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kineme
from bench.by_person import FOLDER
from bench.rows import Row
from kineme.anchoring.proposals import DEFAULT_METHOD, Proposals, propose
from kineme.movements.preparation.perturbations import Perturbation
from kineme_experiments.evaluation.data import load_data

#: All perturbations of one-shot recognition together.
_PERTURBATION = Perturbation(shift=1.0, scale=1.0, rotation=math.radians(20), warp=0.35, noise=0.01)


def measure(quick: bool) -> list[Row]:
    lasa = kineme.load_lasa()
    seeds = range(2 if quick else 10)
    rows = []
    for method in ("spectral", "agglomerative", "hdbscan"):
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
    return rows + _by_people()


def _by_people() -> list[Row]:
    """Digits, solids and both by all people at once, named or not, and by each alone; exercises; the default method."""
    path, exercises = FOLDER / "gestures3d.npz", FOLDER / "exercises6d.npz"
    if not path.is_file():
        print(f"anchoring: no {path.name} in {FOLDER}; name the folder in KINEME_RECORDINGS")
        return []
    data = load_data(str(path))
    people = np.asarray(data.people)
    digits = np.char.isdigit(np.asarray(data.demonstrations.labels, dtype=str))
    rows = []
    for name, chosen in (("digits", digits), ("solids", ~digits), ("all", digits | ~digits)):
        own = [data.demonstrations[np.flatnonzero(chosen & (people == one))] for one in np.unique(people)]
        scores = [_score(some, some.labels, DEFAULT_METHOD) for some in own]
        rows.append(Row(f"{name}: ARI, one person, mean", "", float(np.mean(scores)), target=(">=", 0.95)))
        rows += _by_all(name, data.demonstrations[np.flatnonzero(chosen)], people[chosen])
    if exercises.is_file():
        at_a_wrist = load_data(str(exercises))
        rows += _by_all("exercises", at_a_wrist.demonstrations, np.asarray(at_a_wrist.people))
    return rows


def _by_all(name: str, movements: Any, people: NDArray[Any]) -> list[Row]:
    """All people at once, named or not."""
    rows = []
    for told, groups in (("", None), (", named", people)):
        started = perf_counter()
        proposals = propose(movements, groups=groups)
        seconds = perf_counter() - started
        details = {"found": len(proposals), "classes": len(np.unique(movements.labels)), "seconds": seconds}
        what = f"{name}: ARI, {len(np.unique(people))} people{told}"
        rows.append(Row(what, "", _agreement(proposals, movements.labels), target=(">=", 0.9), details=details))
    return rows


def _score(movements: Any, labels: NDArray[Any], method: str) -> float:
    """Agreement of what is proposed with the labels."""
    return _agreement(propose(movements, method), labels)


def _agreement(proposals: Proposals, labels: NDArray[Any]) -> float:
    """Adjusted Rand index; every movement that is left over counts as a class of its own."""
    from sklearn.metrics import adjusted_rand_score

    clusters = proposals.clusters.copy()
    alone = clusters < 0
    clusters[alone] = clusters.max(initial=-1) + 1 + np.arange(alone.sum())
    return float(adjusted_rand_score(labels, clusters))
