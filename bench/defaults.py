"""What hangs on each default of `Recognizer`: one shot, 26 shapes, five splits, everything perturbed."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any
from unittest.mock import patch

import numpy as np

import kineme
from bench.rows import Row
from kineme.evaluation.conditions import TOGETHER
from kineme.evaluation.splits import few_shot
from kineme.recognition import similarity
from kineme.recognition.representation import DEFAULT_REPRESENTATIONS as THREE

SPLITS, SEED = 5, 0
LEVELS = {"moderately": TOGETHER[1], "strongly": TOGETHER[2]}


def measure(quick: bool) -> list[Row]:
    splits = 1 if quick else SPLITS
    asked = {"defaults": {}, **_options()}
    return [
        Row(f"{name}, {level}", "accuracy", accuracy(options, changes, splits))
        for name, options in asked.items()
        for level, changes in LEVELS.items()
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
        with patch.object(similarity, "_WIDTH", options.get("width", similarity._WIDTH)):
            given = {name: value for name, value in options.items() if name != "width"}
            recognizer = kineme.Recognizer(**given).fit(perturbed[split.train])
        found.append(recognizer.score(perturbed[split.test], demos.labels[split.test]))
    return float(np.mean(found))
