"""Gestures in space, templates by other people: which classifier answers, and whether the vertical is known."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import kineme
from bench.people import Recorded, recorded, splits
from bench.rows import Row

CLASSIFIERS = ("nearest-each", "nearest", "svm")
SHOTS = (2, 3, 4, 8, 24)
VERTICAL = (0.0, 1.0, 0.0)


def measure(quick: bool) -> list[Row]:
    gestures = recorded("gestures3d.npz")
    if gestures is None:
        return []
    draws = 1 if quick else 3
    rows = [
        Row(f"{classifier}, {shots} by others", "of 1", _accuracy(gestures, shots, draws, classifier=classifier))
        for shots in SHOTS
        for classifier in CLASSIFIERS
    ]
    for turned, movements in (("as recorded", gestures), ("turned about the vertical", _turned(gestures))):
        for shots in (1, 4):
            for known, prior in (("vertical not given", None), ("vertical given", VERTICAL)):
                found = _accuracy(
                    movements, shots, 2 * draws, rotation_prior=kineme.recognition.RotationPrior(vertical=prior)
                )
                rows.append(Row(f"{turned}, {known}, {shots} by others", "of 1", found))
    return rows


def _accuracy(one: Recorded, shots: int, draws: int, **options: Any) -> float:
    right = []
    for _, train, test in splits(one, shots, draws):
        recognizer = kineme.Recognizer(**options).fit(one.demos[train], one.labels[train])
        right.append(np.mean(recognizer.predict(one.demos[test]) == one.labels[test]))
    return float(np.mean(right))


def _turned(one: Recorded) -> Recorded:
    """Each movement turned by its own angle about the vertical."""
    angles = np.random.default_rng(0).uniform(0.0, 2 * np.pi, len(one.labels))
    turns = Rotation.from_rotvec(angles[:, None] * np.array(VERTICAL)).as_matrix()
    arrays = [each.positions @ turn.T for each, turn in zip(one.demos, turns, strict=True)]
    return one._replace(demos=kineme.Demonstrations.from_arrays(arrays, one.labels, [demo.times for demo in one.demos]))
