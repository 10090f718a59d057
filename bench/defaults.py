"""What hangs on each default of `Recognizer`: one shot, 26 shapes, five splits, everything perturbed."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any
from unittest.mock import patch

import numpy as np

import kineme
from bench.rows import Row
from kineme.comparison import widths
from kineme.comparison.representation import DEFAULT_REPRESENTATIONS as THREE
from kineme.experiments.evaluation.conditions import TOGETHER
from kineme.experiments.evaluation.splits import few_shot
from kineme.movements.preparation.perturbations import Perturbation
from kineme.recognition import classifiers

SPLITS, SEED = 5, 0
LEVELS = {"moderately": TOGETHER[1], "strongly": TOGETHER[2]}
DRAWS, COPIES, SHOWN = 4, 3, 4
BENT = Perturbation(rotation=math.radians(40), warp=0.8, noise=0.1)

#: Name -> width of an SVM's kernels in widths of the nearest's, parameters of `Recognizer`.
MANY: dict[str, tuple[float, dict[str, Any]]] = {
    "1-NN, equal weights": (2.0, {"classifier": "nearest", "weights": "equal"}),
    "1-NN, chosen weights": (2.0, {"classifier": "nearest"}),
    "SVM, equal weights, kernels of 1-NN": (1.0, {"classifier": "svm", "weights": "equal"}),
    "SVM, equal weights, kernels twice as wide": (2.0, {"classifier": "svm", "weights": "equal"}),
    "SVM, chosen weights, kernels twice as wide": (2.0, {}),
}


def measure(quick: bool) -> list[Row]:
    splits = 1 if quick else SPLITS
    asked = {"defaults": {}, **_options()}
    rows = [
        Row(f"{name}, {level}", "accuracy", accuracy(options, changes, splits))
        for name, options in asked.items()
        for level, changes in LEVELS.items()
    ]
    return rows + [
        Row(f"many shown: {name}", "accuracy", many_shown(wider, options, 1 if quick else DRAWS))
        for name, (wider, options) in MANY.items()
    ]


def _options() -> dict[str, dict[str, Any]]:
    """Name -> parameters of `Recognizer` that differ from the defaults; "width" is a share of the typical distance."""
    found: dict[str, dict[str, Any]] = {
        f"{one.name.replace('forcing', 'f')} alone": {"representations": (one,)} for one in THREE
    }
    found |= {mean: {"mean": mean} for mean in ("geometric", "harmonic", "min", "quadratic")}
    found |= {f"{width} of it": {"width": width} for width in (0.2, 0.7)}
    found |= {f"{cutoff} cycles": {"cutoff": float(cutoff)} for cutoff in (5, 20)} | {"not smoothed": {"cutoff": None}}
    found |= {f"{angle}°": {"max_angle": math.radians(angle)} for angle in (0, 30, 45, 90, 180)}
    found |= {"per dimension": {"scale": "per-dimension"}, "size kept": {"scale": "none"}}
    for name, values in {"n_basis": (20, 80), "stiffness": (25.0, 400.0), "ridge": (1e-4, 1e-2)}.items():
        for value in values:
            found[f"{name} {value:g}"] = {"representations": tuple(replace(one, **{name: value}) for one in THREE)}
    return found


def accuracy(options: dict[str, Any], changes: Any, splits: int) -> float:
    """Mean over splits, with the splits and perturbations of ``kineme evaluate lasa --protocol robustness``."""
    demos = kineme.load_lasa()
    found = []
    for index in range(splits):
        split = few_shot(demos.labels, 1, SEED, index)
        perturbed = changes.apply(demos, [SEED, index])
        with patch.object(widths, "SHARE", options.get("width", widths.SHARE)):
            given = {name: value for name, value in options.items() if name != "width"}
            recognizer = kineme.Recognizer(**given).fit(perturbed[split.train])
        found.append(recognizer.score(perturbed[split.test], demos.labels[split.test]))
    return float(np.mean(found))


def many_shown(wider: float, options: dict[str, Any], draws: int) -> float:
    """Twelve of each shape: three bent copies of four recordings; asked are three of each of the other three."""
    demos = kineme.load_lasa()
    found = []
    for draw in range(draws):
        rng = np.random.default_rng(draw)
        shown = np.zeros(len(demos), bool)
        shown[np.concatenate([7 * c + rng.permutation(7)[:SHOWN] for c in range(26)])] = True
        copies = [BENT.apply(demos, [draw, k]) for k in range(COPIES)]
        train, test = (_joined(copies, some) for some in (shown, ~shown))
        with patch.object(classifiers, "_WIDER", wider):
            found.append(kineme.Recognizer(**options).fit(train).score(test, test.labels))
    return float(np.mean(found))


def _joined(copies: list[kineme.Demonstrations], some: Any) -> kineme.Demonstrations:
    every = [one for copy in copies for one in copy[some]]
    labels = np.concatenate([copy[some].labels for copy in copies])
    return kineme.Demonstrations.from_arrays([one.positions for one in every], labels, [one.times for one in every])
