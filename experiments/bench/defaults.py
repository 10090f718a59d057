"""What hangs on each default of `Recognizer`, one shot: on perturbed shapes, and on gestures of other people in space.

The shapes are the 26 of LASA, five splits, everything perturbed. The gestures are no part of the project, see
`bench.by_person`; where they are not there, they are left out.
"""

from __future__ import annotations

import math
from typing import Any
from unittest.mock import patch

import numpy as np

import kineme
from bench.by_person import FOLDER
from bench.rows import Row
from kineme.kernels.rotation import RotationPrior
from kineme.movements.preparation.perturbations import Perturbation
from kineme.recognition import classifiers
from kineme.similarity import similarity as widths
from kineme.similarity.specification import DEFAULT_REPRESENTATIONS, POSITIONS, Representation
from kineme_experiments.evaluation.conditions import TOGETHER
from kineme_experiments.evaluation.data import load_data
from kineme_experiments.evaluation.splits import few_shot

SPLITS, SEED = 5, 0
LEVELS = {"moderately": TOGETHER[1], "strongly": TOGETHER[2]}
PEOPLE = "by others"
DRAWS, COPIES, SHOWN = 4, 3, 4
BENT = Perturbation(rotation=math.radians(40), warp=0.8, noise=0.1)

#: Name -> width of an SVM's kernels in widths of the nearest's, parameters of `Recognizer`.
MANY: dict[str, tuple[float, dict[str, Any]]] = {
    "nearest of each representation": (2.0, {}),
    "the same, equal weights": (2.0, {"weights": "equal"}),
    "the same, own weights": (2.0, {"weights": "own"}),
    "1-NN": (2.0, {"classifier": "nearest"}),
    "SVM, kernels of 1-NN": (1.0, {"classifier": "svm"}),
    "SVM, kernels twice as wide": (2.0, {"classifier": "svm"}),
}


def measure(quick: bool) -> list[Row]:
    splits = 1 if quick else SPLITS
    asked = {"defaults": {}, **_options()}
    rows = [
        Row(f"{name}, {level}", "accuracy", accuracy(options, changes, splits))
        for name, options in asked.items()
        for level, changes in LEVELS.items()
    ]
    if (FOLDER / "gestures3d.npz").is_file():
        rows += [Row(f"{name}, {PEOPLE}", "accuracy", by_others(options, splits)) for name, options in asked.items()]
    else:
        print(f"defaults: no gestures3d.npz in {FOLDER}; name the folder in KINEME_RECORDINGS")
    return rows + [
        Row(f"many shown: {name}", "accuracy", many_shown(wider, options, 1 if quick else DRAWS))
        for name, (wider, options) in MANY.items()
    ]


def _options() -> dict[str, dict[str, Any]]:
    """Name -> parameters of `Recognizer` that differ from the defaults; "width" is a share of the typical distance."""
    own = np.array([one.weight for one in DEFAULT_REPRESENTATIONS])
    names = {one: one.name.replace("forcing", "f") for one in DEFAULT_REPRESENTATIONS}
    options: dict[str, dict[str, Any]] = {}
    for r, one in enumerate(DEFAULT_REPRESENTATIONS):
        alone = np.arange(len(DEFAULT_REPRESENTATIONS)) == r
        options[f"{names[one]} alone"] = {"weights": tuple(own * alone)}
        options[f"without {names[one]}"] = {"weights": tuple(own * ~alone)}
    options["with f over arc length"] = {
        "representations": (POSITIONS, Representation("forcing", 1.0), *DEFAULT_REPRESENTATIONS[1:])
    }
    coarse = np.array([not one.detailed for one in DEFAULT_REPRESENTATIONS])
    options["without detail"] = {"weights": tuple(own * coarse)}
    options["detail at the weight of the others"] = {"weights": tuple(np.where(coarse, own, 2.0))}
    options["equal weights"] = {"weights": "equal"}
    options |= {mean: {"mean": mean} for mean in ("geometric", "harmonic", "min", "quadratic")}
    options |= {f"{width} of it": {"width": width} for width in (0.25, 0.6)}
    options |= {f"{cutoff} cycles": {"cutoff": float(cutoff)} for cutoff in (5, 20)} | {
        "not smoothed": {"cutoff": None}
    }
    options |= {f"k = {k:g}": {"rotation_prior": RotationPrior(k)} for k in (0.0, 0.01, 0.1, 0.3)}
    options |= {f"a limit of {angle}°": {"max_angle": math.radians(angle)} for angle in (0, 60)}
    return options | {"per dimension": {"scale": "per-dimension"}, "size kept": {"scale": "none"}}


def accuracy(options: dict[str, Any], changes: Any, splits: int) -> float:
    """Mean over splits, with the splits and perturbations of ``kineme evaluate lasa --protocol robustness``."""
    demos = kineme.load_lasa()
    found = []
    for index in range(splits):
        split = few_shot(demos.labels, 1, SEED, index)
        perturbed = changes.apply(demos, [SEED, index])
        found.append(_fitted(options, perturbed[split.train]).score(perturbed[split.test]))
    return float(np.mean(found))


def by_others(options: dict[str, Any], draws: int) -> float:
    """All 20 gestures in space: one template each by the four other people, each person in turn."""
    data = load_data(str(FOLDER / "gestures3d.npz"))
    demos, people = data.demonstrations, np.asarray(data.people)
    labels = np.asarray(demos.labels)
    found = []
    for draw in range(draws):
        for k, person in enumerate(np.unique(people)):
            random, others = np.random.default_rng([SEED, draw, k]), people != person
            train = np.array([random.choice(np.flatnonzero(others & (labels == one))) for one in np.unique(labels)])
            found.append(_fitted(options, demos[train]).score(demos[np.flatnonzero(~others)]))
    return float(np.mean(found))


def _fitted(options: dict[str, Any], demos: kineme.Demonstrations) -> kineme.Recognizer:
    with patch.object(widths, "SHARE", options.get("width", widths.SHARE)):
        given = {name: value for name, value in options.items() if name != "width"}
        return kineme.Recognizer(**given).fit(demos)


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
